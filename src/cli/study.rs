//! What the lab's commands share: their options, their journal, their progress, and where their results go.

use super::{Common, Ending, output, run};
use crate::lab::journal::{Header, Journal, Shard, write_whole};
use crate::lab::reference::References;
use crate::lab::{Case, Event, Progress};
use crate::scene::Refusal;
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;

/// Options of every study.
#[derive(Args, Clone, Debug)]
pub struct Study {
    /// A .ron file, a mesh, a built-in scene, or - for standard input.
    pub scene: String,
    /// Simulated time that is compared, s.
    #[arg(long, value_name = "T", default_value_t = 1.0, value_parser = positive)]
    seconds: f64,
    /// Methods, separated by commas; all where left out.
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub simulators: Vec<String>,
    /// Folder for the results, and for the journal from which a study resumes.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Runs part I of N; `tenter lab merge` joins them. Needs --out.
    #[arg(long, value_name = "I/N", value_parser = shard, requires = "out")]
    shard: Option<Shard>,
    /// Measures no time, only counts: these are the same on every machine.
    #[arg(long)]
    pub counts_only: bool,
    #[command(flatten)]
    pub common: Common,
    /// Whether only what is known already is put together.
    #[arg(skip)]
    pub frozen: bool,
}

/// What a study found, in every form.
pub struct Found<'a, T> {
    pub result: &'a T,
    pub text: String,
    pub csv: Option<String>,
    /// Diagrams by name.
    pub diagrams: Vec<(String, String)>,
    /// Parts that are missing.
    pub missing: usize,
}

pub fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "it is not a number; accepted: above 0")?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("accepted: above 0".to_owned()) }
}

fn shard(text: &str) -> Result<Shard, String> {
    let wrong = || "accepted: I/N with I from 1 to N, as in 2/8".to_owned();
    let (index, count) = text.split_once('/').ok_or_else(wrong)?;
    let (index, count): (usize, usize) =
        (index.parse().map_err(|_| wrong())?, count.parse().map_err(|_| wrong())?);
    if (1..=count).contains(&index) { Ok(Shard { index: index - 1, count }) } else { Err(wrong()) }
}

impl Study {
    /// The command that makes the same study again; `options` are the study's own.
    pub fn command(&self, name: &str, options: &[String]) -> Vec<String> {
        let mut words =
            vec![name.to_owned(), self.scene.clone(), "--seconds".to_owned(), self.seconds.to_string()];
        words.extend(options.iter().cloned());
        if !self.simulators.is_empty() {
            words.extend(["--simulators".to_owned(), self.simulators.join(",")]);
        }
        for (key, value) in &self.common.set {
            words.extend(["--set".to_owned(), format!("{key}={value}")]);
        }
        if self.counts_only {
            words.push("--counts-only".to_owned());
        }
        words
    }

    pub fn case(&self) -> Result<Case, Refusal> {
        let opened = self.common.open(&self.scene)?;
        self.common.warn(&self.common.world(&opened)?.warnings());
        Case::new(opened.scene, opened.place, self.seconds).map_err(|e| e.at(&opened.title))
    }

    /// Does a study on the threads asked for, with its journal, references and progress.
    pub fn work<T: Send>(
        &self,
        case: &Case,
        command: &[String],
        study: impl FnOnce(&References, &Journal, Progress) -> Result<T, Refusal> + Send,
    ) -> Result<T, Refusal> {
        let (references, journal) = match &self.out {
            None => (References::default(), Journal::new()),
            Some(folder) => {
                std::fs::create_dir_all(folder)
                    .map_err(|e| Refusal::new(format!("{}: {e}", folder.display())))?;
                let header = Header {
                    tenter: env!("CARGO_PKG_VERSION").to_owned(),
                    command: command.to_vec(),
                    key: format!("{:016x} {}", case.key(), command.join(" ")),
                };
                (References::in_folder(folder), Journal::open(folder, &header, self.shard)?)
            }
        };
        let journal = if self.frozen { journal.frozen() } else { journal };
        run::catch_interrupt();
        let bar = run::progress(&self.common, 1);
        let listen = |event: Event| {
            match event {
                Event::Stage(name) => {
                    bar.set_position(0);
                    bar.set_message(name.to_owned());
                }
                Event::Done(done, of) => {
                    bar.set_length(of as u64);
                    bar.set_position(done as u64);
                }
                Event::Alive => bar.tick(),
            }
            !run::interrupted()
        };
        let threads = self.common.threads.unwrap_or(0) as usize;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let pool = pool.map_err(|e| Refusal::new(format!("{threads} threads: {e}")))?;
        let found = pool.install(|| study(&references, &journal, &listen));
        bar.finish_and_clear();
        if run::interrupted() {
            self.common.warn(&["interrupted: this is what there is".to_owned()]);
        }
        found
    }

    /// Prints and writes what was found.
    pub fn tell<T: Serialize>(&self, name: &str, found: &Found<T>) -> Result<Ending, Refusal> {
        let json = output::json(found.result)?;
        if self.common.json {
            output::print(&json);
        }
        self.common.say(found.text.trim_end());
        // A shard's tables would only be in the way of the joined ones.
        if let Some(folder) = self.out.as_ref().filter(|_| self.shard.is_none()) {
            let write = |ending: &str, text: &str| {
                write_whole(&folder.join(format!("{name}{ending}")), text.as_bytes())
            };
            write(".json", &format!("{json}\n"))?;
            write(".txt", &found.text)?;
            if let Some(csv) = &found.csv {
                write(".csv", csv)?;
            }
            for (diagram, svg) in found.diagrams.iter().filter(|(_, svg)| !svg.is_empty()) {
                write_whole(&folder.join(format!("{diagram}.svg")), svg.as_bytes())?;
            }
        }
        Ok(Ending::Done)
    }
}
