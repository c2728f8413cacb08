//! The springs around each particle.

/// The springs around each particle, for whoever adds something up particle by particle.
#[derive(Clone, Debug, Default)]
pub struct Incidence {
    /// Start of each particle's list, with one more entry at the end.
    starts: Vec<u32>,
    /// The other particle and the spring, in the order of the springs.
    entries: Vec<[u32; 2]>,
}

impl Incidence {
    /// The springs around each of `particles` particles.
    pub fn new(particles: usize, pairs: &[[u32; 2]]) -> Self {
        let mut starts = vec![0u32; particles + 1];
        for p in pairs.as_flattened() {
            starts[*p as usize + 1] += 1;
        }
        for i in 0..particles {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut entries = vec![[0; 2]; 2 * pairs.len()];
        for (spring, &[i, j]) in pairs.iter().enumerate() {
            for (own, other) in [(i, j), (j, i)] {
                let slot = &mut next[own as usize];
                entries[*slot as usize] = [other, spring as u32];
                *slot += 1;
            }
        }
        Self { starts, entries }
    }

    /// The other particle and the spring, for each spring around particle `i`, in the order of the springs.
    pub fn around(&self, i: usize) -> &[[u32; 2]] {
        &self.entries[self.starts[i] as usize..self.starts[i + 1] as usize]
    }
}
