//! The one gate between Python and the kernels: interpreter released, panics and errors turned into
//! exceptions, Ctrl-C heard during long work.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use std::time::Duration;

use numpy::{PyReadonlyArray2, PyReadwriteArray2};
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::error::{Cancel, Error};
use crate::scope::Scope;
use crate::{pool, simd};

pyo3::create_exception!(
    flurries,
    InternalError,
    PyRuntimeError,
    "A defect of flurries itself: a kernel failed where its arguments were right. Please report it."
);

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Invalid { .. } => PyValueError::new_err(error.to_string()),
            Error::Memory { .. } => PyMemoryError::new_err(error.to_string()),
            Error::Cancelled => PyKeyboardInterrupt::new_err(()),
            Error::Internal(_) => InternalError::new_err(error.to_string()),
        }
    }
}

/// Work (in rough nanoseconds) below which a kernel runs in the calling thread. Signals wait for it.
const SHORT: f64 = 1e8;

/// How often a long kernel's caller looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs a kernel with the interpreter released. `nanoseconds` is a rough estimate of the work.
///
/// Python handles signals on its main thread only, which is the one waiting here; so a long kernel
/// moves to a thread of its own while this one wakes now and then to look.
pub fn run<R: Send>(
    py: Python<'_>,
    nanoseconds: f64,
    kernel: impl FnOnce(&Cancel) -> Result<R, Error> + Send,
) -> PyResult<R> {
    environment()?;
    let cancel = Cancel::new();
    let guarded = || catch_unwind(AssertUnwindSafe(|| kernel(&cancel)));
    let (outcome, signal) = if nanoseconds < SHORT {
        (py.detach(guarded), None)
    } else {
        py.detach(|| watched(guarded, &cancel))?
    };
    if let Some(signal) = signal {
        return Err(signal);
    }
    match outcome {
        Ok(result) => Ok(result?),
        Err(panic) => Err(InternalError::new_err(format!("a kernel panicked: {}", words(&*panic)))),
    }
}

/// Refuses settings of the environment that cannot be followed, by their names.
pub fn environment() -> Result<(), Error> {
    static CHECKED: OnceLock<Result<(), Error>> = OnceLock::new();
    let check = || pool::environment().and(simd::environment().map(|_| ()));
    CHECKED.get_or_init(check).clone()
}

/// Of the thread of a long kernel, bytes; what the standard library takes by itself.
const STACK: usize = 2 << 20;

fn watched<R: Send>(
    kernel: impl FnOnce() -> R + Send,
    cancel: &Cancel,
) -> Result<(R, Option<PyErr>), Error> {
    std::thread::scope(|scope| {
        let (waiter, asked) = (std::thread::current(), Scope::now());
        let worker = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || {
            let _entered = asked.enter();
            let result = kernel();
            waiter.unpark();
            result
        });
        let worker = worker.map_err(|_| Error::Memory { bytes: STACK })?;
        let mut signal = None;
        while !worker.is_finished() {
            std::thread::park_timeout(LOOK);
            if signal.is_none() {
                signal = Python::attach(|py| py.check_signals()).err();
                if signal.is_some() {
                    cancel.raise();
                }
            }
        }
        match worker.join() {
            Ok(result) => Ok((result, signal)),
            // `kernel` catches its own panics, so this is out of reach; never lose one all the same.
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

fn words(panic: &(dyn std::any::Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no message")
}

/// A frame-sized output of either precision, allocated through NumPy by the Python layer.
#[derive(FromPyObject)]
pub enum PlaneMut<'py> {
    /// float32
    Single(PyReadwriteArray2<'py, f32>),
    /// float64
    Double(PyReadwriteArray2<'py, f64>),
}

/// A frame-sized input of either precision.
#[derive(FromPyObject)]
pub enum Plane<'py> {
    /// float32
    Single(PyReadonlyArray2<'py, f32>),
    /// float64
    Double(PyReadonlyArray2<'py, f64>),
}

/// Runs `$body` with `$view`, the mutable view of an output of either precision.
macro_rules! each_precision {
    ($out:expr, $view:ident => $body:expr) => {
        match $out {
            $crate::python::gate::PlaneMut::Single(mut array) => {
                let $view = array.as_array_mut();
                $body
            }
            $crate::python::gate::PlaneMut::Double(mut array) => {
                let $view = array.as_array_mut();
                $body
            }
        }
    };
}
pub(crate) use each_precision;
