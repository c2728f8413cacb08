//! Finds out what is there already among millions of small things, in linear time: a table of hashes that holds only numbers, so
//! that it stays small, with the things themselves elsewhere.

use std::hash::{BuildHasher, RandomState};

/// The first of all things that are the same, by their numbers. Hashes are keyed at random, so that no file can make many of them
/// agree; no result depends on the key.
pub(super) struct Firsts {
    key: [u64; 2],
    /// A part of the hash and the number, or [`Self::FREE`].
    slots: Vec<[u32; 2]>,
}

impl Firsts {
    const FREE: [u32; 2] = [u32::MAX; 2];

    /// A table with room for so many things.
    pub fn new(things: usize) -> Self {
        let state = RandomState::new();
        let slots = vec![Self::FREE; (2 * things).next_power_of_two()];
        Self { key: [state.hash_one(0), state.hash_one(1) | 1], slots }
    }

    /// A hash of words in their order: multiplied and folded, as in wyhash (Wang Yi, 2019).
    pub fn hash<const N: usize>(&self, words: [u64; N]) -> u64 {
        words.into_iter().fold(self.key[0], |hash, word| {
            let product = u128::from(hash ^ word) * u128::from(self.key[1]);
            product as u64 ^ (product >> 64) as u64
        })
    }

    /// The slot of what has this hash and is the same, or the free one where it would be, with its number.
    fn slot(&self, hash: u64, is_same: impl Fn(u32) -> bool) -> (usize, Option<u32>) {
        let mask = self.slots.len() - 1;
        let mut slot = hash as usize & mask;
        loop {
            let [part, number] = self.slots[slot];
            if [part, number] == Self::FREE {
                return (slot, None);
            }
            if part == (hash >> 32) as u32 && is_same(number) {
                return (slot, Some(number));
            }
            slot = (slot + 1) & mask;
        }
    }

    /// The first thing with this hash that is the same, if there is one.
    pub fn find(&self, hash: u64, is_same: impl Fn(u32) -> bool) -> Option<u32> {
        self.slot(hash, is_same).1
    }

    /// The same, or else the thing of this number, which is now the first.
    pub fn find_or_add(&mut self, hash: u64, number: u32, is_same: impl Fn(u32) -> bool) -> u32 {
        let (slot, found) = self.slot(hash, is_same);
        found.unwrap_or_else(|| {
            self.slots[slot] = [(hash >> 32) as u32, number];
            number
        })
    }
}
