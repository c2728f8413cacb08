//! The parameters by which a method spends more work on the same step: sweeps, iterations, substeps, a tolerance.

use crate::params::{Info, Visitor};
use crate::simulators::{Entry, Value};
use glam::DVec3;
use std::collections::BTreeMap;

/// Such a parameter of a method, as set.
#[derive(Clone, Debug, PartialEq)]
pub struct Effort {
    /// Its name.
    pub name: &'static str,
    /// Its value; a whole number where it counts something.
    pub now: Value,
    /// What it is where nothing is set.
    pub default: Value,
    /// The values that the method declares as worth comparing.
    pub ladder: Vec<Value>,
}

impl Effort {
    /// Those of a method, as set by `params`.
    pub fn of(entry: &Entry, params: &BTreeMap<String, Value>) -> Vec<Self> {
        struct Find(Vec<Effort>);
        impl Visitor for Find {
            fn number(&mut self, info: &'static Info, value: &mut f64, default: f64) {
                self.0.extend(effort(info, Value::Number(*value), Value::Number(default), Value::Number));
            }
            fn count(&mut self, info: &'static Info, value: &mut u32, default: u32) {
                let [now, default] = [*value, default].map(|n| Value::Count(n.into()));
                self.0.extend(effort(info, now, default, |n| Value::Count(n as u64)));
            }
            fn switch(&mut self, _: &'static Info, _: &mut bool, _: bool) {}
            fn choice(&mut self, _: &'static Info, _: &'static [&'static str], _: &mut usize, _: usize) {}
            fn vector(&mut self, _: &'static Info, _: &mut DVec3, _: DVec3) {}
            fn group(&mut self, _: &'static Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
                inside(self);
            }
        }
        let mut find = Find(Vec::new());
        entry.visit(params, &mut find);
        find.0
    }

    /// How often something is done in a step; none of a tolerance.
    pub fn count(&self) -> Option<u64> {
        match self.now {
            Value::Count(count) => Some(count),
            _ => None,
        }
    }
}

fn effort(info: &'static Info, now: Value, default: Value, value: impl Fn(f64) -> Value) -> Option<Effort> {
    let ladder: Vec<Value> = info.effort.iter().map(|v| value(*v)).collect();
    (!ladder.is_empty()).then_some(Effort { name: info.name, now, default, ladder })
}

/// The parameters that a method is tried with: each effort along its ladder while the others are at their defaults.
pub fn variants(entry: &Entry) -> Vec<BTreeMap<String, Value>> {
    let mut variants = Vec::new();
    for effort in Effort::of(entry, &BTreeMap::new()) {
        for value in &effort.ladder {
            let own = if *value == effort.default {
                BTreeMap::new()
            } else {
                BTreeMap::from([(effort.name.to_owned(), value.clone())])
            };
            if !variants.contains(&own) {
                variants.push(own);
            }
        }
    }
    if variants.is_empty() { vec![BTreeMap::new()] } else { variants }
}

/// Whether a method chooses its own steps by a tolerance, so that dt says little of its error.
pub fn adaptive(entry: &Entry) -> bool {
    Effort::of(entry, &BTreeMap::new()).iter().any(|effort| effort.count().is_none())
}
