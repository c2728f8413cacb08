//! `tenter scenes` and `tenter simulators`: what there is to choose from.

use super::{Common, Ending, output};
use crate::params::{self, Visitor};
use crate::scene::{Refusal, builtin};
use crate::simulators::{self, Model};
use clap::Args;
use glam::DVec3;
use serde_json::json;
use std::collections::BTreeMap;

#[derive(Args)]
pub struct Options {
    #[command(flatten)]
    common: Common,
}

pub fn scenes(options: &Options) -> Result<Ending, Refusal> {
    let common = &options.common;
    if common.json {
        let list: Vec<_> = builtin::ALL.iter().map(|s| json!({"name": s.name, "about": s.about})).collect();
        output::print(&output::json(&list)?);
    }
    for scene in builtin::ALL {
        common.say(&format!("{:18} {}", scene.name, scene.about));
    }
    Ok(Ending::Done)
}

pub fn simulators(options: &Options) -> Result<Ending, Refusal> {
    let common = &options.common;
    let mut list = Vec::new();
    for entry in simulators::ALL {
        let mut params = Listing::default();
        entry.visit(&BTreeMap::new(), &mut params);
        common.say(&format!("{:18} {}", entry.id, entry.summary));
        for line in &params.lines {
            common.say(&format!("{:18} {line}", ""));
        }
        let model = match entry.model {
            Model::Springs => "springs",
            Model::RigidConstraints => "rigid_constraints",
        };
        list.push(json!({
            "id": entry.id, "summary": entry.summary, "order": entry.order, "model": model, "params": params.json,
        }));
    }
    if common.json {
        output::print(&output::json(&list)?);
    }
    Ok(Ending::Done)
}

/// Writes parameters down.
#[derive(Default)]
struct Listing {
    json: Vec<serde_json::Value>,
    lines: Vec<String>,
}

impl Listing {
    fn add(&mut self, info: &params::Info, kind: &str, default: &serde_json::Value, accepted: &str) {
        let doc = params::one_line(&info.doc.lines().map(str::trim).collect::<Vec<_>>().join(" "));
        self.lines.push(format!("{} = {default} ({accepted}): {doc}", info.name));
        let range = info.range.as_ref().map(|r| [*r.start(), *r.end()]);
        self.json.push(json!({
            "name": info.name, "kind": kind, "default": default, "unit": info.unit, "range": range, "doc": doc,
        }));
    }
}

impl Visitor for Listing {
    fn number(&mut self, info: &'static params::Info, _: &mut f64, default: f64) {
        self.add(info, "number", &json!(default), &info.accepted());
    }
    fn count(&mut self, info: &'static params::Info, _: &mut u32, default: u32) {
        self.add(info, "count", &json!(default), &info.accepted());
    }
    fn switch(&mut self, info: &'static params::Info, _: &mut bool, default: bool) {
        self.add(info, "switch", &json!(default), "true or false");
    }
    fn choice(
        &mut self,
        info: &'static params::Info,
        names: &'static [&'static str],
        _: &mut usize,
        default: usize,
    ) {
        self.add(info, "choice", &json!(names[default]), &names.join(", "));
    }
    fn vector(&mut self, info: &'static params::Info, _: &mut DVec3, default: DVec3) {
        self.add(info, "vector", &json!(default.to_array()), &info.accepted());
    }
    fn group(&mut self, _: &'static params::Info, inside: &mut dyn FnMut(&mut dyn Visitor)) {
        inside(self);
    }
}
