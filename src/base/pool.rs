//! The thread pool: made at first use, one per thread count, and safe across `fork`.
//!
//! rayon's global pool hangs in a forked child once the parent has used it, because the child
//! inherits the pool's memory without its threads. Here a pool carries the id of the process that
//! made it; a child finds a stranger's pool and makes its own. The parent's is forgotten, not
//! dropped: dropping would wait for threads that do not exist. The slots are plain atomics, since a
//! lock could be held by another thread at the moment of the fork and would stay held forever.

#![expect(
    unsafe_code,
    reason = "reads pools that are leaked through atomic pointers, since a lock could be held at a fork"
)]

use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, OnceLock};

use ndarray::{ArrayView, ArrayViewMut, Axis, RemoveAxis};

use crate::base::error::{Error, collected, layout};
use crate::base::scope::Scope;

/// The most threads that may be asked for.
pub const MOST_THREADS: usize = 256;

/// What a slot holds, made before the slot is taken, so that a fork elsewhere meanwhile leaves it open.
pub fn kept<T, E>(slot: &OnceLock<T>, make: impl FnOnce() -> Result<T, E>) -> Result<&T, E> {
    slot.get().map_or_else(|| make().map(|made| slot.get_or_init(|| made)), Ok)
}

struct Slot {
    process: u32,
    pool: rayon::ThreadPool,
}

// One slot per thread count, so that changing the count back and forth makes no new threads.
static SLOTS: [AtomicPtr<Slot>; MOST_THREADS + 1] =
    [const { AtomicPtr::new(std::ptr::null_mut()) }; MOST_THREADS + 1];

// 0 = not yet decided.
static THREADS: AtomicUsize = AtomicUsize::new(0);

/// Threads that kernels use: what the call asks for, else `set_threads`, else FLURRIES_NUM_THREADS,
/// else all cores.
pub fn threads() -> usize {
    if let Some(count) = Scope::now().threads {
        return count;
    }
    match THREADS.load(Ordering::Relaxed) {
        0 => {
            // The gate has refused what is no number.
            let count = environment().ok().flatten().unwrap_or_else(cores);
            THREADS.store(count, Ordering::Relaxed);
            count
        }
        count => count,
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS)
}

/// What FLURRIES_NUM_THREADS says; None where it is not set or empty.
pub fn environment() -> Result<Option<usize>, Error> {
    let value = std::env::var("FLURRIES_NUM_THREADS").unwrap_or_default();
    let text = value.trim();
    match text.parse::<usize>() {
        _ if text.is_empty() => Ok(None),
        Ok(count) if (1..=MOST_THREADS).contains(&count) => Ok(Some(count)),
        _ => Err(Error::invalid(
            "FLURRIES_NUM_THREADS",
            format!("must be 1 to {MOST_THREADS}, got {text:?}"),
        )),
    }
}

/// Sets the number of threads; results do not depend on it.
pub fn set_threads(count: usize) -> Result<(), Error> {
    if !(1..=MOST_THREADS).contains(&count) {
        return Err(Error::invalid("n", format!("must be 1 to {MOST_THREADS}, got {count}")));
    }
    THREADS.store(count, Ordering::Relaxed);
    Ok(())
}

fn pool(count: usize) -> Result<&'static rayon::ThreadPool, Error> {
    let slot = &SLOTS[count];
    let process = std::process::id();
    let seen = slot.load(Ordering::Acquire);
    // SAFETY: a slot only ever holds null or a leaked box, which nothing frees or mutates.
    let made = unsafe { seen.as_ref() }.filter(|made| made.process == process);
    if let Some(made) = made {
        return Ok(&made.pool);
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .thread_name(|i| format!("flurries-{i}"))
        .build()
        .map_err(|error| Error::Internal(format!("no thread pool: {error}")))?;
    let fresh = Box::into_raw(Box::new(Slot { process, pool }));
    match slot.compare_exchange(seen, fresh, Ordering::AcqRel, Ordering::Acquire) {
        // SAFETY: just leaked above, and nothing frees it.
        Ok(_) => Ok(&unsafe { &*fresh }.pool),
        Err(winner) => {
            // SAFETY: ours was never published, so this is its only owner.
            drop(unsafe { Box::from_raw(fresh) });
            // SAFETY: only a thread of this process can have won, with a leaked box.
            Ok(&unsafe { &*winner }.pool)
        }
    }
}

/// Does `work` on every item, in the caller and on the pool, which the caller need not wait for to begin.
/// With one thread or one item it is the caller alone.
///
/// Items carry what they write (rows of the output), so bits cannot depend on the thread count. They
/// come as an iterator, since a list of all rows may be more than the memory that is left.
pub fn for_each<T: Send>(
    items: impl IntoIterator<Item = T, IntoIter: ExactSizeIterator>,
    work: impl Fn(T) -> Result<(), Error> + Sync + Send,
) -> Result<(), Error> {
    let count = threads();
    let mut items = items.into_iter();
    if count == 1 || items.len() <= 1 {
        return items.try_for_each(work);
    }
    let others = items.len().min(count) - 1;
    let (queue, failed) = (Mutex::new(collected(items)?.into_iter()), OnceLock::new());
    // Threads of the pool are everybody's: each item is worked on as its caller asks.
    let asked = Scope::now();
    let worker = || {
        let _entered = asked.enter();
        let next = || queue.lock().ok()?.next();
        while failed.get().is_none()
            && let Some(item) = next()
        {
            work(item).unwrap_or_else(|error| drop(failed.set(error)));
        }
    };
    pool(count - 1)?.in_place_scope(|scope| {
        (0..others).for_each(|_| scope.spawn(|_| worker()));
        worker();
    });
    failed.into_inner().map_or(Ok(()), Err)
}

/// `length` cut into at most `parts` runs of nearly equal length, none empty.
pub fn split(length: usize, parts: usize) -> Vec<std::ops::Range<usize>> {
    let parts = parts.clamp(1, length.max(1));
    (0..parts)
        .map(|i| length * i / parts..length * (i + 1) / parts)
        .filter(|run| !run.is_empty())
        .collect()
}

/// The rows of a picture in at most `parts` runs, each with its part.
pub fn rows<A, D: RemoveAxis>(
    mut out: ArrayViewMut<'_, A, D>,
    parts: usize,
) -> Vec<(std::ops::Range<usize>, ArrayViewMut<'_, A, D>)> {
    let mut all = Vec::new();
    for run in split(out.len_of(Axis(0)), parts) {
        let (part, rest) = out.split_at(Axis(0), run.len());
        all.push((run, part));
        out = rest;
    }
    all
}

/// A row of a picture.
pub fn line<A, D: RemoveAxis>(picture: ArrayView<'_, A, D>, row: usize) -> Result<&[A], Error> {
    picture.index_axis_move(Axis(0), row).to_slice().ok_or_else(layout)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::error::guarded;

    #[test]
    fn a_panic_of_a_worker_is_an_error_and_the_pool_works_on() {
        let attempt = |bad: usize| {
            guarded(|| {
                for_each(0..4, |i| {
                    assert!(i != bad, "item {bad}");
                    Ok(())
                })
            })
        };
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let wanted = Error::Internal("a kernel panicked: item 2".into());
                    assert_eq!(attempt(2), Err(wanted));
                    assert_eq!(attempt(4), Ok(()));
                });
            }
        });
    }
}
