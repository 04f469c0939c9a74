"""What comes into arguments: layouts of arrays, what is no array, and hostile values by type."""

import math
import operator
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

DTYPES = ("u1", "u2", "i4", "i8", "f2", "f4", "f8", "?")


class Subclass(np.ndarray):
    """One that is nothing but another type."""


def misaligned(array: np.ndarray) -> np.ndarray:
    view = np.empty(array.nbytes + 1, np.uint8)[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    return view


def strided(array: np.ndarray) -> np.ndarray:
    wide = np.zeros(tuple(2 * n for n in array.shape), array.dtype)
    every_other = wide[tuple(slice(None, None, 2) for _ in array.shape)]
    every_other[...] = array
    return every_other


def read_only(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def backwards(array: np.ndarray) -> np.ndarray:
    turned = tuple(slice(None, None, -1) for _ in array.shape)
    return array[turned].copy()[turned]


# The same numbers in other memory.
LAYOUTS: dict[str, Callable[[np.ndarray], Any]] = {
    "Fortran": np.asfortranarray, "transposed": lambda array: np.ascontiguousarray(array.T).T,
    "backwards": backwards, "strided": strided, "read-only": read_only, "misaligned": misaligned,
    "big-endian": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "subclass": lambda array: array.copy().view(Subclass),
    "masked": lambda array: np.ma.masked_array(array, np.zeros(array.shape, bool)),
}  # fmt: skip


def no_arrays(array: np.ndarray) -> dict[str, Any]:
    """Return what an array of numbers of this shape is not."""
    shape = array.shape
    return {
        "complex": array + 1j, "object": np.full(shape, object()), "text": np.full(shape, "1"),
        "dates": np.full(shape, 3, "M8[s]"), "records": np.zeros(shape, [("a", float)]),
        "None": np.full(shape, None), "bool": array > 0.5, "a word": "abc",
        "ragged": [[1.0, 2.0], [3.0]], "a mapping": {"a": 1.0}, "an object": object(),
        "too deep": array[(None,) * 5], "empty": array[:0], "NaN": np.full(shape, np.nan),
        "one NaN": np.where(np.arange(array.size).reshape(shape) == array.size - 1, np.nan, array),
    }  # fmt: skip


# For each argument that is no array. Whether one may be taken, its type says: `may_be`.
HOSTILE: tuple[Any, ...] = (
    math.nan, math.inf, -math.inf, 0, -1, 0.5, 1.0, 2**31 - 1, 2**31 + 1, 2**63, -(2**63) - 1,
    2**80, 10**400, 1e308, -1e308, 5e-324, "", "x" * 100_000, "\0", "nan", "none", b"1", None, True,
    [], {}, (), 1j, object(), type, np.float64("nan"), np.float16(7.5), np.array(3), np.int8(-7),
    np.array([]), np.array([3.0]), np.array([1.0, 2.0]), (math.nan, math.nan), (math.inf, 1.0),
    (1e308, -1e308), (0, 0), (0, 8), (8, 0), (2**40, 2**40), (2**63, 1), (-1, 5), (8.0, 8.0),
    (8,), (1,) * 7, ("a", "b"), ["a", None], [1.0] * 1000, range(3), {"a": 1},
)  # fmt: skip

# Sizes below and beyond what fits: for one number, and for the two of a shape.
SIZES = (2**12, 2**20, 2**24, 2**28, 2**31 - 1, 2**40, 2**62)
SHAPES = (
    (1500, 1500), (3000, 3000), (2**20, 3), (3, 2**20), (2**14, 2**14), (2**16, 2**16),
    (2**31 - 1, 1), (1, 2**31 - 1), (2**31 - 1, 2**31 - 1), (2**40, 2**40), (2**63, 1),
)  # fmt: skip

# Out of range wherever an argument has this name.
OUT_OF_RANGE: dict[str, tuple[Any, ...]] = {
    "shape": ((0, 8), (8, 0), (-1, 8), (8,), (8, 8, 8), (2**40, 2**40), (2**31 - 1,) * 2,
              (8.0, 8.0), 8),
    "seed": (2**63, -(2**63) - 1, 1.0, 1.5, "1", [1]),
    "wavelength_max": (0.0, -32.0),
    "wavelengths": ((1.9, 32.0), (0.0, 32.0), (-4.0, 32.0), (8.0, 8.0), (9.0, 8.0), (4.0,), 4.0,
                    (4.0, 8.0, 16.0)),
    "loop": (0.0,),
    "soft_from": (-0.1, 0.6),
    "shutter": (-1.0, -0.5),
    "spread": (0.0, -3.0),
    "overlap": (-1, 1.5),
    "tile": (0, -1, 64.0),
    "near": (0.0, -1.0),
}  # fmt: skip


def _is_integer(value: Any) -> bool:
    try:
        operator.index(value)
    except TypeError:
        return False
    return not isinstance(value, (bool, np.bool_))


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.ndim == 0 and value.dtype.kind in "iuf"
    if not isinstance(value, (int, float, np.integer, np.floating)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _is_row(value: Any, of: Callable[[Any], bool], length: int | None) -> bool:
    if isinstance(value, (str, bytes)) or not isinstance(value, (Sequence, np.ndarray)):
        return False
    if np.ndim(value) != 1 or (length is not None and len(value) != length):
        return False
    return all(of(one) for one in value)


def parts(kind: str) -> list[str]:
    found, depth = [""], 0
    for letter in kind:
        depth += (letter == "[") - (letter == "]")
        if letter == "|" and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return [part.strip() for part in found]


# What may be of a type, as signatures spell it.
TYPES: dict[str, Callable[[Any], bool]] = {
    "None": lambda value: value is None,
    "bool": lambda value: isinstance(value, (bool, np.bool_)),
    "int": _is_integer,
    **dict.fromkeys(("float", "Number", "Fraction"), _is_number),
    "str": lambda value: isinstance(value, str),
    "tuple[int, int]": lambda value: _is_row(value, _is_integer, 2),
    "tuple[float, float]": lambda value: _is_row(value, _is_number, 2),
    "tuple[float, float, float]": lambda value: _is_row(value, _is_number, 3),
    "Vector": lambda value: _is_row(value, _is_number, None),
    "Range": lambda value: _is_number(value) or _is_row(value, _is_number, 2),
    # A number is as good as its type.
    "npt.DTypeLike": lambda value: isinstance(value, np.float64),
    # Classes, of which none is among the hostile values.
    **dict.fromkeys(
        ("Camera", "Scene", "Budget", "Ground", "Lamp", "Lens", "Light", "Output", "Sun", "Texture",
         "Wind"), lambda value: isinstance(value, dict),
    ),
    # Of what is left, sequences and such, only the plainest is known.
    "Any": lambda value: True, "Depth": lambda value: True,
}  # fmt: skip


def may_be(kind: str, value: Any) -> bool:
    kind = kind.removeprefix("InitVar[").removesuffix("]") if "InitVar" in kind else kind

    def one(part: str) -> bool:
        if part.startswith("Mapping["):
            return isinstance(value, dict)
        return TYPES.get(part, lambda v: not isinstance(v, (bool, complex)))(value)

    return any(one(part) for part in parts(kind))
