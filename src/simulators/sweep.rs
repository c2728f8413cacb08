//! Sweeps: springs that are put right one after the other, each seeing what those before it did, as rigid or as compliant
//! constraints.
//!
//! A sweep is a chain: what a spring does waits for the one before it where they share a particle. Springs are therefore
//! ordered so that eight in a row share none, and near each other in the mesh; those eight are worked on at once where the
//! processor can ([`wide`]), with the bits of the plain loops here, which are what a sweep means.

#[cfg(target_arch = "x86_64")]
mod wide;

use crate::forces::Problem;
use crate::math::{Real, Vector};

/// Springs that are worked on at once.
const EIGHT: usize = 8;

/// Springs in the order of a sweep, and the particles that it moves.
#[derive(Debug, Default)]
pub(super) struct Sweep<T: Real> {
    /// Their two particles.
    pairs: Vec<[u32; 2]>,
    /// Rest lengths, m.
    rest: Vec<T>,
    /// Stiffnesses, N/m.
    stiffness: Vec<T>,
    /// So many of the first stand in eights whose springs share no particle.
    wide: usize,
    /// The problem's revision that they were taken from, and whether in eights.
    taken: (u64, bool),
    /// Where each particle is, m, and the weight by which it gives way: 0 does not move.
    places: Vec<[T; 4]>,
    /// Where each particle was at the start of the step, m.
    starts: Vec<[T; 4]>,
    /// Impulse that each compliant spring has exerted along itself, N s · s.
    tension: Vec<T>,
    /// The same of its damping, by component.
    friction: [Vec<T>; 3],
}

/// What compliant springs are in a step of h.
#[derive(Clone, Copy, Debug)]
pub(super) struct Compliance<T> {
    /// h², s².
    pub square: T,
    /// h k_d of damping along the spring, kg.
    pub along: T,
    /// h k_d of damping in all directions, kg.
    pub all: T,
}

impl<T: Real> Sweep<T> {
    /// Takes the springs of a problem in eights that share no particle, unless they are here already.
    pub fn in_eights(&mut self, problem: &Problem<T>) {
        if self.taken != (problem.revision(), true) {
            let (order, wide) = eights(problem.particles(), &problem.springs.pairs);
            self.take(problem, &order, wide);
            self.taken = (problem.revision(), true);
        }
    }

    /// Takes the springs of a problem in the order in which they were made, unless they are here already.
    pub fn by_creation(&mut self, problem: &Problem<T>) {
        if self.taken != (problem.revision(), false) {
            let ids = &problem.springs.ids;
            let mut order: Vec<u32> = (0..ids.len() as u32).collect();
            order.sort_unstable_by_key(|s| ids[*s as usize]);
            self.take(problem, &order, 0);
            self.taken = (problem.revision(), false);
        }
    }

    fn take(&mut self, problem: &Problem<T>, order: &[u32], wide: usize) {
        let springs = &problem.springs;
        let stiffness = springs.stiffness_of_each();
        let order = || order.iter().map(|s| *s as usize);
        self.pairs = order().map(|s| springs.pairs[s]).collect();
        self.rest = order().map(|s| springs.rest[s]).collect();
        self.stiffness = order().map(|s| stiffness[s]).collect();
        self.wide = wide;
    }

    /// Number of springs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Takes the particles over, with their weights.
    pub fn enter(&mut self, positions: &[T::Vec3], weights: impl Iterator<Item = T>) {
        self.places.clear();
        self.places.extend(positions.iter().zip(weights).map(|(x, w)| quad(*x, w)));
    }

    /// Gives the particles back.
    pub fn leave(&self, positions: &mut [T::Vec3]) {
        for (x, place) in positions.iter_mut().zip(&self.places) {
            *x = point(place);
        }
    }

    /// Puts every spring to its rest length; of the correction each end makes the share w_i / (w_i + w_j).
    pub fn relax(&mut self) {
        let done = self.relax_wide();
        for (pair, &rest) in self.pairs[done..].iter().zip(&self.rest[done..]) {
            let [i, j] = pair.map(|p| p as usize);
            let (a, b) = (self.places[i], self.places[j]);
            let w = a[3] + b[3];
            let d = point::<T>(&b) - point::<T>(&a);
            let length = d.length();
            if w > T::ZERO && length > T::ZERO {
                let correction = d * ((length - rest) / length);
                self.places[i] = quad(point::<T>(&a) + correction * (a[3] / w), a[3]);
                self.places[j] = quad(point::<T>(&b) - correction * (b[3] / w), b[3]);
            }
        }
    }

