//! The springs that act: those enabled and whole, one contiguous group a kind, in the order of the topology or, where
//! particles were renumbered, by their particles.

use super::sorting::sort_by_particle;
use super::{Numbering, SpringKind, Topology};
use crate::math::parts::each_particle;
use crate::math::{Real, Vector};
use std::ops::Range;

/// Springs that act. A kind that is switched off and a spring that is torn are not in here, so nobody walks them.
#[derive(Clone, Debug, Default)]
pub struct Springs<T: Real> {
    /// The two particles of each spring, lower index first.
    pub pairs: Vec<[u32; 2]>,
    /// Rest length of each spring, m.
    pub rest: Vec<T>,
    /// Index of each spring among all springs of the topology.
    pub ids: Vec<u32>,
    /// The kinds present, each with its range of springs.
    pub groups: Vec<Group<T>>,
}

/// All acting springs of one kind.
#[derive(Clone, Debug)]
pub struct Group<T> {
    /// Their kind.
    pub kind: SpringKind,
    /// Where they stand in the lists.
    pub range: Range<usize>,
    /// Stiffness k, N/m.
    pub stiffness: T,
}

/// What the scene says of one kind of springs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KindSettings {
    /// Whether springs of this kind act.
    pub enabled: bool,
    /// Stiffness k, N/m.
    pub stiffness: f64,
    /// Rest length = length in the imported or generated shape x this.
    pub rest_scale: f64,
}

impl<T: Real> Springs<T> {
    /// The acting springs of `topology` on the shape `rest_positions` (m), without those in `broken` (sorted ids).
    pub fn new(
        topology: &Topology,
        rest_positions: &[T::Vec3],
        kinds: &[KindSettings; 3],
        broken: &[u32],
    ) -> Self {
        let enabled = topology.pairs.iter().zip(kinds).filter(|(_, settings)| settings.enabled);
        let most = enabled.map(|(pairs, _)| pairs.len()).sum();
        let mut springs = Self {
            pairs: Vec::with_capacity(most),
            rest: Vec::with_capacity(most),
            ids: Vec::with_capacity(most),
            groups: Vec::new(),
        };
        let mut broken = broken.iter().copied().peekable();
        let mut id = 0;
        for ((kind, pairs), settings) in SpringKind::ALL.into_iter().zip(&topology.pairs).zip(kinds) {
            let start = springs.pairs.len();
            for pair in pairs {
                let torn = broken.next_if_eq(&id).is_some();
                if settings.enabled && !torn {
                    springs.pairs.push(*pair);
                    springs.ids.push(id);
                }
                id += 1;
            }
            let range = start..springs.pairs.len();
            springs.rest.resize(range.end, T::ZERO);
            let scale = T::from_f64(settings.rest_scale);
            let lists = (&mut springs.rest[range.clone()], &springs.pairs[range.clone()]);
            each_particle(lists, rayon::current_num_threads(), |(rest, pairs): (&mut [T], &[[u32; 2]])| {
                for (rest, pair) in rest.iter_mut().zip(pairs) {
                    let [a, b] = pair.map(|p| rest_positions[p as usize]);
                    *rest = (b - a).length() * scale;
                }
            });
            if !range.is_empty() {
                springs.groups.push(Group { kind, range, stiffness: T::from_f64(settings.stiffness) });
            }
        }
        springs
    }

    /// Leads every spring to its particles in another numbering, and sorts the springs of each kind by them, so that what
    /// is worked on one after the other lies side by side.
    pub fn renumber(&mut self, numbering: &Numbering) {
        if numbering.is_identity() {
            return;
        }
        let (mut pairs, mut rest, mut ids) = (&mut self.pairs[..], &mut self.rest[..], &mut self.ids[..]);
        rayon::scope(|scope| {
            for group in &self.groups {
                let own = (
                    pairs.split_off_mut(..group.range.len()).unwrap_or_default(),
                    rest.split_off_mut(..group.range.len()).unwrap_or_default(),
                    ids.split_off_mut(..group.range.len()).unwrap_or_default(),
                );
                scope.spawn(|_| renumber(own, numbering));
            }
        });
    }

    /// Takes springs out, keeping the order of the others; `torn` are sorted indices.
    pub fn remove(&mut self, torn: &[usize]) {
        let Some(&first) = torn.first() else { return };
        let mut torn_ahead = torn.iter().copied().peekable();
        let mut kept = first;
        let mut ends = self.groups.iter_mut().map(|g| &mut g.range).peekable();
        for s in first..self.pairs.len() {
            while let Some(range) = ends.next_if(|range| range.end <= s) {
                range.end = range.end.min(kept);
            }
            if torn_ahead.next_if_eq(&s).is_none() {
                self.pairs[kept] = self.pairs[s];
                self.rest[kept] = self.rest[s];
                self.ids[kept] = self.ids[s];
                kept += 1;
            }
        }
        ends.for_each(|range| range.end = range.end.min(kept));
        self.pairs.truncate(kept);
        self.rest.truncate(kept);
        self.ids.truncate(kept);
        let mut start = 0;
        for group in &mut self.groups {
            group.range.start = start;
            start = group.range.end;
        }
        self.groups.retain(|group| !group.range.is_empty());
    }

    /// The stiffness of each spring, N/m.
    pub fn stiffness_of_each(&self) -> Vec<T> {
        let each = |group: &Group<T>| std::iter::repeat_n(group.stiffness, group.range.len());
        self.groups.iter().flat_map(each).collect()
    }

    /// Number of acting springs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether no spring acts.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }
}

/// Does that to the springs of one kind.
fn renumber<T: Real>((pairs, rest, ids): (&mut [[u32; 2]], &mut [T], &mut [u32]), numbering: &Numbering) {
    let inner = (0..).zip(&*pairs).map(|(s, pair)| {
        let [a, b] = pair.map(|p| numbering.inner(p));
        ([a.min(b), a.max(b)], s)
    });
    let order: Vec<([u32; 2], u32)> = sort_by_particle(inner.collect(), numbering.len(), |(ends, _)| ends[0]);
    let (old_rest, old_ids) = (rest.to_vec(), ids.to_vec());
    let lists = pairs.iter_mut().zip(rest).zip(ids);
    for (((pair, rest), id), (ends, s)) in lists.zip(order) {
        (*pair, *rest, *id) = (ends, old_rest[s as usize], old_ids[s as usize]);
    }
}
