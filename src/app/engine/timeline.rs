//! The last minutes of all lanes: states under a limit of memory, from which any moment between them is computed again.
//!
//! A simulation takes the same way again to the bit, so it is enough to keep a state now and then, and the commands. States are kept
//! as far apart in computing time as makes going anywhere a matter of some hundredths of a second. Where memory runs out those
//! are dropped first whose loss matters least: far back they may stand farther apart. A thread packs them; until it has, they
//! stand as they are.

use std::{
    collections::VecDeque,
    sync::{
        Arc, Mutex, PoisonError, Weak,
        atomic::{AtomicUsize, Ordering},
        mpsc::{Sender, channel},
    },
    time::{Duration, Instant},
};

use super::{Lane, Remembered};
use crate::world::{Entry, Packed, Play, Snapshot};

/// Computing time between two states: what going to a moment takes at most, unless memory is short.
const APART: Duration = Duration::from_millis(40);
/// Computing time between two states beyond which none between them is dropped.
const FARTHEST: Duration = Duration::from_secs(2);
/// The part of the computing time that taking states may cost.
const SHARE: f64 = 0.02;
/// Most states: with more of them the search for the least important would take long.
const MOST: usize = 4096;
/// Place on the timeline that a jump takes, s: so that both of its sides can be gone to.
const JUMP: f64 = 0.05;
/// Memory where nothing is said, bytes.
pub(super) const MEMORY: usize = 256_000_000;

/// A state of one lane.
struct State {
    form: Mutex<Form>,
    size: AtomicUsize,
}

enum Form {
    Plain(Arc<Snapshot>),
    Packed(Box<Packed>),
}

/// A lane in a frame.
struct Column {
    state: Arc<State>,
    play: Option<Play>,
    /// The lane is one that was added later: what it differs in from the one that it came from.
    settings: Vec<(String, String)>,
}

/// A state of all lanes.
struct Frame {
    /// Place on the timeline, s.
    at: f64,
    /// Computing time until then.
    work: Duration,
    /// The beat's clock, s.
    clock: f64,
    /// It was reached by steps and commands from the frame before.
    continues: bool,
    columns: Vec<Column>,
}

/// A moment to go to.
pub(super) struct Way {
    /// The state before it.
    pub lanes: Vec<Stand>,
    /// Its place on the timeline and the beat's clock, s.
    pub at: f64,
    pub clock: f64,
    /// Whether later moments can be computed from it.
    pub leads_on: bool,
}

/// A lane at the start of a way.
pub(super) struct Stand {
    pub snapshot: Snapshot,
    pub play: Option<Play>,
    pub settings: Vec<(String, String)>,
    /// Commands until the next state.
    pub commands: Vec<Entry>,
}

/// The states.
pub(super) struct Timeline {
    frames: VecDeque<Frame>,
    now: f64,
    end: f64,
    work: Duration,
    next: Duration,
    continues: bool,
    limit: usize,
    packer: Option<Sender<Weak<State>>>,
}

impl Default for Timeline {
    fn default() -> Self {
        Self {
            frames: VecDeque::new(),
            now: 0.0,
            end: 0.0,
            work: Duration::ZERO,
            next: Duration::ZERO,
            continues: false,
            limit: MEMORY,
            packer: None,
        }
    }
}

impl Timeline {
    /// Begins anew.
    pub fn clear(&mut self) {
        let (limit, packer) = (self.limit, self.packer.take());
        *self = Self { limit, packer, ..Self::default() };
    }

    /// Memory that it may take, bytes.
    pub fn allow(&mut self, bytes: usize) {
        self.limit = bytes;
        self.thin();
    }

    /// Simulated time (s) has passed, and was computed in so long. True if a state is to be kept.
    pub fn pass(&mut self, time: f64, work: Duration) -> bool {
        self.now += time;
        self.end = self.now;
        self.work += work;
        self.work >= self.next
    }

    /// What comes now does not follow from what was. Kept on both sides of it, states show both.
    pub fn jump(&mut self) {
        self.now += JUMP;
        self.end = self.now;
        self.continues = false;
    }

    /// Keeps the present state.
    pub fn keep(&mut self, lanes: &[Lane], clock: f64) {
        if self.frames.back().is_some_and(|last| last.at >= self.now && self.continues) {
            // Commands that came since have taken no time.
            self.continues = self.frames.pop_back().is_some_and(|last| last.continues);
        }
        let start = Instant::now();
        let columns = lanes.iter().map(|lane| Column {
            state: self.packed(lane.world.snapshot()),
            play: lane.play.clone(),
            settings: Vec::new(),
        });
        let columns = columns.collect();
        self.next = self.work + APART.max(start.elapsed().div_f64(SHARE));
        let continues = std::mem::replace(&mut self.continues, true);
        self.frames.push_back(Frame { at: self.now, work: self.work, clock, continues, columns });
        self.thin();
    }

