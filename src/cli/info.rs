//! `tenter info`: what a scene or mesh holds.

use super::run::SpringCounts;
use super::{Common, Ending, output};
use crate::scene::Refusal;
use crate::simulators::{self, Build, SimulatorSettings};
use crate::target::{ImportReport, RecoveryMethod};
use crate::world::World;
use clap::Args;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

#[derive(Args)]
pub struct Options {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    scene: String,
    #[command(flatten)]
    common: Common,
}

/// What is told, as the files that users rely on have it.
#[derive(Serialize)]
struct Info<'a> {
    particles: usize,
    pinned: usize,
    springs: SpringCounts,
    total_mass: f64,
    bounding_box: [[f64; 3]; 2],
    #[serde(flatten)]
    report: &'a ImportReport,
    #[serde(skip_serializing_if = "Option::is_none")]
    stability: Option<Stability>,
}

/// Limits of the cloth in its shape at the start.
#[derive(Serialize)]
struct Stability {
    omega_max: f64,
    dt_limit: BTreeMap<&'static str, f64>,
}

pub fn info(options: &Options) -> Result<Ending, Refusal> {
    let common = &options.common;
    let opened = common.open(&options.scene)?;
    let world = common.world(&opened)?;
    let extension = Path::new(&options.scene).extension().map(std::ffi::OsStr::to_ascii_lowercase);
    let is_mesh = extension.is_some_and(|e| e == "obj" || e == "gltf" || e == "glb");
    let bounds = world.mesh().bounding_box().unwrap_or_default();
    let mut report = world.report().clone();
    report.warnings = world.warnings();
    let info = Info {
        particles: world.pinned().len(),
        pinned: world.pinned().iter().filter(|p| **p).count(),
        springs: SpringCounts::of(world.topology()),
        total_mass: world.scene().mass.of(world.mesh())?.iter().sum(),
        bounding_box: bounds.map(|corner| corner.to_array()),
        report: &report,
        stability: if is_mesh { None } else { Some(stability(&world)?) },
    };
    if common.json {
        output::print(&output::json(&info)?);
    }
    common.say(&summary(&info, &opened.title));
    Ok(Ending::Done)
}

fn stability(world: &World) -> Result<Stability, Refusal> {
    let spectrum = world.spectrum();
    let chosen = &world.scene().simulator;
    let mut dt_limit = BTreeMap::new();
    for entry in simulators::ALL {
        let settings = if entry.id == chosen.id { chosen.clone() } else { SimulatorSettings::new(entry.id) };
        let limit = <f64 as Build>::build(&settings)?.dt_limit(&spectrum);
        dt_limit.extend(limit.map(|limit| (entry.id, limit)));
    }
    Ok(Stability { omega_max: spectrum.omega_max(), dt_limit })
}

fn summary(info: &Info, title: &str) -> String {
    let SpringCounts { stretch, shear, bend } = info.springs;
    let report = info.report;
    let [low, high] = info.bounding_box;
    let mut text = format!(
        "{title}: {} particles ({} pinned), {} kg\n\
         faces: {} quads, {} triangles, {} larger; pieces: {}\n\
         springs: {stretch} stretch, {shear} shear, {bend} bend\n\
         box: ({}, {}, {}) to ({}, {}, {}) m\n",
        info.particles,
        info.pinned,
        info.total_mass,
        report.faces.quads,
        report.faces.triangles,
        report.faces.ngons,
        report.components,
        low[0],
        low[1],
        low[2],
        high[0],
        high[1],
        high[2],
    );
    let mended = &report.mended;
    text += &format!(
        "mended: {} vertices welded, {} degenerate faces and {} duplicate faces dropped, {} loose vertices dropped; {} edges of more than two faces\n",
        mended.welded,
        mended.degenerate_faces,
        mended.duplicate_faces,
        mended.loose_vertices,
        mended.non_manifold_edges
    );
    let recovery = &report.quad_recovery;
    if recovery.quads + recovery.triangles_left > 0 {
        let by = match recovery.method {
            RecoveryMethod::None => "no way",
            RecoveryMethod::NgonEncoding => "the file's n-gon encoding",
            RecoveryMethod::Order => "the order of its triangles",
            RecoveryMethod::Geometry => "geometry",
        };
        text += &format!(
            "quads brought back: {} by {by}, {} triangles stayed\n",
            recovery.quads, recovery.triangles_left
        );
    }
    if let Some(stability) = &info.stability {
        let limits: Vec<_> =
            stability.dt_limit.iter().map(|(id, limit)| format!("{id} {} s", seconds(*limit))).collect();
        text += &format!(
            "fastest motion: {:.2} rad/s; longest stable dt: {}\n",
            stability.omega_max,
            limits.join(", ")
        );
    }
    for warning in &report.warnings {
        text += &format!("warning: {warning}\n");
    }
    text.trim_end().to_owned()
}

/// A time with four digits that count, however short.
fn seconds(time: f64) -> String {
    if time < 1e-3 { format!("{time:.3e}") } else { format!("{time:.5}") }
}
