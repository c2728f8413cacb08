//! The heap of the workbench's process.

/// Lets all threads share one heap from now on. By itself glibc gives threads heaps of their own, and what is free in one is of no
/// use to the others: the process grows for hours while what is in use does not.
pub fn share() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::ffi::c_int;
        /// `M_ARENA_MAX` of malloc.h.
        const MOST_HEAPS: c_int = -8;
        // SAFETY: this is its declaration in malloc.h, and it may be called at any time with any numbers.
        #[allow(unsafe_code)]
        unsafe extern "C" {
            safe fn mallopt(option: c_int, value: c_int) -> c_int;
        }
        mallopt(MOST_HEAPS, 1);
    }
}
