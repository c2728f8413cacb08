//! Greedy graph colouring: an order in which neighbours in a group do not touch, so that a group may be worked on at once.
//!
//! First fit in the order of creation (Welsh and Powell, "An upper bound for the chromatic number of a graph and its
//! application to timetabling problems", 1967), in time linear in the springs. The order depends on nothing but the
//! springs, so it is the same for any number of threads.

use crate::model::Incidence;

/// Things by colour.
#[derive(Clone, Debug, Default)]
pub(super) struct Colours {
    order: Vec<u32>,
    /// End of each colour in `order`.
    ends: Vec<usize>,
}

impl Colours {
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub fn star_and_ring(spokes: u32) -> Vec<[u32; 2]> {
        let spokes_of_hub = (1..=spokes).map(|i| [0, i]);
        spokes_of_hub.chain((1..spokes).map(|i| [i, i + 1])).collect()
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
