//! Snapshots that take less memory, and give every bit back.
//!
//! The last digits of a coordinate are as good as random: they do not compress. What does are its first ones, which are those of the
//! particle before, since neighbours are numbered side by side. So of each number is taken the distance to that of the vector
//! before, as integers of the same bits, and of all these distances the first bytes are put side by side, then the second, and
//! so on: runs of like bytes, which LZ4 finds.

use super::{AnyState, Entry, Snapshot};
use crate::math::Real;
use crate::model::{Memory, Particles};
use crate::scene::Refusal;

/// A snapshot that takes less memory.
#[derive(Clone)]
pub struct Packed {
    /// All but the numbers and pins that are pressed.
    pub(super) rest: Snapshot,
    pub(super) counts: Counts,
    pub(super) bytes: Vec<u8>,
}

/// How much is pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Counts {
    pub particles: usize,
    /// Vectors that the method remembers.
    pub vectors: usize,
}

impl Packed {
    /// Packs a snapshot.
    pub fn new(snapshot: &Snapshot) -> Self {
        let (mut plain, counts) = match &snapshot.state {
            AnyState::Single(s) => split_all(s),
            AnyState::Double(s) => split_all(s),
        };
        plain.extend(snapshot.pinned.iter().map(|pinned| u8::from(*pinned)));
        Self { rest: snapshot.hollow(), counts, bytes: lz4_flex::block::compress(&plain) }
    }

    /// The snapshot.
    ///
    /// # Errors
    /// It was read from a file, and is damaged.
    pub fn unpack(&self) -> Result<Snapshot, Refusal> {
        let Counts { particles, vectors } = self.counts;
        let width = width(&self.rest.state);
        let length = 3 * width * (2 * particles + vectors);
        let plain = lz4_flex::block::decompress(&self.bytes, length + particles)
            .ok()
            .filter(|plain| plain.len() == length + particles)
            .ok_or_else(|| Refusal::new("the state is damaged"))?;
        let (numbers, pinned) = plain.split_at(length);
        let mut snapshot = self.rest.clone();
        snapshot.pinned = pinned.iter().map(|pinned| *pinned != 0).collect();
        put_numbers(&mut snapshot, &join(numbers, width), self.counts);
        Ok(snapshot)
    }

    /// Memory that it takes, bytes; what it shares with others is not counted.
    pub fn size(&self) -> usize {
        let torn = match &self.rest.state {
            AnyState::Single(s) => s.broken.len(),
            AnyState::Double(s) => s.broken.len(),
        };
        size_of::<Self>()
            + self.bytes.len()
            + torn * size_of::<u32>()
            + size_of_val(&self.rest.hands[..])
            + self.rest.scene.pins.size()
    }

    /// The commands that were logged until then, but for the first `count`.
    pub fn commands_since(&self, count: usize) -> Vec<Entry> {
        self.rest.commands_since(count)
    }
}

impl Snapshot {
    /// Memory that it takes, bytes; what it shares with others is not counted.
    pub fn size(&self) -> usize {
        let Counts { particles, vectors } = match &self.state {
            AnyState::Single(s) => counts(s),
            AnyState::Double(s) => counts(s),
        };
        let numbers = 3 * width(&self.state) * (2 * particles + vectors);
        size_of::<Self>() + numbers + self.pinned.len() + self.scene.pins.size()
    }

    /// The same without what is pressed.
    fn hollow(&self) -> Self {
        fn without<T: Real>(state: &Particles<T>) -> Particles<T> {
            Particles {
                time: state.time,
                positions: Vec::new(),
                velocities: Vec::new(),
                broken: state.broken.clone(),
                memory: Memory { vectors: Vec::new(), numbers: state.memory.numbers.clone() },
                seen: None,
            }
        }
        let state = match &self.state {
            AnyState::Single(s) => AnyState::Single(without(s)),
            AnyState::Double(s) => AnyState::Double(without(s)),
        };
        Self {
            scene: self.scene.clone(),
            shape: self.shape.clone(),
            report: self.report.clone(),
            pinned: Vec::new(),
            hands: self.hands.clone(),
            state,
            step: self.step,
            anchor: self.anchor,
            cost: self.cost,
            ledger: self.ledger,
            log: self.log.clone(),
        }
    }
}

fn counts<T: Real>(state: &Particles<T>) -> Counts {
    Counts { particles: state.positions.len(), vectors: state.memory.vectors.len() }
}

/// Bytes of a number.
fn width(state: &AnyState) -> usize {
    match state {
        AnyState::Single(_) => size_of::<f32>(),
        AnyState::Double(_) => size_of::<f64>(),
    }
}

/// Positions, velocities and what the method remembers, pressed.
fn split_all<T: Real<Vec3: bytemuck::NoUninit>>(state: &Particles<T>) -> (Vec<u8>, Counts) {
    let lists = [&state.positions, &state.velocities, &state.memory.vectors];
    let bytes = lists.map(|list| bytemuck::cast_slice::<_, u8>(list)).concat();
    (split(&bytes, size_of::<T>()), counts(state))
}

