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
    Memory { bytes: usize },
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
        return Ok(value);
    }
    Err(Error::invalid(argument, format!("must be finite, got {value}")))
}

/// The value of a name, of those that an argument may have.
pub fn named<T: Copy>(argument: &'static str, name: &str, all: &[(&str, T)]) -> Result<T, Error> {
    let found = all.iter().find(|(known, _)| *known == name);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let known: Vec<_> = all.iter().map(|(known, _)| *known).collect();
        Error::invalid(argument, format!("must be {}, got {name:?}", known.join(" or ")))
    })
}

/// An array whose rows are not what the Python layer hands over.
pub fn layout() -> Error {
    Error::Internal("rows are not contiguous".into())
}

/// Room for `more` items; a request that cannot be met is an error, not an abort of the interpreter.
#[inline(always)]
pub fn reserve<T>(list: &mut Vec<T>, more: usize) -> Result<(), Error> {
    if list.capacity() - list.len() >= more {
        return Ok(());
    }
    let bytes = list.len().saturating_add(more).saturating_mul(size_of::<T>());
    list.try_reserve(more).map_err(|_| Error::Memory { bytes })
}

pub fn zeroed<T: Clone + num_traits::Zero>(count: usize) -> Result<Vec<T>, Error> {
    let mut buffer = Vec::new();
    reserve(&mut buffer, count)?;
    buffer.resize(count, T::zero());
    Ok(buffer)
}

pub fn collected<T>(items: impl ExactSizeIterator<Item = T>) -> Result<Vec<T>, Error> {
    let mut list = Vec::new();
    reserve(&mut list, items.len())?;
    list.extend(items);
    Ok(list)
}

/// Adds to a list that grows.
pub fn pushed<T>(list: &mut Vec<T>, item: T) -> Result<(), Error> {
    reserve(list, 1)?;
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