    /// Begins the step of compliant springs from these positions: no spring has exerted anything yet.
    pub fn begin(&mut self, start: &[T::Vec3], compliance: &Compliance<T>) {
        let springs = self.pairs.len();
        let reset = |values: &mut Vec<T>, len: usize| {
            values.clear();
            values.resize(len, T::ZERO);
        };
        reset(&mut self.tension, springs);
        let is_damped = compliance.all > T::ZERO;
        self.friction.iter_mut().for_each(|friction| reset(friction, if is_damped { springs } else { 0 }));
        self.starts.clear();
        if is_damped || compliance.along > T::ZERO {
            self.starts.extend(start.iter().map(|x| quad(*x, T::ZERO)));
        }
    }

    /// Lets every spring exert what its compliance and its damping still want.
    pub fn comply(&mut self, compliance: &Compliance<T>) {
        let done = self.comply_wide(compliance);
        let Compliance { square, along, all } = *compliance;
        for spring in done..self.pairs.len() {
            let [i, j] = self.pairs[spring].map(|p| p as usize);
            let (a, b) = (self.places[i], self.places[j]);
            let w = a[3] + b[3];
            if w <= T::ZERO {
                continue;
            }
            let d = point::<T>(&b) - point::<T>(&a);
            let was = || point::<T>(&self.starts[j]) - point::<T>(&self.starts[i]);
            let length = d.length();
            let mut impulse = T::Vec3::ZERO;
            if length > T::ZERO {
                let n = d * (T::ONE / length);
                let k = square * self.stiffness[spring];
                let mut wanted = -(k * (length - self.rest[spring])) - self.tension[spring];
                if along > T::ZERO {
                    wanted = wanted - along * n.dot(d - was());
                }
                let change = wanted / ((k + along) * w + T::ONE);
                self.tension[spring] += change;
                impulse = n * change;
            }
            if all > T::ZERO {
                let friction = self.friction.each_ref().map(|component| component[spring]);
                let left = (d + impulse * w - was()) * all;
                let wanted = -left - T::Vec3::from_array(friction);
                let change = wanted * (T::ONE / (all * w + T::ONE));
                for (component, (before, change)) in
                    self.friction.iter_mut().zip(friction.into_iter().zip(change.to_array()))
                {
                    component[spring] = before + change;
                }
                impulse += change;
            }
            self.places[i] = quad(point::<T>(&a) - impulse * a[3], a[3]);
            self.places[j] = quad(point::<T>(&b) + impulse * b[3], b[3]);
        }
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn relax_wide(&mut self) -> usize {
        0
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn comply_wide(&mut self, _: &Compliance<T>) -> usize {
        0
    }
}

fn quad<T: Real>(x: T::Vec3, w: T) -> [T; 4] {
    let [x, y, z] = x.to_array();
    [x, y, z, w]
}

fn point<T: Real>(&[x, y, z, _]: &[T; 4]) -> T::Vec3 {
    T::Vec3::from_array([x, y, z])
}

/// An order of pairs in which each eight in a row, of so many first ones, share no particle; the others follow.
///
/// First fit (as in graph colouring: Welsh and Powell, "An upper bound for the chromatic number of a graph and its application
/// to timetabling problems", 1967) into at most 64 eights that are open at a time, so that the springs of an eight were near
/// each other in the list; in time linear in the pairs. What fits into none comes at the end, as do eights that stay incomplete.
fn eights(particles: usize, pairs: &[[u32; 2]]) -> (Vec<u32>, usize) {
    const OPEN: usize = u64::BITS as usize;
    /// No eight holds more.
    #[derive(Clone, Copy, Default)]
    struct Eight {
        springs: [u32; EIGHT],
        count: usize,
    }
    let mut open = [Eight::default(); OPEN];
    // The open eights that hold a spring of each particle.
    let mut used = vec![0_u64; particles];
    let (mut order, mut left) = (Vec::with_capacity(pairs.len()), Vec::new());
    for (spring, pair) in (0..).zip(pairs) {
        let [i, j] = pair.map(|p| p as usize);
        let fits = (!(used[i] | used[j])).trailing_zeros() as usize;
        let Some(eight) = open.get_mut(fits) else {
            left.push(spring);
            continue;
        };
        eight.springs[eight.count] = spring;
        eight.count += 1;
        used[i] |= 1 << fits;
        used[j] |= 1 << fits;
        if eight.count == EIGHT {
            for &done in &eight.springs {
                for p in pairs[done as usize] {
                    used[p as usize] &= !(1 << fits);
                }
            }
            order.extend(eight.springs);
            eight.count = 0;
        }
    }
    let wide = order.len();
    order.extend(open.iter().flat_map(|eight| &eight.springs[..eight.count]));
    order.append(&mut left);
    (order, wide)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Topology;
    use glam::DVec3;

    fn star_and_ring(spokes: u32) -> Vec<[u32; 2]> {
        let spokes_of_hub = (1..=spokes).map(|i| [0, i]);
        spokes_of_hub.chain((1..spokes).map(|i| [i, i + 1])).collect()
    }

    fn sheet() -> (usize, Vec<[u32; 2]>) {
        let topology = Topology::of(&crate::target::grid(40, 31, 0.1, false));
        (40 * 31, topology.pairs.concat())
    }

    #[test]
    fn eight_springs_in_a_row_share_no_particle() {
        let stars = [3, 40, 200].map(|spokes| (spokes as usize + 1, star_and_ring(spokes)));
        for (particles, pairs) in stars.into_iter().chain([sheet()]) {
            let (order, wide) = eights(particles, &pairs);
            for eight in order[..wide].chunks(EIGHT) {
                let mut ends: Vec<u32> = eight.iter().flat_map(|s| pairs[*s as usize]).collect();
                ends.sort_unstable();
                ends.dedup();
                assert_eq!(ends.len(), 2 * EIGHT);
            }
            let mut all = order;
            all.sort_unstable();
            assert!(all.into_iter().eq(0..pairs.len() as u32));
        }
        let (particles, pairs) = sheet();
        let wide = eights(particles, &pairs).1;
        assert!(pairs.len() - wide < 64 * EIGHT, "of a sheet only what is open at the end is left over");
    }

    /// A sweep over a sheet that is out of shape, with two springs without length and particles that do not move.
    fn swept<T: Real>(is_wide: bool, go: impl Fn(&mut Sweep<T>, &[T::Vec3])) -> Vec<[T; 4]> {
        let (particles, pairs) = sheet();
        let (order, wide) = eights(particles, &pairs);
        let place = |i: usize, scale: f64| {
            let t = if i % 97 == 96 { i as f64 - 1.0 } else { i as f64 };
            T::Vec3::from_f64(DVec3::new((t * 0.7).sin(), (t * 1.3).cos(), (t * 2.1).sin()) * scale)
        };
        let positions: Vec<T::Vec3> = (0..particles).map(|i| place(i, 1.0)).collect();
        let starts: Vec<T::Vec3> = (0..particles).map(|i| place(i, 0.9)).collect();
        let number = |s: u32, scale: f64| T::from_f64((f64::from(s) * 0.37).cos().abs() * scale);
        let mut sweep = Sweep {
            rest: order.iter().map(|s| number(*s, 1.0)).collect(),
            stiffness: order.iter().map(|s| number(*s, 1000.0)).collect(),
            pairs: order.iter().map(|s| pairs[*s as usize]).collect(),
            wide: if is_wide { wide } else { 0 },
            ..Sweep::default()
        };
        // A row of particles that do not move: springs among them do nothing.
        let weights = (0..particles as u32).map(|i| if i < 40 { T::ZERO } else { number(i, 0.8) });
        sweep.enter(&positions, weights);
        go(&mut sweep, &starts);
        sweep.places
    }

    fn agree<T: Real>() {
        let relax = |is_wide| {
            swept::<T>(is_wide, |sweep, _| {
                sweep.relax();
                sweep.relax();
            })
        };
        assert_eq!(relax(true), relax(false));
        for (along, all) in [(0.0, 0.0), (0.3, 0.0), (0.0, 0.2)] {
            let compliance =
                Compliance { square: T::from_f64(1e-3), along: T::from_f64(along), all: T::from_f64(all) };
            let comply = |is_wide| {
                swept::<T>(is_wide, |sweep, starts| {
                    sweep.begin(starts, &compliance);
                    sweep.comply(&compliance);
                    sweep.comply(&compliance);
                })
            };
            let (wide, plain) = (comply(true), comply(false));
            assert!(plain.iter().flatten().all(|x| x.to_f64().is_finite()));
            assert_eq!(wide, plain, "damping {along} along, {all} in all directions");
        }
    }

    #[test]
    fn eight_at_once_give_the_bits_of_one_by_one() {
        agree::<f32>();
        agree::<f64>();
    }
}
