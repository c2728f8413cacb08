//! The commands that a world has taken, as a list that worlds and snapshots share: adding one and keeping the list as it is now
//! both take no time, and going from one snapshot to another loses no command.

use super::Entry;
use std::sync::Arc;

/// A list that grows at its end; a clone is the list as it is now.
#[derive(Clone, Default)]
pub(super) struct Log(Option<Arc<Node>>);

struct Node {
    entry: Entry,
    /// Entries until this one.
    count: usize,
    before: Log,
}

impl Log {
    pub fn push(&mut self, entry: Entry) {
        let before = std::mem::take(self);
        self.0 = Some(Arc::new(Node { entry, count: before.len() + 1, before }));
    }

    pub fn len(&self) -> usize {
        self.0.as_ref().map_or(0, |node| node.count)
    }

    /// The entries, the oldest first.
    pub fn to_vec(&self) -> Vec<Entry> {
        self.since(0)
    }

    /// The same without the first `count`.
    pub fn since(&self, count: usize) -> Vec<Entry> {
        let mut entries = Vec::new();
        let mut next = &self.0;
        while let Some(node) = next.as_ref().filter(|node| node.count > count) {
            entries.push(node.entry.clone());
            next = &node.before.0;
        }
        entries.reverse();
        entries
    }
}

impl FromIterator<Entry> for Log {
    fn from_iter<I: IntoIterator<Item = Entry>>(entries: I) -> Self {
        let mut log = Self::default();
        entries.into_iter().for_each(|entry| log.push(entry));
        log
    }
}

impl Drop for Log {
    /// One after the other: nodes that drop those before them would need a stack as deep as the list is long.
    fn drop(&mut self) {
        let mut next = self.0.take();
        while let Some(mut node) = next.and_then(Arc::into_inner) {
            next = node.before.0.take();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::Command;

    fn entry(step: u64) -> Entry {
        Entry { step, command: Command::Reset }
    }

    #[test]
    fn a_clone_keeps_what_the_other_goes_on_from() {
        let mut one: Log = (0..3).map(entry).collect();
        let mut other = one.clone();
        one.push(entry(7));
        other.push(entry(8));
        let steps = |log: &Log| log.to_vec().iter().map(|entry| entry.step).collect::<Vec<_>>();
        assert_eq!((steps(&one), steps(&other)), (vec![0, 1, 2, 7], vec![0, 1, 2, 8]));
        assert_eq!((one.len(), Log::default().len()), (4, 0));
        assert_eq!((one.since(3), one.since(9)), (vec![entry(7)], Vec::new()));
    }

    #[test]
    fn a_long_list_is_dropped_without_a_deep_stack() {
        let long: Log = (0..1_000_000).map(entry).collect();
        let shared = long.clone();
        drop(long);
        assert_eq!(shared.len(), 1_000_000);
    }
}
