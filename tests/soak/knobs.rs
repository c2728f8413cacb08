//! What is drawn from the seed, and the parameters of a scene with the values that may be tried on them.

use glam::DVec3;
use tenter::params::{Info, Params, Visitor};
use tenter::scene::Scene;
use tenter::simulators;

/// Numbers that look random: SplitMix64 (Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014).
pub struct Chance(pub u64);

impl Chance {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// 0 to 1.
    pub fn part(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn one<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[self.below(of.len())]
    }
}

/// A parameter with what may be tried on it.
pub struct Knob {
    pub key: String,
    pub values: Vec<String>,
}

/// Lists the parameters of a scene.
pub struct Knobs {
    path: Vec<&'static str>,
    found: Vec<Knob>,
}

impl Knobs {
    pub fn of(scene: &Scene) -> Vec<Knob> {
        let mut knobs = Self { path: Vec::new(), found: Vec::new() };
        scene.clone().visit(&mut knobs);
        if let Ok(entry) = simulators::find(&scene.simulator.id) {
            knobs.path = vec!["simulator", "params"];
            entry.visit(&scene.simulator.params, &mut knobs);
        }
        knobs.found
    }

    fn add(&mut self, info: &Info, values: Vec<String>) {
        let parts = self.path.iter().copied().chain([info.name]);
        self.found.push(Knob { key: parts.collect::<Vec<_>>().join("."), values });
    }

    /// The ends of what is accepted and of the slider, what lies beyond, and the default.
    fn numbers(info: &Info, default: f64) -> Vec<f64> {
        let accepted = info.range.iter().flat_map(|r| [*r.start(), *r.end()]);
        let slider = info.slider.iter().flat_map(|(_, r)| [*r.start(), *r.end()]);
        accepted.chain(slider).chain([default, default, -1.0, 1e300]).collect()
    }
}

impl Visitor for Knobs {
    fn number(&mut self, info: &'static Info, _: &mut f64, default: f64) {
        let values = Self::numbers(info, default);
        self.add(info, values.iter().map(|v| format!("{v:?}")).collect());
    }
    fn count(&mut self, info: &'static Info, _: &mut u32, default: u32) {
        // Sweeps without end can be broken off. A million particles are made, whatever it takes: here nobody asks for them.
        let most = if matches!(info.name, "columns" | "rows") { 30.0 } else { 10.0 };
        let mut values = Self::numbers(info, default.into());
        values.retain(|v| *v <= most || !matches!(info.name, "columns" | "rows"));
        values.extend([most; 4]);
        self.add(info, values.iter().map(|v| format!("{v:.0}")).collect());
    }
    fn switch(&mut self, info: &'static Info, _: &mut bool, _: bool) {
        self.add(info, vec!["true".to_owned(), "false".to_owned()]);
    }
    fn choice(&mut self, info: &'static Info, names: &'static [&'static str], _: &mut usize, _: usize) {
        self.add(info, names.iter().map(|name| (*name).to_owned()).collect());
    }
    fn vector(&mut self, info: &'static Info, _: &mut DVec3, _: DVec3) {
        let values = ["(0.0, 0.0, 0.0)", "(1e12, -1e12, 1e12)", "(1e-300, 0.0, 0.0)", "(-0.2, 0.15, 0.85)"];
        self.add(info, values.map(str::to_owned).to_vec());
    }
    fn group(&mut self, info: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
        self.path.push(info.name);
        inside(self);
        self.path.pop();
    }
}

/// What panels call a parameter.
pub fn spoken(key: &str) -> String {
    let name = key.replace(['.', '_'], " ");
    name[..1].to_uppercase() + &name[1..]
}
