//! Trials that are written down as they finish: one JSON line each, so that a study can be stopped, resumed, spread over
//! machines, and joined again.
//!
//! A file begins with a line that says which study of which case it holds. A trial is known by its description, so a
//! later run with the same folder takes the result from there. Of the parts of a study a shard runs its own share.

use super::{Event, Progress, Stop};
use crate::scene::Refusal;
use rayon::prelude::*;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

/// What the first line of a file says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of Tenter.
    pub tenter: String,
    /// The command without its shard and folder, as words: running it again makes the same study.
    pub command: Vec<String>,
    /// What the results depend on, [`Case::key`](super::Case::key) and the options included.
    pub key: String,
}

/// Part `index` (from 0) of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Which.
    pub index: usize,
    /// Of how many.
    pub count: usize,
}

/// One finished trial.
#[derive(Serialize, Deserialize)]
struct Line {
    trial: Value,
    result: Value,
}

/// The trials of a study that are done.
#[derive(Default)]
pub struct Journal {
    known: Mutex<BTreeMap<String, Value>>,
    file: Option<Mutex<File>>,
    shard: Option<Shard>,
    /// Nothing new is run: what is known is put together.
    frozen: bool,
    missing: AtomicUsize,
    ran: AtomicUsize,
}

fn failed(path: &Path) -> impl Fn(std::io::Error) -> Refusal + '_ {
    move |e| Refusal::new(format!("{}: {e}", path.display()))
}

/// Writes a file whole or not at all.
///
/// # Errors
/// A place that cannot be written.
pub fn write_whole(path: &Path, content: &[u8]) -> Result<(), Refusal> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = tempfile::Builder::new().prefix(".tenter-").tempfile_in(folder).map_err(failed(path))?;
    file.write_all(content).map_err(failed(path))?;
    file.persist(path).map_err(|e| failed(path)(e.error))?;
    Ok(())
}

/// The journals in a folder.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<_> = entries.filter(|path| path.extension().is_some_and(|e| e == "jsonl")).collect();
    files.sort();
    files
}

/// The header and the trials of a file. A last line that was cut off is left out.
///
/// # Errors
/// A file that cannot be read or does not begin with a header.
pub fn read(path: &Path) -> Result<(Header, BTreeMap<String, Value>), Refusal> {
    let text = crate::scene::read_limited(path)?;
    let mut lines = text.lines();
    let header = serde_json::from_str(lines.next().unwrap_or_default())
        .map_err(|e| Refusal::new(format!("{}: is no journal of the lab: {e}", path.display())))?;
    let trials = lines.filter_map(|line| serde_json::from_str::<Line>(line).ok());
    Ok((header, trials.map(|line| (line.trial.to_string(), line.result)).collect()))
}

/// Joins the journals of some folders into one file a study in `out`, and answers with their headers.
///
/// # Errors
/// A file that is no journal; different studies under one name; a folder that cannot be written.
pub fn join(folders: &[PathBuf], out: &Path) -> Result<Vec<Header>, Refusal> {
    let mut studies: BTreeMap<String, (Header, BTreeMap<String, Value>)> = BTreeMap::new();
    for file in folders.iter().flat_map(|folder| files(folder)) {
        let (header, trials) = read(&file)?;
        let name = header.command.first().cloned().unwrap_or_default();
        let (known, all) = studies.entry(name).or_insert_with(|| (header.clone(), BTreeMap::new()));
        if *known != header {
            return Err(Refusal::new(format!(
                "{}: is of another study ({}) than the others ({}); accepted: shards of one",
                file.display(),
                header.command.join(" "),
                known.command.join(" ")
            )));
        }
        all.extend(trials);
    }
    let mut headers = Vec::new();
    for (name, (header, trials)) in studies {
        let mut text = serde_json::to_string(&header).map_err(|e| Refusal::new(e.to_string()))? + "\n";
        for (trial, result) in trials {
            text += &format!("{{\"trial\":{trial},\"result\":{result}}}\n");
        }
        write_whole(&out.join(format!("{name}.jsonl")), text.as_bytes())?;
        headers.push(header);
    }
    Ok(headers)
}

impl Journal {
    /// A journal that is kept in memory only.
    pub fn new() -> Self {
        Self::default()
    }

