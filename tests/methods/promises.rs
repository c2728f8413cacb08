//! What every method promises.
