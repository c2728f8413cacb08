//! `tenter ablate`: what each ingredient of a scene costs, and what leaving it out changes.

use super::Ending;
use super::study::{Found, Study, positive};
use crate::lab::{Case, ablation, report};
use crate::scene::Refusal;
use clap::Args;

#[derive(Args, Clone)]
pub struct Options {
    #[command(flatten)]
    pub study: Study,
    /// Change that does not matter, relative to the motion.
    #[arg(long, value_name = "E", default_value_t = 0.01, value_parser = positive)]
    pub tolerance: f64,
}

impl Options {
    pub fn command(&self) -> Vec<String> {
        self.study.command("ablate", &["--tolerance".to_owned(), self.tolerance.to_string()])
    }

    pub fn find(&self, case: &Case) -> Result<ablation::Ablation, Refusal> {
        let options = ablation::Options { tolerance: self.tolerance, time: !self.study.counts_only };
        self.study.work(case, &self.command(), |_, journal, progress| {
            ablation::run(case, &options, journal, progress)
        })
    }
}

pub fn found(table: &ablation::Ablation) -> Found<'_, ablation::Ablation> {
    Found {
        result: table,
        text: report::ablation(table),
        csv: Some(report::ablation_csv(table)),
        diagrams: Vec::new(),
        missing: table.missing,
    }
}

pub fn ablate(options: &Options) -> Result<Ending, Refusal> {
    let case = options.study.case()?;
    options.study.tell("ablate", &found(&options.find(&case)?))
}
