//! Counts the memory that work holds at most, how often it asks for some, and what the process holds.
//!
//! Counting what is allocated takes an allocator of our own, and that takes `unsafe`: it hands every call on to the
//! system's.
#![allow(unsafe_code)]
#![allow(dead_code, reason = "every test file uses a part of this")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::atomic::{AtomicIsize, Ordering};

thread_local! {
    /// Bytes that this thread holds, and the most that it has held since the mark.
    static HELD: Cell<(isize, isize)> = const { Cell::new((0, 0)) };
    /// How often this thread has asked for memory.
    static REQUESTS: Cell<usize> = const { Cell::new(0) };
}

/// Bytes that all threads hold.
static ALL: AtomicIsize = AtomicIsize::new(0);

struct Counting;

impl Counting {
    fn add(bytes: isize) {
        if bytes > 0 {
            let _ = REQUESTS.try_with(|requests| requests.set(requests.get() + 1));
        }
        ALL.fetch_add(bytes, Ordering::Relaxed);
        // While a thread ends, its counter is gone and nobody asks.
        let _ = HELD.try_with(|held| {
            let (now, most) = held.get();
            held.set((now + bytes, most.max(now + bytes)));
        });
    }
}

// SAFETY: every call goes to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        Self::add(layout.size().cast_signed());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        Self::add(layout.size().cast_signed());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        Self::add(-layout.size().cast_signed());
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // As if it were always moved: the old and the new block at once.
        Self::add(size.cast_signed());
        Self::add(-layout.size().cast_signed());
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Lets this thread do alone what it would share with others, whose memory is not counted here.
fn stay_alone() {
    // Miri does not know all that a pool does.
    if cfg!(not(miri)) && rayon::current_thread_index().is_none() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build();
        // For as long as the thread lives.
        std::mem::forget(pool.expect("a pool of this thread"));
    }
}

/// Does some work, and tells how many bytes were held for it at most.
pub fn measured<T>(work: impl FnOnce() -> T) -> (T, usize) {
    stay_alone();
    let before = HELD.with(|held| {
        let (now, _) = held.get();
        held.set((now, now));
        now
    });
    let result = work();
    let most = HELD.with(|held| held.get().1) - before;
    (result, most.unsigned_abs())
}

/// Bytes that the whole process holds of this allocator's: what libraries in C hold is not among them.
pub fn held() -> usize {
    ALL.load(Ordering::Relaxed).unsigned_abs()
}

/// Gives back to the system what the heap keeps free for later.
pub fn trim() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        // SAFETY: this is its declaration in malloc.h, and it may be called at any time.
        unsafe extern "C" {
            safe fn malloc_trim(keep: usize) -> std::ffi::c_int;
        }
        malloc_trim(0);
    }
}

/// Does some work, and tells by how many bytes more are held after it.
pub fn added<T>(work: impl FnOnce() -> T) -> (T, isize) {
    stay_alone();
    let before = HELD.with(Cell::get).0;
    let result = work();
    let after = HELD.with(Cell::get).0;
    (result, after - before)
}

/// Does some work, and tells how often it asked for memory.
pub fn requests(work: impl FnOnce()) -> usize {
    let before = REQUESTS.get();
    work();
    REQUESTS.get() - before
}

/// Most bytes that a reader may hold for a file of some bytes.
pub fn allowed(file: usize) -> usize {
    64 * file + (64 << 20)
}
