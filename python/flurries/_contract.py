"""The contract of the array functions: what may come in, and the one way to refuse the rest."""

import functools
import inspect
import math
import operator
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from importlib import import_module
from typing import Any, TypeAlias, TypeVar, get_args

import numpy as np
import numpy.typing as npt

from flurries import _core

Array: TypeAlias = npt.NDArray[Any]
ArrayLike: TypeAlias = npt.ArrayLike
PathLike: TypeAlias = str | os.PathLike[str]
Float64: TypeAlias = npt.NDArray[np.float64]

_Kind = TypeVar("_Kind")

# More elements are refused before anything is allocated: 2^33 float32 are 32 GiB.
MOST_ELEMENTS = 2**33

# Vectors, lengths and times up to here, and lengths that divide from its inverse on, have finite
# products of three; no geometry of a picture comes near either.
LARGEST = 1e100
SMALLEST = 1e-100

# From so many numbers on a kernel looks at them sooner than NumPy does.
_MANY = 4096
_DOUBLE = float(np.finfo(np.float64).max)


def _came(value: object) -> str:
    """Say what came, in a few words."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and dtype {value.dtype}"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}... ({type(value).__name__})"


def integer(name: str, value: object, *, low: int, high: int) -> int:
    """Return `value` as an int within [low, high]; floats are refused, NumPy integers are not."""
    if isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be an integer, got {value!r}")
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        raise TypeError(f"{name} must be an integer, got {_came(value)}") from None
    if not low <= number <= high:
        raise ValueError(f"{name} must be from {low} to {high}, got {_came(number)}")
    return number


def real(
    name: str, value: object, *, low: float = -math.inf, high: float = math.inf,
    above: float = -math.inf,
) -> float:  # fmt: skip
    """Return `value` as a finite float with low <= value <= high and value > above."""
    if isinstance(value, (str, bytes, bool, np.bool_, complex, np.complexfloating)):
        raise TypeError(f"{name} must be a real number, got {_came(value)}")
    if isinstance(value, np.ndarray) and value.ndim != 0:
        raise TypeError(f"{name} must be one number, got {_came(value)}")
    try:
        number = float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise ValueError(f"{name} must be finite, got {_came(value)}") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name} must be a real number, got {_came(value)}") from None
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    if number <= above:
        raise ValueError(f"{name} must be greater than {above:g}, got {number!r}")
    if not low <= number <= high:
        wanted = f"from {low:g} to {high:g}" if math.isfinite(low) else f"at most {high:g}"
        wanted = wanted if math.isfinite(high) else f"at least {low:g}"
        raise ValueError(f"{name} must be {wanted}, got {number!r}")
    return number


def is_pair(value: object) -> bool:
    """Whether something is two of something, in a row."""
    if isinstance(value, np.ndarray):
        return bool(value.shape == (2,))
    return isinstance(value, (tuple, list)) and len(value) == 2


def flag(name: str, value: object) -> bool:
    """Return a bool; anything else is refused, since a forgotten keyword is often truthy."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise TypeError(f"{name} must be True or False, got {_came(value)}")


def choice(name: str, value: object, options: Any) -> str:
    """Return `value` if it is one of `options`: a sequence, or the words of a Literal."""
    words = get_args(options) or options
    if isinstance(value, str) and value in words:
        return value
    refusal = f"{name} must be one of {', '.join(map(repr, words))}, got {_came(value)}"
    if not isinstance(value, str):
        raise TypeError(refusal)
    raise ValueError(refusal + suggestion(value, words))


