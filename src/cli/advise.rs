//! `tenter advise`: the cheapest method and step that keep an error, or the most accurate within a budget.

use super::Ending;
use super::study::{Found, Study, positive};
use crate::lab::advice::{self, Goal};
use crate::lab::{Case, report};
use crate::scene::Refusal;
use clap::Args;

#[derive(Args, Clone)]
#[command(group = clap::ArgGroup::new("goal").required(true))]
pub struct Options {
    #[command(flatten)]
    pub study: Study,
    /// RMS position error that is accepted, m.
    #[arg(long, group = "goal", value_name = "E", value_parser = positive)]
    pub max_error: Option<f64>,
    /// Time that a frame of 1/60 s may take to compute, ms.
    #[arg(long, group = "goal", value_name = "B", value_parser = positive)]
    pub budget_ms: Option<f64>,
}

impl Options {
    pub fn command(&self) -> Vec<String> {
        let goal = match (self.max_error, self.budget_ms) {
            (Some(error), _) => ["--max-error".to_owned(), error.to_string()],
            (None, budget) => ["--budget-ms".to_owned(), budget.unwrap_or_default().to_string()],
        };
        self.study.command("advise", &goal)
    }

    pub fn find(&self, case: &Case) -> Result<advice::Advice, Refusal> {
        let goal = match (self.max_error, self.budget_ms) {
            (Some(error), _) => Goal::MaxError(error),
            (None, budget) => Goal::BudgetMs(budget.unwrap_or_default()),
        };
        let time = !self.study.counts_only || self.max_error.is_none();
        let options = advice::Options { simulators: self.study.simulators.clone(), goal, time };
        self.study.work(case, &self.command(), |references, journal, progress| {
            advice::run(case, &options, references, journal, progress)
        })
    }
}

pub fn found(advice: &advice::Advice) -> Found<'_, advice::Advice> {
    Found {
        result: advice,
        text: report::advice(advice),
        csv: None,
        diagrams: Vec::new(),
        missing: advice.missing,
    }
}

pub fn advise(options: &Options) -> Result<Ending, Refusal> {
    let case = options.study.case()?;
    options.study.tell("advise", &found(&options.find(&case)?))
}
