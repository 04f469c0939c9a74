"""Arrays of every layout and dtype, to every public function: the right answer or a refusal."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
from public_calls import CALLS, ELSEWHERE, MODULES, NUMBERS, Call

# Functions that take each number alone, whatever the shape.
EACH_ALONE = {"gas.phase"}
DTYPES = ("u1", "u2", "i4", "i8", "f2", "f4", "f8", "?")


class Sub(np.ndarray):
    """A subclass without manners of its own."""


def misaligned(array: np.ndarray) -> np.ndarray:
    raw = np.empty(array.nbytes + 1, np.uint8)[1:]
    moved = raw.view(array.dtype).reshape(array.shape)
    moved[...] = array
    assert array.dtype.itemsize == 1 or not moved.flags.aligned
    return moved


def strided(array: np.ndarray) -> np.ndarray:
    wide = np.zeros([2 * n for n in array.shape], array.dtype)
    wide[tuple(slice(None, None, 2) for _ in array.shape)] = array
    return wide[tuple(slice(None, None, 2) for _ in array.shape)]


def backwards(array: np.ndarray) -> np.ndarray:
    turned = tuple(slice(None, None, -1) for _ in array.shape)
    return np.ascontiguousarray(array[turned])[turned]


def read_only(array: np.ndarray) -> np.ndarray:
    kept = array.copy()
    kept.flags.writeable = False
    return kept


LAYOUTS: dict[str, Callable[[np.ndarray], Any]] = {
    "C": np.array,
    "Fortran": np.asfortranarray,
    "transposed": lambda array: np.ascontiguousarray(array.T).T,
    "backwards": backwards,
    "strided": strided,
    "read-only": read_only,
    "misaligned": misaligned,
    "big-endian": lambda array: array.astype(array.dtype.newbyteorder(">")),
    "subclass": lambda array: array.copy().view(Sub),
    "list": lambda array: array.tolist(),
    "masked": lambda array: np.ma.masked_array(array, np.zeros(array.shape, bool)),
}


def converted(array: np.ndarray, dtype: str) -> np.ndarray:
    if dtype == "?":
        return np.asarray(array > 0.5)
    if np.dtype(dtype).kind == "f":
        return np.asarray(array).astype(dtype)
    return np.asarray(np.rint(np.abs(array))).astype(dtype)


def outcome(call: Call, **changed: Any) -> list[np.ndarray] | Exception:
    try:
        return call(**changed)
    except (TypeError, ValueError) as error:
        return error


def alike(got: list[np.ndarray], want: list[np.ndarray], coarse: float) -> bool:
    return len(got) == len(want) and all(
        a.shape == b.shape
        and np.allclose(
            a.astype(np.complex128), b.astype(np.complex128), coarse, coarse, equal_nan=True
        )
        for a, b in zip(got, want, strict=True)
    )


def names_it(error: Exception, argument: str) -> bool:
    return re.search(rf"\b{argument}\b", str(error)) is not None


PAIRS = [(name, argument) for name, call in CALLS.items() for argument in call.arrays]


def test_every_public_function_is_here():
    public = {f"{module}.{name}" for module in MODULES for name in getattr(fl, module).__all__}
    assert public == set(CALLS) | set(NUMBERS) | ELSEWHERE
    for name, call in (CALLS | NUMBERS).items():
        assert call(), name


@pytest.mark.parametrize(("name", "argument"), PAIRS)
def test_layout_and_dtype(name: str, argument: str, record_property: Callable[[str, object], None]):
    call = CALLS[name]
    base = call.arrays[argument]
    tried = taken = 0
    for dtype in DTYPES:
        plain = converted(base, dtype)
        level = argument in call.pixels and plain.dtype.kind == "u"
        if level:
            plain = (np.asarray(base) * np.iinfo(plain.dtype).max).astype(plain.dtype)
        # Numbers mean what they are in float64; levels what the same levels mean in C order.
        others = {}
        if level:
            # Pictures come in pairs of one dtype.
            others = {
                other: np.ascontiguousarray(
                    (call.arrays[other] * np.iinfo(plain.dtype).max).astype(plain.dtype)
                )
                for other in call.pixels if other != argument
            }  # fmt: skip
            want = outcome(call, **others, **{argument: plain})
        elif argument in call.pixels and len(call.pixels) > 1:
            others = {o: converted(call.arrays[o], dtype) for o in call.pixels if o != argument}
            want = outcome(call, **{argument: plain.astype("f8")},
                           **{o: value.astype("f8") for o, value in others.items()})  # fmt: skip
        else:
            want = outcome(call, **{argument: plain.astype("f8")})
        coarse = 4e-3 if dtype == "f2" else 2e-5
        for layout, change in LAYOUTS.items():
            if layout == "list" and (dtype not in ("f8", "i8") or argument in call.pixels):
                continue
            tried += 1
            got = outcome(call, **others, **{argument: change(plain)})
            what = f"{name}: {argument} as {dtype}, {layout}"
            if isinstance(got, Exception):
                named = any(names_it(got, one) for one in {argument, *others})
                assert named or isinstance(want, Exception), f"{what}: {got}"
                assert dtype not in ("f4", "f8") or isinstance(want, Exception), f"{what}: {got}"
            else:
                assert not isinstance(want, Exception), f"{what}: taken, but not as float64: {want}"
                assert alike(got, want, coarse), f"{what}: another answer"
                taken += 1
    record_property("count", f"{tried} {taken}")
    assert taken >= 2 * len(LAYOUTS) - 2


@pytest.mark.parametrize(("name", "argument"), PAIRS)
@pytest.mark.parametrize(
    "bad", ["empty", "0-d", "too deep", "complex", "object", "text", "dates", "None", "structured"]
)
def test_what_is_no_such_array(name: str, argument: str, bad: str):
    call = CALLS[name]
    base = call.arrays[argument]
    value = {
        "empty": np.zeros((0,) * np.ndim(base)), "0-d": np.array(0.5),
        "too deep": np.zeros((1,) * 6 + np.shape(base)), "complex": np.asarray(base) + 1j,
        "object": np.full(np.shape(base), object()), "text": np.full(np.shape(base), "a"),
        "dates": np.full(np.shape(base), 3, "M8[s]"), "None": np.full(np.shape(base), None),
        "structured": np.zeros(np.shape(base), [("a", "f8")]),
    }[bad]  # fmt: skip
    got = outcome(call, **{argument: value})
    if isinstance(got, Exception):
        # Two arrays that do not fit each other may be told by the name of the other.
        named = [argument, *call.arrays] if bad in ("empty", "0-d") else [argument]
        assert any(names_it(got, one) for one in named), got
        return
    if bad == "too deep" and name in EACH_ALONE:
        assert got[0].shape == value.shape
        return
    assert bad in ("empty", "0-d"), f"{name} takes {argument}, {bad}"
    if bad == "0-d":
        want = call(**{argument: np.full(np.shape(base), 0.5)})
        assert alike(
            [np.broadcast_to(a, b.shape) for a, b in zip(got, want, strict=True)], want, 1e-6
        )
    else:
        assert all(np.isfinite(array).all() for array in got)


def with_out() -> list[tuple[str, str]]:
    found = []
    for name, argument in PAIRS:
        call = CALLS[name]
        function = call.function
        if "out" not in (getattr(function, "__kwdefaults__", None) or {}):
            continue
        made = call()
        if len(made) == 1 and made[0].shape == np.shape(call.arrays[argument]):
            found.append((name, argument))
    return found


@pytest.mark.parametrize(("name", "argument"), with_out())
@pytest.mark.parametrize("how", ["the same", "shifted"])
def test_out_over_an_input(name: str, argument: str, how: str):
    call = CALLS[name]
    made = call()[0]
    base = call.arrays[argument].astype(made.dtype)
    want = call(**{argument: base.copy()})
    if how == "the same":
        given = out = base.copy()
    else:
        room = np.zeros((base.shape[0] + 1, *base.shape[1:]), base.dtype)
        given, out = room[1:], room[:-1]
        given[...] = base
    got = outcome(call, **{argument: given}, out=out)
    if isinstance(got, Exception):
        assert names_it(got, "out") and np.array_equal(given, base)
    else:
        assert alike(got, want, 1e-12)


def test_a_wrong_answer_would_be_seen():
    """The control: functions that forget strides, byte order and dtype."""

    def forgets_strides(values: Any) -> np.ndarray:
        array = np.asarray(values)
        return np.frombuffer(array.tobytes("A"), array.dtype).reshape(array.shape) * 2.0

    def forgets_order(values: Any) -> np.ndarray:
        array = np.asarray(values)
        return array.view(array.dtype.newbyteorder("=")) * 2.0

    def wraps(values: Any) -> np.ndarray:
        return np.asarray(values) * np.asarray(values).dtype.type(2)

    base = np.arange(200.0, 212.0).reshape(3, 4)
    for wrong, dtype, layout in (
        (forgets_strides, "f8", "Fortran"),
        (forgets_order, "f4", "big-endian"),
        (wraps, "u1", "C"),
    ):
        call = Call(wrong, {"values": base})
        plain = converted(base, dtype)
        want = [plain.astype("f8") * 2.0]
        assert not alike(call(values=LAYOUTS[layout](plain)), want, 1e-5)
