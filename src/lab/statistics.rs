//! What is compared of two runs after their trajectories have parted: energies, centre of mass, period, strain.

use crate::world::World;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Strain of one kind of springs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Strain {
    /// The kind, in lower case.
    pub kind: String,
    /// Mean over the springs that act and the sampled times.
    pub mean: f64,
    /// Largest over both.
    pub largest: f64,
}

/// A run in a few numbers, over the whole compared time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Kinetic, gravitational and elastic energy, mean over time, J.
    pub energy: [f64; 3],
    /// Centre of mass, mean over time, m.
    pub centre: [f64; 3],
    /// Period of the centre of mass along the axis on which it moves most, s; none where it does not swing twice
    /// through its mean.
    pub period: Option<f64>,
    /// Strain of every kind that acts.
    pub strain: Vec<Strain>,
}

/// How far a run's statistics are from the reference's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Difference of the sum of kinetic and elastic energy, as a part of the reference's.
    pub energy: f64,
    /// Distance of the centres of mass, m.
    pub centre: f64,
    /// Difference of periods, as a part of the reference's; none where one has none.
    pub period: Option<f64>,
    /// Largest difference of mean strains, and of largest strains, over the kinds.
    pub strain: [f64; 2],
}

impl Statistics {
    /// The distance from a reference's.
    pub fn apart(&self, reference: &Self) -> Apart {
        let moving = |s: &Self| s.energy[0] + s.energy[2];
        let kinds = self.strain.iter().zip(&reference.strain);
        let strain = kinds.map(|(a, b)| [(a.mean - b.mean).abs(), (a.largest - b.largest).abs()]);
        Apart {
            energy: (moving(self) - moving(reference)).abs() / moving(reference).max(f64::MIN_POSITIVE),
            centre: DVec3::from(self.centre).distance(reference.centre.into()),
            period: self.period.zip(reference.period).map(|(a, b)| (a / b - 1.0).abs()),
            strain: strain.fold([0.0, 0.0], |[a, b], [c, d]| [f64::max(a, c), f64::max(b, d)]),
        }
    }
}

/// Times at which a run is looked at, at most.
const LOOKS: u64 = 500;

/// Collects the statistics of a run.
pub struct Watch {
    mass: Vec<f64>,
    every: u64,
    steps: u64,
    /// Time, energies, centre of mass.
    seen: Vec<(f64, [f64; 3], DVec3)>,
    /// Sum, number and largest of the strains of each kind.
    strain: [(f64, u64, f64); 3],
    buffer: Vec<(u32, f32)>,
}

const KINDS: [&str; 3] = ["stretch", "shear", "bend"];

impl Watch {
    /// Of a run of so many steps over particles of these masses (kg).
    pub fn new(mass: Vec<f64>, steps: u64) -> Self {
        let every = steps.div_ceil(LOOKS).max(1);
        Self {
            mass,
            every,
            steps,
            seen: Vec::new(),
            strain: [(0.0, 0, f64::NEG_INFINITY); 3],
            buffer: Vec::new(),
        }
    }

    /// Looks at the world where it is time to: at the start (step 0), at the end, and now and then between them.
    pub fn step(&mut self, step: u64, world: &World) {
        if !step.is_multiple_of(self.every) && step != self.steps {
            return;
        }
        let positions = world.positions();
        let sum: DVec3 = self.mass.iter().zip(&positions).map(|(m, x)| *x * *m).sum();
        let total: f64 = self.mass.iter().sum();
        let energy = world.measures().energy;
        let energies = [energy.kinetic, energy.gravitational, energy.elastic];
        self.seen.push((world.time(), energies, sum / total.max(f64::MIN_POSITIVE)));
    }

    /// Takes the strains of a sampled time.
    pub fn sample(&mut self, world: &World) {
        let [stretch, shear, _] = world.topology().pairs.each_ref().map(|pairs| pairs.len() as u32);
        let ends = [stretch, stretch + shear];
        world.strains(&mut self.buffer);
        for &(spring, strain) in &self.buffer {
            // Springs are numbered kind by kind.
            let kind = usize::from(spring >= ends[0]) + usize::from(spring >= ends[1]);
            let (sum, count, largest) = &mut self.strain[kind];
            *sum += f64::from(strain);
            *count += 1;
            *largest = largest.max(f64::from(strain));
        }
    }

    /// What was seen.
    pub fn statistics(&self) -> Statistics {
        // By the trapezoidal rule, so that how often a run was looked at is no difference.
        let (mut energy, mut centre, mut whole) = ([0.0; 3], DVec3::ZERO, 0.0);
        for ends in self.seen.windows(2) {
            let span = ends[1].0 - ends[0].0;
            whole += span;
            centre += (ends[0].2 + ends[1].2) * (0.5 * span);
            (0..3).for_each(|i| energy[i] += 0.5 * span * (ends[0].1[i] + ends[1].1[i]));
        }
        let whole = whole.max(f64::MIN_POSITIVE);
        let (energy, centre) = (energy.map(|e| e / whole), centre / whole);
        let spread = self.seen.iter().map(|s| (s.2 - centre) * (s.2 - centre)).sum::<DVec3>();
        let axis = spread.max_position();
        let path: Vec<(f64, f64)> = self.seen.iter().map(|s| (s.0, (s.2 - centre)[axis])).collect();
        let strain = KINDS.iter().zip(&self.strain).filter(|(_, (_, count, _))| *count > 0);
        Statistics {
            energy,
            centre: centre.to_array(),
            period: period(&path),
            strain: strain
                .map(|(kind, (sum, count, largest))| Strain {
                    kind: (*kind).to_owned(),
                    mean: sum / *count as f64,
                    largest: *largest,
                })
                .collect(),
        }
    }
}

/// Mean time between two passages through 0 upwards, between samples by a straight line.
fn period(path: &[(f64, f64)]) -> Option<f64> {
    let passages = path.windows(2).filter(|w| w[0].1 < 0.0 && w[1].1 >= 0.0);
    let times: Vec<f64> = passages.map(|w| w[0].0 - w[0].1 * (w[1].0 - w[0].0) / (w[1].1 - w[0].1)).collect();
    let (first, last) = (times.first()?, times.last()?);
    (times.len() > 1).then(|| (last - first) / (times.len() - 1) as f64)
}
