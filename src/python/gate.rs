//! The one gate between Python and the kernels: interpreter released, panics and errors turned into
//! exceptions, Ctrl-C heard during long work.

use std::sync::OnceLock;
use std::time::Duration;

use numpy::{PyArray2, PyReadonlyArray2, PyReadwriteArray2};
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

/// Work below which the calling thread does it alone: to wake others takes longer than they save.
/// Estimates are generous: this is some tenths of a millisecond.
const SMALL: f64 = 1.5e6;

/// How often a long kernel's caller looks for Ctrl-C.
const LOOK: Duration = Duration::from_millis(50);

/// Runs a kernel with the interpreter released. `nanoseconds` is a rough estimate of the work, 0 where
/// nothing is known.
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
    let small = 0.0 < nanoseconds && nanoseconds < SMALL;
    let kernel = || {
        let _alone = small.then(|| Scope { threads: Some(1), ..Scope::now() }.enter());
        guarded(|| kernel(&cancel))
    };
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

#[pyfunction]
pub fn set_threads(n: usize) -> PyResult<()> {
    Ok(pool::set_threads(n)?)
}

#[pyfunction]
pub fn threads() -> PyResult<usize> {
    environment()?;
    Ok(pool::threads())
}

/// Turns the mode on or off in which all vector levels give the same bits.
#[pyfunction]
pub fn set_reproducible(on: bool) {
    simd::set_reproducible(on);
}

#[pyfunction]
pub fn reproducible() -> bool {
    simd::reproducible()
}

/// Sets threads and mode for the calls of this thread alone; returns what they were. None leaves one to
/// the process.
#[pyfunction]
#[pyo3(signature = (threads, reproducible))]
pub fn set_scope(
    threads: Option<usize>,
    reproducible: Option<bool>,
) -> (Option<usize>, Option<bool>) {
    let old = Scope { threads, reproducible }.swap();
    (old.threads, old.reproducible)
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

/// An attribute of an object in Python; names are made strings once.
macro_rules! attribute {
    ($object:expr, $name:ident $(: $type:ty)?) => {
        $object.getattr(pyo3::intern!($object.py(), stringify!($name)))?.extract$(::<$type>)?()?
    };
}
pub(crate) use attribute;

/// Makes a struct of the kernels from an object in Python: fields from the attributes of their names, and those
/// behind the semicolon as they say.
macro_rules! from_attributes {
    ($type:ty { $($own:ident),* $(; $($field:ident: $value:expr),+ $(,)?)? } of $object:ident) => {
        impl<'a, 'py> FromPyObject<'a, 'py> for $type {
            type Error = PyErr;

            fn extract($object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
                Ok(Self {
                    $($own: $crate::python::gate::attribute!($object, $own),)*
                    $($($field: $value,)+)?
                })
            }
        }
    };
}
pub(crate) use from_attributes;

/// Defines an enum of arrays that are told apart by looking at their types. A derived one puts into words
/// why an array is none of the kinds before its own, which takes longer than a small kernel.
macro_rules! arrays {
    (
        $(#[$meta:meta])*
        $visibility:vis enum $name:ident by $borrow:ident, $array:ident as $held:ident {
            $($variant:ident: $element:ty),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        $visibility enum $name<'py> {
            $($variant($held<'py, $element>),)+
        }

        impl<'a, 'py> FromPyObject<'a, 'py> for $name<'py> {
            type Error = PyErr;

            fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
                use numpy::PyArrayMethods;
                $(
                    if let Ok(array) = object.cast::<$array<$element>>() {
                        return Ok(Self::$variant(array.$borrow()?));
                    }
                )+
                Err(pyo3::exceptions::PyTypeError::new_err(concat!(
                    "an array must be one of ",
                    $(stringify!($array), "<", stringify!($element), ">; ",)+ "and is not"
                )))
            }
        }
    };
}
pub(crate) use arrays;

arrays! {
    /// A frame-sized output of either precision, allocated through NumPy by the Python layer.
    pub enum PlaneMut by try_readwrite, PyArray2 as PyReadwriteArray2 { Single: f32, Double: f64 }
}

arrays! {
    /// A frame-sized input of either precision.
    pub enum Plane by try_readonly, PyArray2 as PyReadonlyArray2 { Single: f32, Double: f64 }
}

/// Runs `$body` with what a value of either precision holds.
macro_rules! either {
    ($of:ident $held:pat = $value:expr => $body:expr) => {
        match $value {
            $of::Single($held) => $body,
            $of::Double($held) => $body,
        }
    };
}
pub(crate) use either;

/// Runs `$body` with what two values of one type hold, or fails where their types differ.
macro_rules! alike {
    (
        [$($variant:ident),+]
        $of:ident $first:pat = $one:expr, $with:ident $second:pat = $other:expr => $body:expr,
        else $error:expr $(,)?
    ) => {
        match ($one, $other) {
            $(($of::$variant($first), $with::$variant($second)) => $body,)+
            _ => Err(PyErr::from($error)),
        }
    };
}
pub(crate) use alike;

/// Runs `$body` with `$view`, the mutable view of an output of either precision.
macro_rules! each_precision {
    ($out:expr, $view:ident => $body:expr) => {
        $crate::python::gate::either!(PlaneMut mut array = $out => {
            let $view = array.as_array_mut();
            $body
        })
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
            Some(plane) => $crate::python::gate::either!(Plane map = plane => {
                let $map = Some(map.as_array());
                $body
            }),
        }
    };
}
pub(crate) use each_map;
