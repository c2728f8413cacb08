//! What a world tells: its scene, state, measures, limits, and what the user should know of them.

use super::{AnyCloth, Entry, Health, Measures, World, on};
use crate::forces::{Cost, Spectrum};
use crate::math::{Real, Vector};
use crate::model::{Memory, Topology};
use crate::scene::{Place, Precision, Scene};
use crate::target::{ImportReport, QuadMesh};
use glam::DVec3;

impl World {
    /// The scene as it is now, edits included.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Where its meshes are looked for.
    pub fn place_mut(&mut self) -> &mut Place {
        &mut self.place
    }

    /// The mesh in its rest shape.
    pub fn mesh(&self) -> &QuadMesh {
        &self.shape.mesh
    }

    /// All springs, those that do not act included.
    pub fn topology(&self) -> &Topology {
        &self.shape.topology
    }

    /// What the import found and mended.
    pub fn report(&self) -> &ImportReport {
        &self.report
    }

    /// What the user should know before trusting a run, besides [`health`](Self::health): one sentence each.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.report.warnings.clone();
        let Scene { dt, wind, precision, gravity, .. } = &self.scene;
        if self.pinned.iter().all(|pinned| *pinned) {
            warnings.push("every particle is pinned: nothing can move".to_owned());
        }
        if wind.enabled && wind.frequency * dt > 0.5 {
            warnings.push(format!(
                "wind at {} Hz changes faster than dt = {dt} s can follow; at most {} Hz can",
                wind.frequency,
                0.5 / dt
            ));
        }
        if *precision == Precision::Single {
            let far = self.mesh().positions.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
            // Half a unit in the last place is lost at each addition.
            let resolution = far * f64::from(f32::EPSILON) / 2.0;
            let rest = on!(&self.cloth, c => c.mean_rest);
            if resolution > 1e-3 * rest && rest > 0.0 {
                warnings.push(format!(
                    "at {far} m from the origin single precision resolves {resolution:.1e} m, over a thousandth of a spring's {rest:.1e} m; Double does better"
                ));
            }
            if gravity.enabled && *dt > 0.0 && gravity.magnitude * dt * dt < resolution {
                warnings.push(format!(
                    "a step of {dt} s is too short for single precision at {far} m from the origin: what gravity adds in one is lost; Double does better"
                ));
            }
        }
        warnings
    }

    /// For each particle, whether it is pinned.
    pub fn pinned(&self) -> &[bool] {
        &self.pinned
    }

    /// The particles that hands hold or pull.
    pub fn held(&self) -> impl Iterator<Item = u32> + '_ {
        self.hands.iter().map(|h| h.particle)
    }

    /// Steps taken since the world was made.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Simulated time, s.
    pub fn time(&self) -> f64 {
        self.anchor.1 + (self.step - self.anchor.0) as f64 * self.scene.dt
    }

    /// Whether the simulation can be trusted.
    pub fn health(&self) -> Health {
        self.health
    }

    /// Work done so far.
    pub fn cost(&self) -> Cost {
        self.cost
    }

    /// The commands applied so far.
    pub fn log(&self) -> Vec<Entry> {
        self.log.to_vec()
    }

    /// How many these are.
    pub fn logged(&self) -> usize {
        self.log.len()
    }

    /// Torn springs, by index among all springs, sorted.
    pub fn broken(&self) -> &[u32] {
        on!(&self.cloth, c => &c.state.broken)
    }

    /// Number of springs that act: enabled and whole.
    pub fn acting_springs(&self) -> usize {
        on!(&self.cloth, c => c.problem.springs.len())
    }

    /// Positions, m.
    pub fn positions(&self) -> Vec<DVec3> {
        on!(&self.cloth, c => c.by_particle(&c.state.positions).map(Vector::to_f64).collect())
    }

    /// Velocities, m/s.
    pub fn velocities(&self) -> Vec<DVec3> {
        on!(&self.cloth, c => c.by_particle(&c.state.velocities).map(Vector::to_f64).collect())
    }

    /// Writes the positions (m) in single precision, as pictures need them, over `into`.
    pub fn positions_f32(&self, into: &mut Vec<[f32; 3]>) {
        into.clear();
        on!(&self.cloth, c => {
            into.extend(c.by_particle(&c.state.positions).map(|p| p.to_f64().as_vec3().to_array()));
        });
    }

    /// Writes |d|/L - 1 of every acting spring with its index among all springs over `into`.
    pub fn strains(&self, into: &mut Vec<(u32, f32)>) {
        into.clear();
        on!(&self.cloth, c => {
            let springs = &c.problem.springs;
            into.extend((0..springs.len()).map(|s| {
                let [i, j] = springs.pairs[s].map(|p| c.state.positions[p as usize]);
                let (length, rest) = ((j - i).length().to_f64(), springs.rest[s].to_f64());
                (springs.ids[s], if rest > 0.0 { (length / rest - 1.0) as f32 } else { 0.0 })
            }));
        });
    }

    /// Energies, momentum and strain of the current state.
    pub fn measures(&self) -> Measures {
        on!(&self.cloth, c => Measures::of(&c.problem, &c.state))
    }

    /// The extreme rates of the cloth in its current shape.
    pub fn spectrum(&self) -> Spectrum {
        on!(&self.cloth, c => Spectrum::of(&c.problem, &c.state))
    }

    /// Largest stable dt in theory of the scene's method in the current shape, s; none where theory sets no limit.
    pub fn dt_limit(&self, spectrum: &Spectrum) -> Option<f64> {
        on!(&self.cloth, c => c.stepper().dt_limit(spectrum))
    }

    /// A number that is the same for two worlds exactly when, short of a collision, every bit of their particles' state
    /// is: FNV-1a (Fowler, Noll, Vo) over time, positions, velocities and what the method remembers.
    pub fn digest(&self) -> u64 {
        let (remembered, numbers): (Vec<_>, Vec<_>) = on!(&self.cloth, c => {
            let Memory { vectors, numbers } = &c.state.memory;
            (vectors.iter().map(|v| v.to_f64()).collect(), numbers.clone())
        });
        let vectors = self.positions().into_iter().chain(self.velocities()).chain(remembered);
        let words =
            vectors.flat_map(|v| [v.x, v.y, v.z]).chain([self.time()]).chain(numbers).map(f64::to_bits);
        let torn = self.broken().iter().map(|id| u64::from(*id));
        words.chain(torn).flat_map(u64::to_le_bytes).fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        })
    }
}