def rate_of(fps: object) -> float:
    """Return frames per second, from one in a quarter of an hour to a million."""
    return real("fps", fps, low=1e-3, high=1e6)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return "; did you mean 'heavy'?" for "hevy", or nothing where no known word is like it."""
    near = get_close_matches(word, list(known), 1)
    return f"; did you mean {near[0]!r}?" if near else ""


def suggesting(kind: type[_Kind]) -> type[_Kind]:
    """Let a class refuse an argument that it does not know with the nearest one that it knows."""
    plain: Any = kind.__init__
    known = tuple(inspect.signature(plain).parameters)[1:]
    by_name = inspect.getfullargspec(plain).args == ["self"]

    @functools.wraps(plain)
    def init(self: Any, *others: Any, **given: Any) -> None:
        if others and by_name:
            raise TypeError(f"{kind.__name__} takes its fields by name")
        for name in given:
            if name not in known:
                raise TypeError(f"{kind.__name__} has no {name!r}{suggestion(name, known)}")
        plain(self, *others, **given)

    kind.__init__ = init  # type: ignore[method-assign]
    return kind


def shape_of(name: str, value: object) -> tuple[int, int]:
    """Return (H, W) of a frame, both at least 1 and their product within reason."""
    if not is_pair(value):
        raise TypeError(f"{name} must be (H, W), got {_came(value)}")
    assert isinstance(value, (Sequence, np.ndarray))
    height = integer(f"{name}[0]", value[0], low=1, high=2**31 - 1)
    width = integer(f"{name}[1]", value[1], low=1, high=2**31 - 1)
    if height * width > MOST_ELEMENTS:
        raise ValueError(f"{name} must hold at most {MOST_ELEMENTS} pixels, got {height} x {width}")
    return height, width


# A texture's tiles where nobody says: their pixels, and those that neighbours share.
TILE, OVERLAP = 64, 10


def tile_of(tile: object, overlap: object) -> tuple[tuple[int, int], int]:
    """Return the tile as (rows, cols) and the overlap, 0 <= overlap < tile."""
    if isinstance(tile, (tuple, list)):
        size = shape_of("tile", tile)
    else:
        size = (integer("tile", tile, low=1, high=2**15),) * 2
    if max(size) > 2**15:
        raise ValueError(f"tile must be at most {2**15} px, got {_came(tile)}")
    pixels = integer("overlap", overlap, low=0, high=2**15)
    if pixels >= min(size):
        raise ValueError(f"overlap must be less than the tile ({min(size)} px), got {pixels}")
    return size, pixels


def int64(name: str, value: object) -> int:
    return integer(name, value, low=-(2**63), high=2**63 - 1)


def seed_of(seed: object) -> int:
    return int64("seed", seed)


def uniforms(seed: int, stream: int, count: int) -> Float64:
    """Return numbers in [0, 1) that belong to a seed and a stream; the first of more are these."""
    numbers = np.empty(count)
    _core.uniform(numbers, seed, stream)
    return numbers


def float_dtype(
    dtype: npt.DTypeLike, wanted: tuple[str, str] = ("float32", "float64")
) -> np.dtype[Any]:
    """Return one of two dtypes, those that kernels generate."""
    with suppress(TypeError):
        found: np.dtype[Any] = np.dtype(dtype).newbyteorder("=")
        if dtype is not None and found.name in wanted:
            return found
    raise TypeError(f"dtype must be {' or '.join(wanted)}, got {_came(dtype)}")


def rectangular(name: str, value: object) -> Array:
    """Return `value` as an array of whatever it holds; refuses lists whose rows differ."""
    try:
        return np.asarray(value)
    except ValueError:
        words = f"{name} must be a rectangular array of numbers, got {_came(value)}"
        raise ValueError(words) from None


def library(name: str, need: str) -> Any:
    """Return a module that an extra brings, or say what needs it and how it is installed."""
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(f"{need} ({error})", name=name) from error


@contextmanager
def naming(
    words: str, *kinds: type[Exception], then: type[Exception] | None = None
) -> Iterator[None]:
    """Put words, such as a file's name, before what errors of some kinds say."""
    try:
        yield
    except kinds as error:
        raise (then or type(error))(f"{words}: {error}") from None


def mapping(name: str, value: object) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise TypeError(f"{name} must be a mapping such as a dict, got {_came(value)}")
    return value


def _numeric(name: str, value: object) -> Array:
    """Return `value` as an array of real numbers, not yet of a given dtype or layout."""
    array = rectangular(name, value)
    if array.dtype.kind not in "iuf":
        raise TypeError(f"{name} must be an array of real numbers, got {_came(value)}")
    return array


def table(name: str, value: object, *, ndim: int | None = 2, finite: bool = True) -> Float64:
    """Return a float64, C-contiguous, aligned, finite array: spectral tables and geometry."""
    array = aligned(_numeric(name, value), np.float64)
    if ndim is not None and array.ndim != ndim:
        raise ValueError(f"{name} must have {ndim} dimensions, got {_came(value)}")
    if finite and not _within(array, math.inf):
        require(name, array, np.isfinite(array), "finite")
    return array


def rows_of(name: str, value: object, columns: int) -> Float64:
    """Return (n, columns) float64, such as places."""
    array = table(name, value)
    if array.shape[1] != columns:
        raise ValueError(f"{name} must have shape (n, {columns}), got {array.shape}")
    return array


def each_of(name: str, value: Any, count: int, row: tuple[int, ...] = ()) -> Float64:
    """Return a row for all, (1, *row), or one for each, (count, *row)."""
    array, shape = table(name, value, ndim=None), np.shape(value)
    if shape not in (row, (count, *row)):
        wanted = f"{row or 'one number'} or {(count, *row)}"
        raise ValueError(f"{name} must be {wanted}, got an array of shape {shape}")
    return array.reshape(-1, *row)


def require(name: str, array: Array, good: Array, wanted: str) -> None:
    """Refuse an array that is not `good` everywhere, by its first number that is not."""
    if not good.all():
        place = [int(index) for index in np.unravel_index(int(good.argmin()), good.shape)]
        raise ValueError(f"{name} must be {wanted}, got {array[tuple(place)]:g} at {place}")


def shares(name: str, array: Array) -> None:
    """Refuse float32 or float64 outside 0 to 1; NaN is outside, too."""
    if not _core.all_within(array.ravel(), 0.0, 1.0):
        require(name, array, (array >= 0.0) & (array <= 1.0), "from 0 to 1 everywhere")