/// Puts these into a state.
fn put_numbers(snapshot: &mut Snapshot, bytes: &[u8], counts: Counts) {
    fn put<T: Real<Vec3: bytemuck::AnyBitPattern>>(state: &mut Particles<T>, bytes: &[u8], counts: Counts) {
        let Counts { particles, vectors } = counts;
        let mut all = bytes.chunks_exact(size_of::<T::Vec3>()).map(bytemuck::pod_read_unaligned);
        state.positions = all.by_ref().take(particles).collect();
        state.velocities = all.by_ref().take(particles).collect();
        state.memory.vectors = all.take(vectors).collect();
    }
    match &mut snapshot.state {
        AnyState::Single(s) => put(s, bytes, counts),
        AnyState::Double(s) => put(s, bytes, counts),
    }
}

/// Distances to the number three before, by the place of their bytes.
fn split(numbers: &[u8], width: usize) -> Vec<u8> {
    let count = numbers.len() / width;
    let mut planes = vec![0; numbers.len()];
    let mut before = [0; 3];
    for (i, number) in numbers.chunks_exact(width).enumerate() {
        let mut bytes = [0; 8];
        bytes[..width].copy_from_slice(number);
        let number = u64::from_le_bytes(bytes);
        let apart = fold(number.wrapping_sub(before[i % 3]), width);
        before[i % 3] = number;
        for (plane, byte) in apart.to_le_bytes().into_iter().take(width).enumerate() {
            planes[plane * count + i] = byte;
        }
    }
    planes
}

/// The numbers again.
fn join(planes: &[u8], width: usize) -> Vec<u8> {
    let count = planes.len() / width;
    let mut numbers = Vec::with_capacity(planes.len());
    let mut before = [0_u64; 3];
    for i in 0..count {
        let mut bytes = [0; 8];
        for (plane, byte) in bytes.iter_mut().take(width).enumerate() {
            *byte = planes[plane * count + i];
        }
        // Only the lowest bytes are a number's: what is carried beyond them does not matter.
        before[i % 3] = unfold(u64::from_le_bytes(bytes)).wrapping_add(before[i % 3]);
        numbers.extend_from_slice(&before[i % 3].to_le_bytes()[..width]);
    }
    numbers
}

/// A difference with its sign in the last bit, so that small ones of either sign begin with zeros.
fn fold(apart: u64, width: usize) -> u64 {
    let shift = 64 - 8 * width as u32;
    // The sign of a narrow number is moved to where that of a wide one is.
    let apart = (apart << shift).cast_signed() >> shift;
    ((apart << 1) ^ (apart >> 63)).cast_unsigned()
}

fn unfold(folded: u64) -> u64 {
    (folded >> 1) ^ (folded & 1).wrapping_neg()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Place, Scene};
    use crate::world::{Command, World};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn any_bits_come_back(wide in proptest::collection::vec(any::<u64>(), 0..60), narrow in proptest::collection::vec(any::<u32>(), 0..60)) {
            let wide: Vec<u8> = wide.into_iter().flat_map(u64::to_le_bytes).collect();
            let narrow: Vec<u8> = narrow.into_iter().flat_map(u32::to_le_bytes).collect();
            prop_assert_eq!(join(&split(&wide, 8), 8), wide);
            prop_assert_eq!(join(&split(&narrow, 4), 4), narrow);
        }
    }

    #[test]
    fn what_is_unpacked_is_what_was_packed() {
        for (precision, method) in [("Single", "bdf2"), ("Double", "bdf2"), ("Double", "verlet")] {
            let scene = format!(
                "(precision: {precision}, simulator: (id: \"{method}\"), dt: 0.005, tearing: (enabled: true, max_ratio: 1.05))"
            );
            let mut world = World::new(Scene::from_ron(&scene).unwrap(), Place::default()).unwrap();
            world.apply(Command::Pull { particles: vec![312], stiffness: 50.0 }).unwrap();
            (0..100).for_each(|_| world.step());
            let snapshot = world.snapshot();
            let packed = Packed::new(&snapshot);
            let back = packed.unpack().unwrap();
            assert_eq!(back.state, snapshot.state);
            assert_eq!((&back.pinned, &back.hands), (&snapshot.pinned, &snapshot.hands));
            (0..100).for_each(|_| world.step());
            let end = world.digest();
            world.restore(&back);
            (0..100).for_each(|_| world.step());
            assert_eq!(world.digest(), end);
        }
    }

    #[test]
    fn a_damaged_state_is_refused() {
        let world = World::new(Scene::default(), Place::default()).unwrap();
        let mut packed = Packed::new(&world.snapshot());
        packed.bytes.truncate(packed.bytes.len() / 2);
        assert!(packed.unpack().is_err());
        packed.bytes = lz4_flex::block::compress(&[0; 10]);
        assert!(packed.unpack().is_err());
    }
}
