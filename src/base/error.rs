//! What a caller can do wrong, and the few things that can go wrong without him.

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};

/// The one error type of the kernels. The Python gate turns each variant into its exception.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Error {
    /// An argument outside its range, or in disagreement with another (ValueError).
    Invalid {
        /// The argument's public name.
        argument: &'static str,
        /// What came and what is wanted.
        message: String,
    },
    /// Work space could not be allocated (MemoryError).
    Memory {
        /// How much was asked for.
        bytes: usize,
    },
    /// The caller asked to stop; the output is unfinished (KeyboardInterrupt).
    Cancelled,
    /// A defect of ours (InternalError).
    Internal(String),
}

impl Error {
    /// An argument that is out of range, or does not fit another.
    pub fn invalid(argument: &'static str, message: impl Into<String>) -> Self {
        Self::Invalid { argument, message: message.into() }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Invalid { argument, message } => write!(f, "{argument}: {message}"),
            Self::Memory { bytes } => write!(f, "could not allocate {bytes} bytes of work space"),
            Self::Cancelled => write!(f, "cancelled"),
            Self::Internal(message) => write!(f, "internal error: {message}"),
        }
    }
}

impl std::error::Error for Error {}

/// Runs a kernel; a panic in it, on whatever thread of the pool, is a defect of ours and not the end of
/// the caller.
pub fn guarded<R>(kernel: impl FnOnce() -> Result<R, Error>) -> Result<R, Error> {
    catch_unwind(AssertUnwindSafe(kernel)).unwrap_or_else(|panic| {
        let words = panic
            .downcast_ref::<&str>()
            .copied()
            .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
            .unwrap_or("no message");
        Err(Error::Internal(format!("a kernel panicked: {words}")))
    })
}

/// Refuses a number that is not finite.
pub fn finite(argument: &'static str, value: f64) -> Result<f64, Error> {
    if value.is_finite() {
        Ok(value)
    } else {
        Err(Error::invalid(argument, format!("must be finite, got {value}")))
    }
}

/// A zeroed work buffer; a request that cannot be met is an error, not an abort of the interpreter.
pub fn zeroed<T: Clone + num_traits::Zero>(count: usize) -> Result<Vec<T>, Error> {
    let mut buffer = Vec::new();
    buffer
        .try_reserve_exact(count)
        .map_err(|_| Error::Memory { bytes: count.saturating_mul(size_of::<T>()) })?;
    buffer.resize(count, T::zero());
    Ok(buffer)
}

/// The items of an iterator in a vector, memory asked for as in [`zeroed`].
pub fn collected<T>(items: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>, Error> {
    let mut list = Vec::new();
    list.try_reserve_exact(items.len())
        .map_err(|_| Error::Memory { bytes: items.len().saturating_mul(size_of::<T>()) })?;
    list.extend(items);
    Ok(list)
}

/// Adds to a list that grows, memory asked for as in [`zeroed`].
pub fn pushed<T>(list: &mut Vec<T>, item: T) -> Result<(), Error> {
    list.try_reserve(1)
        .map_err(|_| Error::Memory { bytes: 2 * list.len().saturating_mul(size_of::<T>()) })?;
    list.push(item);
    Ok(())
}

/// Refuses what would need so many bytes inside a library that aborts without them.
pub fn spare(bytes: usize) -> Result<(), Error> {
    Vec::<u8>::new().try_reserve_exact(bytes).map_err(|_| Error::Memory { bytes })
}

/// A flag that long kernels look at between stripes of work, so that Ctrl-C ends them.
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// A flag that is not raised.
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Asks the kernel to stop at its next look.
    pub fn raise(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// `Err(Cancelled)` once the flag is raised.
    pub fn check(&self) -> Result<(), Error> {
        if self.0.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }
}