def finite(name: str, array: Array) -> None:
    """Refuse float32 or float64 that hold NaN or infinity."""
    limits = np.finfo(array.dtype)
    if not _core.all_within(array.ravel(), float(limits.min), float(limits.max)):
        require(name, array, np.isfinite(array), "finite")


def moderate(name: str, array: Float64) -> Float64:
    """Refuse magnitudes whose products could overflow: beyond `LARGEST` nothing has a meaning."""
    if array.size and max(array.max(), -array.min()) > LARGEST:
        worst = array.flat[np.abs(array).argmax()]
        raise ValueError(f"{name} must not exceed {LARGEST:g} in magnitude, got {worst:g}")
    return array


def bounded(name: str, value: object) -> Float64:
    """Return an array of any shape, checked as by `moderate` of `table`, in one look."""
    array = table(name, value, ndim=None, finite=False)
    if not _within(array, LARGEST):
        return moderate(name, table(name, array, ndim=None))
    return array


def _within(array: Float64, most: float) -> bool:
    """Say whether all numbers are finite and none is larger than `most`; NaN is, in its way."""
    if array.size < _MANY:
        size = np.abs(array).max(initial=0.0)
        return bool(size <= most and size < math.inf)
    return _core.all_within(array.ravel(), -min(most, _DOUBLE), min(most, _DOUBLE))


def vector(name: str, value: object, length: int) -> Float64:
    """Return a finite float64 vector of the given length, of at most `LARGEST`."""
    array = table(name, value, ndim=None, finite=False)
    if array.shape != (length,):
        raise ValueError(f"{name} must be {length} numbers, got {_came(value)}")
    return bounded(name, array)


def pixels(name: str, value: object, *, ndim: int) -> tuple[Array, np.dtype[Any]]:
    """Return pixels as C-contiguous float32 or float64, and the dtype that the result keeps."""
    # The dtype rule of all functions that transform float pixels: float32 and float64 stay; float16
    # is computed in float32 and comes back as float16; lists and integers become float64.
    array = _numeric(name, value)
    if array.ndim != ndim:
        raise ValueError(f"{name} must have {ndim} dimensions, got {_came(value)}")
    if 0 in array.shape:
        raise ValueError(f"{name} must not be empty, got {_came(value)}")
    kept = np.dtype(np.float64) if array.dtype.kind in "iu" else array.dtype.newbyteorder("=")
    if kept.itemsize > 8:
        raise TypeError(f"{name} must be float16, float32 or float64, got {_came(value)}")
    return aligned(array, np.float32 if kept == np.float16 else kept), kept


def numbers(name: str, value: object, others: str = "", *more: str) -> Array:
    """Return a picture's numbers in the processor's order of bytes; `others` may come, too."""
    array = rectangular(name, value)
    if array.dtype.name not in ("uint8", "uint16", "float16", "float32", "float64", *more):
        came = f"{type(value).__name__} of dtype {array.dtype}"
        raise TypeError(f"{name} must be {others}uint8, uint16 or float, got {came}")
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def plane_of(name: str, value: object, shape: tuple[int, int]) -> Array:
    """Return float pixels of a picture's shape, (H, W)."""
    array, _ = pixels(name, value, ndim=2)
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
    return array


def depths(name: str, array: Array) -> Array:
    """Return depths, each greater than 0; infinity is the sky, and NaN is refused."""
    wanted = "greater than 0 everywhere, and infinity where nothing stands"
    require(name, array, array > 0.0, wanted)
    return array


def sealed(array: Array) -> Array:
    """Return the array, read-only."""
    array.flags.writeable = False
    return array


def aligned(array: Array, dtype: npt.DTypeLike) -> Array:
    """Return the array C-contiguous, native and aligned, copied only where it has to be."""
    result = np.ascontiguousarray(array, dtype=dtype)
    return result if result.flags.aligned else result.copy()


def output(
    out: Array | None, shape: tuple[int, ...], dtype: np.dtype[Any], *inputs: Array
) -> Array:
    """Return the array to write into: a new one, or `out` if it fits and touches no input."""
    if out is None:
        return np.empty(shape, dtype)
    if not isinstance(out, np.ndarray):
        raise TypeError(f"out must be an array, got {_came(out)}")
    if out.dtype != dtype or not out.dtype.isnative:
        raise TypeError(f"out must have dtype {dtype}, got {_came(out)}")
    if out.shape != shape:
        raise ValueError(f"out must have shape {shape}, got {_came(out)}")
    if not (out.flags.c_contiguous and out.flags.aligned):
        raise ValueError(
            f"out must be C-contiguous and aligned, got {_came(out)} with strides {out.strides}"
        )
    if not out.flags.writeable:
        raise ValueError("out must be writeable, got a read-only array")
    if any(np.may_share_memory(out, given) for given in inputs):
        raise ValueError("out must not overlap an input array")
    return out


def filled(result: Array, working: np.dtype[Any], fill: Callable[[Array], None]) -> Array:
    """Let `fill` write, in its own precision where the result has another."""
    wide = result if result.dtype == working else np.empty(result.shape, working)
    fill(wide)
    if wide is not result:
        result[...] = wide
    return result
