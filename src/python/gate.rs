//! The one gate between Python and the kernels: interpreter released, panics and errors turned into
//! exceptions, Ctrl-C heard during long work.

use std::sync::OnceLock;
use std::time::Duration;

use numpy::{Element, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, PyReadwriteArray2};
use pyo3::exceptions::{PyKeyboardInterrupt, PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::base::error::{Cancel, Error, guarded};
use crate::base::scope::Scope;
use crate::base::{pool, simd};

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
    let kernel = || guarded(|| kernel(&cancel));
    let (outcome, signal) = if nanoseconds < SHORT {
        (py.detach(kernel), None)
    } else {
        py.detach(|| watched(kernel, &cancel))?
    };
    if let Some(signal) = signal {
        return Err(signal);
    }
    Ok(outcome?)
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

/// Fills `out` with a law of each of `values`.
pub fn each<T: Element + Copy>(
    out: &mut PyReadwriteArray1<'_, f64>,
    values: &PyReadonlyArray1<'_, T>,
    law: impl Fn(T) -> f64,
) -> PyResult<()> {
    let (mut out, values) = (out.as_array_mut(), values.as_array());
    if out.len() != values.len() {
        return Err(Error::Internal("arrays of different lengths".into()).into());
    }
    out.iter_mut().zip(values).for_each(|(out, &value)| *out = law(value));
    Ok(())
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

/// Runs `$body` with `$map`, the view of a depth map of either precision that may be missing.
macro_rules! each_map {
    ($depth:expr, $map:ident => $body:expr) => {
        match $depth {
            None => {
                let $map = None::<numpy::ndarray::ArrayView2<'_, f32>>;
                $body
            }
            Some($crate::python::gate::Plane::Single(map)) => {
                let $map = Some(map.as_array());
                $body
            }
            Some($crate::python::gate::Plane::Double(map)) => {
                let $map = Some(map.as_array());
                $body
            }
        }
    };
}
pub(crate) use each_map;
