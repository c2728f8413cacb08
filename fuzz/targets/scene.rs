//! A scene file of bytes at random.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| tenter_fuzz::scene(bytes));
