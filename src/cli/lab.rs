//! `tenter lab merge`: joins the shards of studies and puts their tables together.

use super::study::{Found, Study};
use super::{Command as Any, CommandLine, Ending, ablate, advise, stability, trade};
use crate::lab::journal;
use crate::scene::Refusal;
use clap::{Args, Parser, Subcommand};
use serde::Serialize;
use std::path::PathBuf;

#[derive(Subcommand)]
pub enum Command {
    /// Joins the shards of studies and puts their tables together.
    Merge(Options),
}

#[derive(Args)]
pub struct Options {
    /// Folders that shards wrote to.
    #[arg(required = true, value_name = "DIR")]
    folders: Vec<PathBuf>,
    /// Folder for the joined journal and the tables; the first one where left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Writes the result to standard output as JSON.
    #[arg(long)]
    json: bool,
    /// Says nothing but errors.
    #[arg(long)]
    quiet: bool,
}

pub fn merge(options: &Options) -> Result<Ending, Refusal> {
    let out = options.out.clone().unwrap_or_else(|| options.folders[0].clone());
    std::fs::create_dir_all(&out).map_err(|e| Refusal::new(format!("{}: {e}", out.display())))?;
    let headers = journal::join(&options.folders, &out)?;
    if headers.is_empty() {
        return Err(Refusal::new(
            "lab merge: no journals there; accepted: folders that --out --shard wrote to",
        ));
    }
    for header in headers {
        let words = [vec!["tenter".to_owned()], header.command.clone()].concat();
        let line = CommandLine::try_parse_from(&words);
        let command = line.ok().and_then(|line| line.command);
        let adopt = |study: &mut Study| {
            study.out = Some(out.clone());
            study.common.json = options.json;
            study.common.quiet = options.quiet;
        };
        match command {
            Some(Any::Trade(mut o)) => {
                adopt(&mut o.study);
                let case = o.study.case()?;
                tell(&mut o, |o| &mut o.study, "trade", |o| o.find(&case), |t| Ok(trade::found(t)))?;
            }
            Some(Any::Stability(mut o)) => {
                adopt(&mut o.study);
                let case = o.study.case()?;
                let names = o.study.simulators.clone();
                tell(
                    &mut o,
                    |o| &mut o.study,
                    "stability",
                    |o| o.find(&case),
                    |t| stability::found(t, &names),
                )?;
            }
            Some(Any::Ablate(mut o)) => {
                adopt(&mut o.study);
                let case = o.study.case()?;
                tell(&mut o, |o| &mut o.study, "ablate", |o| o.find(&case), |t| Ok(ablate::found(t)))?;
            }
            Some(Any::Advise(mut o)) => {
                adopt(&mut o.study);
                let case = o.study.case()?;
                tell(&mut o, |o| &mut o.study, "advise", |o| o.find(&case), |t| Ok(advise::found(t)))?;
            }
            _ => {
                return Err(Refusal::new(format!(
                    "lab merge: '{}' is no study that this version of tenter knows",
                    header.command.join(" ")
                )));
            }
        }
    }
    Ok(Ending::Done)
}

/// Puts a table together from what is known; where every part is there, runs what stands on all of them (the proposal of
/// an ablation, the sixty seconds of an advice).
fn tell<O, T: Serialize>(
    options: &mut O,
    study: impl Fn(&mut O) -> &mut Study,
    name: &str,
    find: impl Fn(&O) -> Result<T, Refusal>,
    found: impl for<'a> Fn(&'a T) -> Result<Found<'a, T>, Refusal>,
) -> Result<Ending, Refusal> {
    study(options).frozen = true;
    let mut table = find(options)?;
    if found(&table)?.missing == 0 {
        study(options).frozen = false;
        table = find(options)?;
    }
    study(options).tell(name, &found(&table)?)
}
