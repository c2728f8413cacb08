//! `tenter trade`: the speed-accuracy trade of a scene, every method.

use super::Ending;
use super::study::{Found, Study};
use crate::lab::{Case, report, trade};
use crate::scene::Refusal;
use clap::Args;

#[derive(Args, Clone)]
pub struct Options {
    #[command(flatten)]
    pub study: Study,
}

impl Options {
    pub fn command(&self) -> Vec<String> {
        self.study.command("trade", &[])
    }

    pub fn find(&self, case: &Case) -> Result<trade::Trade, Refusal> {
        let options =
            trade::Options { simulators: self.study.simulators.clone(), time: !self.study.counts_only };
        self.study.work(case, &self.command(), |references, journal, progress| {
            trade::run(case, &options, references, journal, progress)
        })
    }
}

pub fn found(table: &trade::Trade) -> Found<'_, trade::Trade> {
    Found {
        result: table,
        text: report::trade(table),
        csv: Some(report::trade_csv(table)),
        diagrams: vec![("trade".to_owned(), report::trade_diagram(table))],
        missing: table.missing,
    }
}

pub fn trade(options: &Options) -> Result<Ending, Refusal> {
    let case = options.study.case()?;
    options.study.tell("trade", &found(&options.find(&case)?))
}
