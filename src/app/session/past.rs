//! Moments of the past: shown, gone on from, and played again.

use super::{Edit, Order, Session};

/// Whether an order makes time go on from the moment that is shown, or changes what happens there.
pub(super) fn goes_on(order: &Order) -> bool {
    match order {
        Order::Run(running) => *running,
        Order::Scrub(_)
        | Order::Keep(_)
        | Order::Speed(_)
        | Order::Values(_)
        | Order::Reference(_)
        | Order::Record(_)
        | Order::Remember(_)
        | Order::Rename(..)
        | Order::Study(_) => false,
        _ => true,
    }
}

impl Session {
    /// Shows the moment of a place on the timeline, s. Until time goes on from there, it goes on from wherever one looks last.
    pub fn scrub(&mut self, to: f64) {
        self.held.clear();
        self.running = false;
        if !self.is_in_the_past {
            self.push_state("go back in time");
            self.message = None;
        }
        self.order(Order::Scrub(to));
        self.is_in_the_past = true;
    }

    /// Plays everything again from the start, with what was done; time stands still at first.
    pub fn play_again(&mut self) {
        self.held.clear();
        self.push_state("play again");
        self.message = Some("at the start: Space plays again what was done, on every lane".to_owned());
        self.order(Order::Again);
        self.running = false;
    }

    /// An edit that is taken back by going to the present state.
    fn push_state(&mut self, label: &str) {
        self.kept += 1;
        self.order(Order::Keep(self.kept));
        let back = vec![Order::Exchange { number: self.kept, otherwise: Vec::new() }];
        self.history.push(Edit { label: label.to_owned(), lane: None, undo: back.clone(), redo: back });
        self.history.seal();
    }
}