    /// A journal in a folder. What other journals of the same study hold there is known from the start.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn open(folder: &Path, header: &Header, shard: Option<Shard>) -> Result<Self, Refusal> {
        let study = header.command.first().map_or("lab", String::as_str);
        let name = match shard {
            Some(Shard { index, count }) => format!("{study}.{}of{count}.jsonl", index + 1),
            None => format!("{study}.jsonl"),
        };
        let path = folder.join(name);
        let mut known = BTreeMap::new();
        let mut own = false;
        for file in files(folder) {
            match read(&file) {
                Ok((found, trials)) if found.key == header.key => {
                    known.extend(trials);
                    own |= file == path;
                }
                // Another study's file of this name, or one that broke off in its first line, makes room.
                _ => {}
            }
        }
        let mut file = File::options()
            .create(true)
            .append(own)
            .write(true)
            .truncate(!own)
            .open(&path)
            .map_err(failed(&path))?;
        if own {
            // Ends a line that was cut off.
            file.write_all(b"\n").map_err(failed(&path))?;
        } else {
            let line = serde_json::to_string(header).map_err(|e| Refusal::new(e.to_string()))?;
            writeln!(file, "{line}").map_err(failed(&path))?;
        }
        Ok(Self { known: Mutex::new(known), file: Some(Mutex::new(file)), shard, ..Self::default() })
    }

    /// The same, but nothing new is run.
    #[must_use]
    pub fn frozen(self) -> Self {
        Self { frozen: true, ..self }
    }

    /// Parts that were left out: another shard's, or not done when the study was stopped.
    pub fn missing(&self) -> usize {
        self.missing.load(Ordering::Relaxed)
    }

    /// Parts that were run, not taken from a file.
    pub fn ran(&self) -> usize {
        self.ran.load(Ordering::Relaxed)
    }

    /// Does every part of a study that is not known yet, on the threads of the current pool or one after the other, and
    /// writes each down as it finishes. `None` stands for a part that was left out.
    ///
    /// # Errors
    /// The first part that is refused; a file that cannot be written.
    pub fn each<T, R>(
        &self,
        stage: &str,
        parts: &[T],
        progress: Progress,
        work: impl Fn(&T) -> Result<R, Stop> + Sync,
    ) -> Result<Vec<Option<R>>, Refusal>
    where
        T: Serialize + Sync,
        R: Serialize + DeserializeOwned + Send,
    {
        progress(Event::Stage(stage));
        let done = AtomicUsize::new(0);
        parts
            .par_iter()
            .map(|part| {
                let trial = serde_json::json!({ stage: part });
                // Stopped, the parts that are left are not even begun.
                let begin = || if progress(Event::Alive) { work(part) } else { Err(Stop::Cancelled) };
                let result = self.one(&trial, begin);
                let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress(Event::Done(done, parts.len()));
                result
            })
            .collect()
    }

    /// What the parts of a stage gave that are done so far, in the order of their descriptions.
    pub fn results<R: DeserializeOwned>(&self, stage: &str) -> Vec<R> {
        let start = format!("{{{}:", Value::from(stage));
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let stage = known.range(start.clone()..).take_while(|(key, _)| key.starts_with(&start));
        stage.filter_map(|(_, result)| serde_json::from_value(result.clone()).ok()).collect()
    }

    /// Whether [`each`](Self::each) would run a part itself: it is not known, and not another shard's.
    pub fn wants<T: Serialize>(&self, stage: &str, part: &T) -> bool {
        let key = serde_json::json!({ stage: part }).to_string();
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner).contains_key(&key);
        !known && !self.frozen && self.owns(&key)
    }

    /// Whether a part falls to this shard: by its description, so that every shard decides alike.
    fn owns(&self, key: &str) -> bool {
        self.shard.is_none_or(|shard| super::hash(key) % shard.count as u64 == shard.index as u64)
    }

    fn one<R: Serialize + DeserializeOwned>(
        &self,
        trial: &Value,
        work: impl FnOnce() -> Result<R, Stop>,
    ) -> Result<Option<R>, Refusal> {
        let key = trial.to_string();
        let known = || self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let stored = known().get(&key).cloned();
        if let Some(result) = stored.and_then(|value| serde_json::from_value(value).ok()) {
            return Ok(Some(result));
        }
        let result = if self.frozen || !self.owns(&key) { Err(Stop::Cancelled) } else { work() };
        match result {
            Ok(result) => {
                self.ran.fetch_add(1, Ordering::Relaxed);
                let value = serde_json::to_value(&result).map_err(|e| Refusal::new(e.to_string()))?;
                if let Some(file) = &self.file {
                    let line = serde_json::json!({ "trial": trial, "result": value });
                    let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
                    let written = file.write_all(format!("{line}\n").as_bytes()).and_then(|()| file.flush());
                    written.map_err(|e| Refusal::new(format!("the journal: {e}")))?;
                }
                // What is told is what a file would tell, so that one run and a joined one are the same.
                let told = serde_json::from_value(value.clone()).map_err(|e| Refusal::new(e.to_string()))?;
                known().insert(key, value);
                Ok(Some(told))
            }
            Err(Stop::Cancelled) => {
                self.missing.fetch_add(1, Ordering::Relaxed);
                Ok(None)
            }
            Err(Stop::Refused(refusal)) => Err(refusal),
        }
    }
}
