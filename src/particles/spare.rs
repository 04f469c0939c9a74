//! Buffers of sorted flakes, kept from frame to frame: fresh pages cost a fifth of a frame of flakes.
//!
//! The lock is only ever tried: after a fork it may be held for ever by a thread that no longer exists,
//! and then buffers are made anew.

use std::sync::Mutex;

use super::bins::Bins;

/// What is kept at most, bytes.
const MOST: usize = 32 << 20;

static SPARE: Mutex<Vec<Bins>> = Mutex::new(Vec::new());

/// Buffers for `count` runs.
pub fn take(count: usize) -> Vec<Bins> {
    let mut runs = SPARE.try_lock().map(|mut kept| std::mem::take(&mut *kept)).unwrap_or_default();
    runs.resize_with(count, Bins::default);
    runs
}

/// Gives them back; what is too much is let go.
pub fn keep(mut runs: Vec<Bins>) {
    let mut bytes = 0;
    runs.retain(|bins| {
        bytes += bins.bytes();
        bytes <= MOST
    });
    if let Ok(mut kept) = SPARE.try_lock() {
        *kept = runs;
    }
}
