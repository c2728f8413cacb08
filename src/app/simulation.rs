//! The simulation's own thread: orders go in, the newest state comes out, and nobody waits for a step.

use std::{
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use super::{
    autosave::Autosave,
    engine::{Engine, GivenUp, Order, State},
};
use crate::world::Command;

/// The interface's end.
pub struct Simulation {
    orders: Sender<Order>,
    sent: u64,
    state: Arc<Mutex<Arc<State>>>,
    /// Since when the thread has been at work without a look at its orders.
    at_work: Arc<Mutex<Option<Instant>>>,
    stop: Arc<AtomicBool>,
    given_up: GivenUp,
    thread: Option<JoinHandle<Engine>>,
}

/// Pictures of the state at most this often; more would only be copied, never seen.
const STATE_EVERY: Duration = Duration::from_millis(8);
/// The same while nothing moves that could be seen: only the numbers change then.
const STILL_EVERY: Duration = Duration::from_millis(100);
/// A move that cannot be seen between two states, as a part of the cloth's size: a tenth of a pixel on a large screen.
const UNSEEN: f32 = 5e-5;

impl Simulation {
    /// Starts the thread; `wake` is called after each new state, and what is done is written down by `autosave`.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        mut engine: Engine,
        mut autosave: Option<Autosave>,
        wake: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (orders, inbox) = channel();
        let state = Arc::new(Mutex::new(Arc::new(engine.state())));
        let (stop, at_work) = (engine.stop(), Arc::default());
        let (outbox, watch) = (Arc::clone(&state), Arc::clone(&at_work));
        let given_up = engine.given_up();
        let thread = std::thread::Builder::new().name("simulation".to_owned()).spawn(move || {
            run(&mut engine, autosave.as_mut(), &inbox, &outbox, &watch, wake);
            engine
        })?;
        Ok(Self { orders, sent: 0, state, at_work, stop, given_up, thread: Some(thread) })
    }

    /// The thread, the first time: it ends once this is dropped, and gives the engine back.
    pub fn thread(&mut self) -> Option<JoinHandle<Engine>> {
        self.thread.take()
    }

    /// Sends an order. It is taken between two steps.
    pub fn send(&mut self, order: Order) {
        // The thread ends only with the last sender.
        if self.orders.send(order).is_ok() {
            self.sent += 1;
        }
    }

    /// Gives up what the orders up to this number are opening.
    pub fn give_up(&self, order: u64) {
        self.given_up.until(order);
    }

    /// The newest state. The lock is held for a pointer's copy.
    pub fn state(&self) -> Arc<State> {
        Arc::clone(&self.state.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// How long the thread has been at work without a look at its orders.
    pub fn at_work(&self) -> Duration {
        let since = *self.at_work.lock().unwrap_or_else(PoisonError::into_inner);
        since.map_or(Duration::ZERO, |since| since.elapsed())
    }

    /// Breaks off the step under way; the order that time stands still is to follow.
    pub fn break_off(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    /// Number of orders sent; a state with as many has seen them all.
    pub fn sent(&self) -> u64 {
        self.sent
    }
}

impl Drop for Simulation {
    fn drop(&mut self) {
        // Nobody waits for what is still being opened.
        self.give_up(u64::MAX);
    }
}

/// Ends when the interface is gone.
fn run(
    engine: &mut Engine,
    mut autosave: Option<&mut Autosave>,
    inbox: &Receiver<Order>,
    outbox: &Mutex<Arc<State>>,
    at_work: &Mutex<Option<Instant>>,
    wake: impl Fn(),
) {
    let begin = || *at_work.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    let end = || *at_work.lock().unwrap_or_else(PoisonError::into_inner) = None;
    let mut last = Instant::now();
    let mut told = Instant::now();
    let mut news = true;
    let mut every = STATE_EVERY;
    let mut waiting = Vec::new();
    loop {
        loop {
            match inbox.try_recv() {
                Ok(order) => waiting.push(order),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return,
            }
        }
        if !waiting.is_empty() {
            (news, every) = (true, STATE_EVERY);
        }
        begin();
        take_all(engine, &mut waiting);
        let now = Instant::now();
        let elapsed = now.duration_since(std::mem::replace(&mut last, now));
        news |= engine.advance(elapsed, || false);
        end();
        if news && told.elapsed() >= every {
            let mut state = engine.state();
            let before = Arc::clone(&outbox.lock().unwrap_or_else(PoisonError::into_inner));
            state.is_still = is_still(&before, &state);
            every = if state.is_still { STILL_EVERY } else { STATE_EVERY };
            *outbox.lock().unwrap_or_else(PoisonError::into_inner) = Arc::new(state);
            wake();
            told = Instant::now();
            news = false;
        }
        if let Some(autosave) = autosave.as_deref_mut().filter(|autosave| autosave.wait().is_zero()) {
            autosave.put(engine.draft());
            if let Some(why) = autosave.failure() {
                engine.tell(format!("what is done is not saved by itself: {why}"));
                news = true;
            }
        }
        let idle = if news { every.saturating_sub(told.elapsed()).min(engine.idle()) } else { engine.idle() };
        let idle = autosave.as_ref().map_or(idle, |autosave| idle.min(autosave.wait()));
        if idle.is_zero() {
            continue;
        }
        match inbox.recv_timeout(idle) {
            Ok(order) => waiting.push(order),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

/// Whether a picture of the one state would look like that of the other.
fn is_still(before: &State, now: &State) -> bool {
    before.lanes.len() == now.lanes.len()
        && before.lanes.iter().zip(&now.lanes).all(|(before, now)| {
            let size = now.positions.iter().flatten().fold(0.0_f32, |size, x| size.max(x.abs()));
            let moves =
                |(a, b): (&[f32; 3], &[f32; 3])| a.iter().zip(b).any(|(a, b)| (a - b).abs() > UNSEEN * size);
            before.geometry.version == now.geometry.version
                && before.positions.len() == now.positions.len()
                && !before.positions.iter().zip(now.positions.iter()).any(moves)
        })
}

/// Takes the orders that came while a step was taken. A slider's earlier values are needless then: the last one stands.
fn take_all(engine: &mut Engine, waiting: &mut Vec<Order>) {
    let mut orders = waiting.drain(..).peekable();
    while let Some(order) = orders.next() {
        if orders.peek().is_some_and(|next| replaces(next, &order)) {
            engine.skip();
        } else {
            engine.take(order);
        }
    }
}

fn replaces(next: &Order, order: &Order) -> bool {
    match (next, order) {
        (Order::Apply(a, Command::Set { key: new, .. }), Order::Apply(b, Command::Set { key: old, .. })) => {
            a == b && new == old
        }
        (Order::Scrub(_), Order::Scrub(_)) => true,
        (Order::Drag(new), Order::Drag(old)) => new.iter().map(|d| d.0).eq(old.iter().map(|d| d.0)),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        app::engine::{LaneSetup, Origin},
        scene::{Place, Scene},
    };

    fn start(ron: &str) -> Simulation {
        let scene = Scene::from_ron(ron).expect("a scene");
        let setup = LaneSetup {
            title: "test".to_owned(),
            scene,
            place: Place::default(),
            file: None,
            origin: Origin::Start,
        };
        Simulation::start(Engine::new(vec![setup]).expect("opens"), None, || {}).expect("a thread")
    }

    fn wait(simulation: &Simulation, until: impl Fn(&State) -> bool) -> Arc<State> {
        let start = Instant::now();
        while !until(&simulation.state()) {
            assert!(start.elapsed() < Duration::from_secs(20), "nothing happens");
            std::thread::sleep(Duration::from_millis(2));
        }
        simulation.state()
    }

    #[test]
    fn orders_are_taken_and_states_come_back() {
        let mut simulation = start("()");
        simulation.send(Order::Run(true));
        let state = wait(&simulation, |state| state.lanes[0].time > 0.1);
        assert!(state.running);
        simulation.send(Order::Apply(None, Command::Set { key: "dt".to_owned(), value: "0.01".to_owned() }));
        let state = wait(&simulation, |state| state.orders == simulation.sent());
        assert_eq!(state.lanes[0].scene.dt, 0.01);
    }

    #[test]
    fn a_step_that_takes_long_is_broken_off_and_the_next_is_taken() {
        // It would take some hours.
        let mut simulation =
            start("(simulator: (id: \"xpbd\", params: {\"substeps\": 100000, \"iterations\": 100000}))");
        simulation.send(Order::Step(8));
        let start = Instant::now();
        while simulation.at_work() < Duration::from_millis(100) {
            assert!(start.elapsed() < Duration::from_secs(20), "it does not begin");
            std::thread::sleep(Duration::from_millis(2));
        }
        simulation.break_off();
        simulation.send(Order::Run(false));
        let state = wait(&simulation, |state| state.orders == simulation.sent());
        assert_eq!((state.lanes[0].steps, state.running), (0, false));
        assert!(state.news.as_ref().is_some_and(|(_, told)| told.contains("broken off")), "{:?}", state.news);
        let method =
            Command::Set { key: "simulator.id".to_owned(), value: "\"symplectic_euler\"".to_owned() };
        simulation.send(Order::Apply(None, method));
        simulation.send(Order::Step(8));
        wait(&simulation, |state| state.lanes[0].steps == 8);
    }

    #[test]
    fn a_cloth_at_rest_is_told_to_be_still() {
        // Nothing pulls at it: it lies where it is.
        let mut simulation = start("(gravity: (enabled: false))");
        simulation.send(Order::Run(true));
        wait(&simulation, |state| state.is_still && state.lanes[0].time > 0.1);
        let gravity = Command::Set { key: "gravity.enabled".to_owned(), value: "true".to_owned() };
        simulation.send(Order::Apply(None, gravity));
        wait(&simulation, |state| !state.is_still && state.lanes[0].positions[624][1] < -0.1);
    }

    #[test]
    fn a_slow_step_makes_nobody_wait() {
        // About 40 000 particles in debug mode: a beat takes far longer than a picture.
        let mut simulation =
            start("(target: Grid(columns: 200, rows: 200, spacing: 1.0, plane: Horizontal))");
        simulation.send(Order::Run(true));
        let start = Instant::now();
        for _ in 0..100 {
            let _ = simulation.state();
            simulation.send(Order::Speed(1.0));
        }
        assert!(start.elapsed() < Duration::from_millis(50), "{:?}", start.elapsed());
        simulation.send(Order::Run(false));
        wait(&simulation, |state| state.orders == simulation.sent() && !state.running);
    }
}
