//! A study of the lab on a thread of its own: what it was asked, how far it is, what it has found so far, and its end.
//!
//! It starts from a snapshot, so the simulation goes on beside it. While time is being measured nothing else should use the
//! machine: the study then waits a moment until the interface has paused the simulation, and says so if it could not.

use std::{
    sync::{
        Arc, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crate::{
    lab::{
        Case, Event, Journal, Progress, ablation, advice, reference::Reference, reference::References,
        stability, timing, trade,
    },
    scene::{Place, Refusal, Scene},
    world::Snapshot,
};

/// What can be asked.
#[derive(Clone, Debug, PartialEq)]
pub enum Question {
    /// What does each method cost, and how wrong is it?
    Trade(trade::Options),
    /// Where does a method stop being stable?
    Stability(stability::Options),
    /// What does the scene require?
    Ablation(ablation::Options),
    /// Which settings are best?
    Advice(advice::Options),
}

/// What was found.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Answer {
    Trade(trade::Trade),
    Stability(stability::Stability),
    Ablation(ablation::Ablation),
    Advice(advice::Advice),
}

/// What is studied: to tell it, and to tell whether it is still what is open.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Name of the scene.
    pub title: String,
    /// The scene as it stood.
    pub scene: Scene,
    /// Where its meshes are.
    pub place: Place,
    /// Time of the state that trials start from, s; none where they start from the scene's beginning.
    pub from: Option<f64>,
    /// Simulated time that is compared, s.
    pub seconds: f64,
}

/// How far a study is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// What the present parts are about.
    pub stage: String,
    /// Parts that are done.
    pub done: usize,
    /// Of so many; 0 where that is not known.
    pub of: usize,
}

/// What thread and interface share.
#[derive(Default)]
struct Shared {
    cancelled: AtomicBool,
    /// Nothing else of ours uses the machine.
    is_quiet: AtomicBool,
    status: Mutex<Status>,
    /// What there is so far, until somebody looks.
    news: Mutex<Option<Answer>>,
    told: Mutex<Option<Instant>>,
}

/// A study that is under way. Dropped, it is cancelled.
pub struct Study {
    /// What is studied.
    pub subject: Subject,
    /// What was asked.
    pub question: Question,
    /// The machine was used by something else while time was measured.
    pub is_disturbed: bool,
    shared: Arc<Shared>,
    started: Instant,
    thread: Option<JoinHandle<Result<Answer, Refusal>>>,
}