    /// The way to a place.
    pub fn way(&self, to: f64) -> Option<Way> {
        let index = self.frames.partition_point(|frame| frame.at <= to).saturating_sub(1);
        let frame = self.frames.get(index)?;
        let next = self.frames.get(index + 1).filter(|next| next.continues);
        let lanes = frame.columns.iter().enumerate().map(|(i, column)| {
            let snapshot = column.state.snapshot()?;
            let later = next.and_then(|next| next.columns.get(i));
            let commands = later.map(|later| later.state.commands_since(snapshot.logged()));
            let (play, settings) = (column.play.clone(), column.settings.clone());
            Some(Stand { snapshot, play, settings, commands: commands.unwrap_or_default() })
        });
        let lanes = lanes.collect::<Option<_>>()?;
        Some(Way { lanes, at: frame.at, clock: frame.clock, leads_on: next.is_some() })
    }

    /// The moment of a place is shown.
    pub fn show(&mut self, at: f64) {
        self.now = at.min(self.end);
    }

    /// Whether a moment of the past is shown.
    pub fn is_past(&self) -> bool {
        self.now < self.end
    }

    /// Time goes on from the moment that is shown: what came after is forgotten.
    pub fn go_on(&mut self) {
        self.frames.truncate(self.frames.partition_point(|frame| frame.at <= self.now));
        self.end = self.now;
        self.next = self.work;
        self.continues = true;
    }

    /// A lane was added that is to share the past of another.
    pub fn add_lane(&mut self, from: usize, at: usize, settings: &[(String, String)]) {
        for frame in &mut self.frames {
            let Some(source) = frame.columns.get(from) else { continue };
            let all = [&source.settings, settings].concat();
            let (state, play) = (Arc::clone(&source.state), source.play.clone());
            frame.columns.insert(at.min(frame.columns.len()), Column { state, play, settings: all });
        }
    }

    /// A lane was removed.
    pub fn remove_lane(&mut self, lane: usize) {
        for frame in &mut self.frames {
            if lane < frame.columns.len() {
                frame.columns.remove(lane);
            }
        }
    }

    /// What the interface sees.
    pub fn remembered(&self) -> Remembered {
        let from = self.frames.front().map_or(self.now, |frame| frame.at);
        Remembered { from, at: self.now, to: self.end, bytes: [self.bytes(), self.limit] }
    }

    fn bytes(&self) -> usize {
        let size = |column: &Column| column.state.size.load(Ordering::Relaxed);
        self.frames.iter().flat_map(|frame| &frame.columns).map(size).sum()
    }

    /// Drops what matters least until memory suffices; the last state stays.
    fn thin(&mut self) {
        while self.frames.len() > 1 && (self.bytes() > self.limit || self.frames.len() > MOST) {
            let inner = 1..self.frames.len() - 1;
            let least = inner.filter_map(|i| Some((i, self.loss(i)?))).min_by(|a, b| a.1.total_cmp(&b.1));
            self.frames.remove(least.map_or(0, |(i, _)| i));
        }
    }

    /// What dropping a state loses: the gap that it leaves, as a part of its age; none where it cannot be done without.
    fn loss(&self, i: usize) -> Option<f64> {
        let [before, own, after] = [i - 1, i, i + 1].map(|i| &self.frames[i]);
        let (gap, age) = (after.work.saturating_sub(before.work), self.work.saturating_sub(own.work) + APART);
        let is_between = own.continues && after.continues && gap <= FARTHEST;
        is_between.then(|| gap.as_secs_f64() / age.as_secs_f64())
    }

    /// A state that a thread packs.
    fn packed(&mut self, snapshot: Snapshot) -> Arc<State> {
        let size = AtomicUsize::new(snapshot.size());
        let state = Arc::new(State { form: Mutex::new(Form::Plain(Arc::new(snapshot))), size });
        let packer = self.packer.get_or_insert_with(start_packer);
        // Without a thread it stays as it is.
        let _ = packer.send(Arc::downgrade(&state));
        state
    }
}

impl State {
    fn form(&self) -> std::sync::MutexGuard<'_, Form> {
        self.form.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn snapshot(&self) -> Option<Snapshot> {
        match &*self.form() {
            Form::Plain(snapshot) => Some(Snapshot::clone(snapshot)),
            Form::Packed(packed) => packed.unpack().ok(),
        }
    }

    fn commands_since(&self, count: usize) -> Vec<Entry> {
        match &*self.form() {
            Form::Plain(snapshot) => snapshot.commands_since(count),
            Form::Packed(packed) => packed.commands_since(count),
        }
    }

    fn pack(&self) {
        let plain = match &*self.form() {
            Form::Plain(plain) => Arc::clone(plain),
            Form::Packed(_) => return,
        };
        // Nobody waits meanwhile.
        let packed = Packed::new(&plain);
        self.size.store(packed.size(), Ordering::Relaxed);
        *self.form() = Form::Packed(Box::new(packed));
    }
}

/// Ends with the sender.
fn start_packer() -> Sender<Weak<State>> {
    let (sender, receiver) = channel::<Weak<State>>();
    let work = move || {
        for state in receiver {
            if let Some(state) = state.upgrade() {
                state.pack();
            }
        }
    };
    // A system that gives no thread drops the receiver: states then stay as they are.
    let _ = std::thread::Builder::new().name("timeline".to_owned()).spawn(work);
    sender
}
