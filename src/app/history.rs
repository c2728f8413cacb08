//! What was edited, as orders both ways: undoing is doing the opposite, so that it too is logged and reaches every lane.

use super::order::Order;

/// One edit.
#[derive(Clone, Debug, PartialEq)]
pub struct Edit {
    /// What to call it.
    pub label: String,
    /// The lane it was made in, or all.
    pub lane: Option<usize>,
    /// Takes it back.
    pub undo: Vec<Order>,
    /// Does it.
    pub redo: Vec<Order>,
}

/// Edits that can be taken back; the oldest are forgotten, or a day's work would fill the memory.
const MOST: usize = 1000;

/// Edits done and taken back.
#[derive(Clone, Debug, Default)]
pub struct History {
    done: Vec<Edit>,
    undone: Vec<Edit>,
    /// The last edit may still grow: a slider is being dragged.
    open: bool,
    /// The user was told what taking the last edit back means.
    is_told: bool,
}

impl History {
    /// Whether an edit of this label would become part of the last one.
    pub fn is_growing(&self, label: &str, lane: Option<usize>) -> bool {
        self.open && self.done.last().is_some_and(|last| last.label == label && last.lane == lane)
    }

    /// Adds an edit; one of the same label while a slider is dragged becomes part of the last.
    pub fn push(&mut self, edit: Edit) {
        self.undone.clear();
        self.is_told = false;
        let grows = self.is_growing(&edit.label, edit.lane);
        match self.done.last_mut().filter(|_| grows) {
            Some(last) => last.redo = edit.redo,
            None => self.done.push(edit),
        }
        if self.done.len() > MOST {
            self.done.remove(0);
        }
        self.open = true;
    }

    /// Whether taking the last edit back leaves the open scene, which is to be told before it is done. True once for each time.
    pub fn warns(&mut self) -> bool {
        let leaves = |edit: &Edit| edit.undo.iter().any(|order| matches!(order, Order::Open(_)));
        self.done.last().is_some_and(leaves) && !std::mem::replace(&mut self.is_told, true)
    }

    /// The last edit is complete.
    pub fn seal(&mut self) {
        self.open = false;
    }

    /// The edit to take back.
    pub fn undo(&mut self) -> Option<Edit> {
        (self.open, self.is_told) = (false, false);
        let edit = self.done.pop()?;
        self.undone.push(edit.clone());
        Some(edit)
    }

    /// The edit to do again.
    pub fn redo(&mut self) -> Option<Edit> {
        (self.open, self.is_told) = (false, false);
        let edit = self.undone.pop()?;
        self.done.push(edit.clone());
        Some(edit)
    }

    /// What would be undone and redone.
    pub fn names(&self) -> [Option<&str>; 2] {
        [&self.done, &self.undone].map(|edits| edits.last().map(|edit| edit.label.as_str()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Command;

    fn set(key: &str, before: &str, after: &str) -> Edit {
        let order = |value: &str| {
            vec![Order::Apply(None, Command::Set { key: key.to_owned(), value: value.to_owned() })]
        };
        Edit { label: key.to_owned(), lane: None, undo: order(before), redo: order(after) }
    }

    #[test]
    fn a_dragged_slider_is_one_edit() {
        let mut history = History::default();
        history.push(set("dt", "1", "2"));
        history.push(set("dt", "2", "3"));
        history.seal();
        history.push(set("dt", "3", "4"));
        assert_eq!(history.undo(), Some(set("dt", "3", "4")));
        assert_eq!(history.undo(), Some(set("dt", "1", "3")));
        assert_eq!(history.undo(), None);
        assert_eq!(history.redo(), Some(set("dt", "1", "3")));
    }

    #[test]
    fn only_so_many_edits_are_remembered() {
        let mut history = History::default();
        for i in 0..2 * MOST {
            history.push(set("dt", &i.to_string(), &(i + 1).to_string()));
            history.seal();
        }
        let taken_back = std::iter::from_fn(|| history.undo()).count();
        assert_eq!(taken_back, MOST);
    }

    #[test]
    fn a_new_edit_forgets_what_was_undone() {
        let mut history = History::default();
        history.push(set("dt", "1", "2"));
        history.undo();
        history.push(set("air_damping", "1", "2"));
        assert_eq!(history.redo(), None);
        assert_eq!(history.names(), [Some("air_damping"), None]);
    }
}