/// Longest time that a study waits for the simulation to pause.
const PATIENCE: Duration = Duration::from_secs(2);
/// What was found so far is put together at most this often.
const NEWS_EVERY: Duration = Duration::from_millis(150);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Study {
    /// Starts a study of a state; `wake` is called whenever there is news.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(
        subject: Subject,
        snapshot: Arc<Snapshot>,
        question: Question,
        references: Arc<References>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Shared::default());
        let (own, asked, about) = (Arc::clone(&shared), question.clone(), subject.clone());
        let thread = std::thread::Builder::new().name("study".to_owned()).spawn(move || {
            let found = own.work(&about, &snapshot, &asked, &references, &wake);
            wake();
            found
        })?;
        let (is_disturbed, started) = (false, Instant::now());
        Ok(Self { subject, question, is_disturbed, shared, started, thread: Some(thread) })
    }

    /// Asks it to end; what it has found stays.
    pub fn cancel(&self) {
        self.shared.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether it was asked to end.
    pub fn is_cancelled(&self) -> bool {
        self.shared.cancelled.load(Ordering::Relaxed)
    }

    /// How far it is.
    pub fn status(&self) -> Status {
        lock(&self.shared.status).clone()
    }

    /// Time since it began.
    pub fn elapsed(&self) -> Duration {
        self.started.elapsed()
    }

    /// Whether time is being measured: the simulation should pause.
    pub fn is_timing(&self) -> bool {
        !self.is_finished() && lock(&self.shared.status).stage == timing::STAGE
    }

    /// Says whether anything else uses the machine.
    pub fn set_quiet(&mut self, is_quiet: bool) {
        let was_quiet = self.shared.is_quiet.swap(is_quiet, Ordering::Relaxed);
        self.is_disturbed |= was_quiet && !is_quiet && self.is_timing();
    }

    /// What it has found since the last question.
    pub fn news(&self) -> Option<Answer> {
        lock(&self.shared.news).take()
    }

    /// Whether it has come to its end.
    pub fn is_finished(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// What it found, once it has come to its end.
    pub fn finish(&mut self) -> Option<Result<Answer, Refusal>> {
        let thread = self.thread.take_if(|thread| thread.is_finished())?;
        Some(
            thread.join().unwrap_or_else(|_| Err(Refusal::new("the study broke off by an error of its own"))),
        )
    }
}

impl Drop for Study {
    fn drop(&mut self) {
        self.cancel();
    }
}

impl Shared {
    fn work(
        &self,
        subject: &Subject,
        snapshot: &Snapshot,
        question: &Question,
        references: &References,
        wake: &(dyn Fn() + Sync),
    ) -> Result<Answer, Refusal> {
        let case = match subject.from {
            Some(_) => Case::at(snapshot.clone(), subject.place.clone(), subject.seconds),
            None => Case::new(subject.scene.clone(), subject.place.clone(), subject.seconds)?,
        };
        let journal = Journal::new();
        let listen = |event: Event| self.listen(event, question, &journal, wake);
        let progress: Progress = &listen;
        // One core is left for the simulation and the interface.
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let pool = rayon::ThreadPoolBuilder::new().num_threads((cores - 1).max(1)).build();
        let pool = pool.map_err(|e| Refusal::new(format!("the system gives no threads: {e}")))?;
        pool.install(|| match question {
            Question::Trade(options) => {
                trade::run(&case, options, references, &journal, progress).map(Answer::Trade)
            }
            Question::Stability(options) => {
                stability::run(&case, options, &journal, progress).map(Answer::Stability)
            }
            Question::Ablation(options) => {
                ablation::run(&case, options, &journal, progress).map(Answer::Ablation)
            }
            Question::Advice(options) => {
                advice::run(&case, options, references, &journal, progress).map(Answer::Advice)
            }
        })
    }

    fn listen(&self, event: Event, question: &Question, journal: &Journal, wake: &(dyn Fn() + Sync)) -> bool {
        match event {
            Event::Alive => {}
            Event::Stage(stage) => {
                let changed = {
                    let mut status = lock(&self.status);
                    let changed = status.stage != stage;
                    *status = Status { stage: stage.to_owned(), ..Status::default() };
                    changed
                };
                wake();
                if changed && stage == timing::STAGE {
                    let start = Instant::now();
                    let waits = || !self.is_quiet.load(Ordering::Relaxed) && start.elapsed() < PATIENCE;
                    while waits() && !self.cancelled.load(Ordering::Relaxed) {
                        std::thread::sleep(Duration::from_millis(5));
                    }
                }
            }
            Event::Done(done, of) => {
                {
                    let mut status = lock(&self.status);
                    (status.done, status.of) = (done.max(status.done), of);
                    if let Question::Advice(options) = question
                        && status.stage == "advice"
                    {
                        // One method after the other: each is a stage of its own to the lab.
                        (status.done, status.of) = (journal.ran(), searches(&options.simulators));
                    }
                }
                let is_due = lock(&self.told).is_none_or(|told| told.elapsed() >= NEWS_EVERY);
                if is_due && let Some(found) = so_far(question, journal) {
                    *lock(&self.told) = Some(Instant::now());
                    *lock(&self.news) = Some(found);
                    wake();
                }
            }
        }
        !self.cancelled.load(Ordering::Relaxed)
    }
}

/// Searches of an advice: one for each method and number of sweeps.
fn searches(simulators: &[String]) -> usize {
    let entries = trade::chosen(simulators).unwrap_or_default();
    entries.into_iter().map(|entry| crate::lab::variants(entry).len()).sum()
}

/// What a journal holds so far, of the studies whose parts say something by themselves.
fn so_far(question: &Question, journal: &Journal) -> Option<Answer> {
    match question {
        Question::Trade(_) => {
            let rows: Vec<trade::Row> = journal.results("trade");
            let reference = journal.results::<Reference>("reference").into_iter().next();
            (!rows.is_empty()).then(|| Answer::Trade(trade::table(rows, reference, 0, None)))
        }
        _ => None,
    }
}
