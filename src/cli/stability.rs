//! `tenter stability`: where each method stops being stable, against theory.

use super::Ending;
use super::study::{Found, Study};
use crate::lab::stability::{self, Axis};
use crate::lab::{Case, report, trade};
use crate::scene::Refusal;
use clap::Args;

#[derive(Args, Clone)]
pub struct Options {
    #[command(flatten)]
    pub study: Study,
    /// What dt is mapped against: stiffness, damping, or nothing.
    #[arg(long, value_name = "AXIS", default_value = "stiffness", value_parser = ["stiffness", "damping", "nothing"])]
    pub map: String,
}

impl Options {
    pub fn command(&self) -> Vec<String> {
        self.study.command("stability", &["--map".to_owned(), self.map.clone()])
    }

    pub fn find(&self, case: &Case) -> Result<stability::Stability, Refusal> {
        let map = match self.map.as_str() {
            "stiffness" => Some(Axis::Stiffness),
            "damping" => Some(Axis::Damping),
            _ => None,
        };
        let options = stability::Options { simulators: self.study.simulators.clone(), map };
        self.study.work(case, &self.command(), |_, journal, progress| {
            stability::run(case, &options, journal, progress)
        })
    }
}

pub fn found<'a>(
    table: &'a stability::Stability,
    simulators: &[String],
) -> Result<Found<'a, stability::Stability>, Refusal> {
    let entries = trade::chosen(simulators)?;
    let diagrams = entries.iter().map(|e| (format!("stability-{}", e.id), report::map(table, e.id)));
    Ok(Found {
        result: table,
        text: report::stability(table),
        csv: Some(report::stability_csv(table)),
        diagrams: diagrams.collect(),
        missing: table.missing,
    })
}

pub fn stability(options: &Options) -> Result<Ending, Refusal> {
    let case = options.study.case()?;
    options.study.tell("stability", &found(&options.find(&case)?, &options.study.simulators)?)
}
