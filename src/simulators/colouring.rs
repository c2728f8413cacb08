//! Greedy graph colouring: an order in which neighbours in a group do not touch, so that a group may be worked on at once.
//!
//! First fit in the order of creation (Welsh and Powell, "An upper bound for the chromatic number of a graph and its
//! application to timetabling problems", 1967), in time linear in the springs. The order depends on nothing but the
//! springs, so it is the same for any number of threads.

use crate::forces::Problem;
use crate::math::Real;
use crate::model::Incidence;

/// Things by colour.
#[derive(Clone, Debug, Default)]
pub(super) struct Colours {
    order: Vec<u32>,
    /// End of each colour in `order`.
    ends: Vec<usize>,
}

impl Colours {
    /// Colours pairs of particles so that no two of a colour share a particle. What 63 colours cannot hold (around a
    /// particle with very many springs) makes up a last colour, to be worked on in order.
    pub fn of_pairs(particles: usize, pairs: &[[u32; 2]]) -> Self {
        let mut used = vec![0u64; particles];
        Self::group(pairs.iter().map(|&[i, j]| {
            let taken = used[i as usize] | used[j as usize];
            let colour = (!taken).trailing_zeros().min(63);
            used[i as usize] |= 1 << colour;
            used[j as usize] |= 1 << colour;
            colour
        }))
    }

    /// Colours particles so that no two of a colour share a spring.
    pub fn of_particles(particles: usize, incidence: &Incidence) -> Self {
        const NONE: u32 = u32::MAX;
        let mut colours = vec![NONE; particles];
        // The particle that last saw a colour among its neighbours.
        let mut seen_by: Vec<u32> = Vec::new();
        for i in 0..particles {
            for &[other, _] in incidence.around(i) {
                if let Some(seen) = seen_by.get_mut(colours[other as usize] as usize) {
                    *seen = i as u32;
                }
            }
            let free = seen_by.iter().position(|seen| *seen != i as u32);
            colours[i] = free.unwrap_or_else(|| {
                seen_by.push(NONE);
                seen_by.len() - 1
            }) as u32;
        }
        Self::group(colours.into_iter())
    }

    /// Sorts by colour, keeping the order within each.
    fn group(colours: impl Iterator<Item = u32>) -> Self {
        let colours: Vec<u32> = colours.collect();
        let count = colours.iter().max().map_or(0, |c| *c as usize + 1);
        let mut ends = vec![0; count];
        for &c in &colours {
            ends[c as usize] += 1;
        }
        let mut start = 0;
        for end in &mut ends {
            start += std::mem::replace(end, start);
        }
        // Every end now stands at the start of its colour and walks on as the colour is filled.
        let mut order = vec![0; colours.len()];
        for (i, &c) in colours.iter().enumerate() {
            order[ends[c as usize]] = i as u32;
            ends[c as usize] += 1;
        }
        Self { order, ends }
    }

    /// The colours, one after the other.
    pub fn groups(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.order[start..end])
    }
}

/// The springs of a problem in an order of their own.
#[derive(Clone, Debug, Default)]
pub(super) struct OrderedSprings<T> {
    /// Their two particles.
    pub pairs: Vec<[u32; 2]>,
    /// Rest lengths, m.
    pub rest: Vec<T>,
    /// Stiffnesses, N/m.
    pub stiffness: Vec<T>,
    /// The revision of the problem that they were taken from.
    revision: u64,
}

impl<T: Real> OrderedSprings<T> {
    /// Takes over the springs of a problem colour by colour, unless they are here already.
    pub fn by_colour(&mut self, problem: &Problem<T>) {
        self.take(problem, || Colours::of_pairs(problem.particles(), &problem.springs.pairs).order);
    }

    /// Takes over the springs of a problem in the order in which they were made, unless they are here already.
    pub fn by_creation(&mut self, problem: &Problem<T>) {
        self.take(problem, || {
            let ids = &problem.springs.ids;
            let mut order: Vec<u32> = (0..ids.len() as u32).collect();
            order.sort_unstable_by_key(|s| ids[*s as usize]);
            order
        });
    }

    fn take(&mut self, problem: &Problem<T>, order: impl FnOnce() -> Vec<u32>) {
        if self.revision == problem.revision() {
            return;
        }
        let springs = &problem.springs;
        let stiffness = springs.stiffness_of_each();
        let order = order();
        let order = || order.iter().map(|s| *s as usize);
        self.pairs = order().map(|s| springs.pairs[s]).collect();
        self.rest = order().map(|s| springs.rest[s]).collect();
        self.stiffness = order().map(|s| stiffness[s]).collect();
        self.revision = problem.revision();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn star_and_ring(spokes: u32) -> Vec<[u32; 2]> {
        let spokes_of_hub = (1..=spokes).map(|i| [0, i]);
        spokes_of_hub.chain((1..spokes).map(|i| [i, i + 1])).collect()
    }

    #[test]
    fn pairs_of_a_colour_share_no_particle() {
        for spokes in [3, 40, 200] {
            let pairs = star_and_ring(spokes);
            let colours = Colours::of_pairs(spokes as usize + 1, &pairs);
            for group in colours.groups().take(63) {
                let mut ends: Vec<u32> = group.iter().flat_map(|s| pairs[*s as usize]).collect();
                let count = ends.len();
                ends.sort_unstable();
                ends.dedup();
                assert_eq!(ends.len(), count);
            }
            let mut all = colours.order.clone();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..pairs.len() as u32));
        }
    }

    #[test]
    fn particles_of_a_colour_share_no_spring() {
        let pairs = star_and_ring(200);
        let colours = Colours::of_particles(201, &Incidence::new(201, &pairs));
        assert_eq!(colours.groups().count(), 3);
        for group in colours.groups() {
            assert!(pairs.iter().all(|pair| pair.iter().filter(|p| group.contains(p)).count() < 2));
        }
    }
}
