"""What is wrong with a public function, aspect by aspect: empty where all is well."""

import contextlib
import dataclasses
import math
import re
import resource
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from public import Call, values
from public.values import LAYOUTS, backwards, misaligned, read_only, strided

REFUSALS = (TypeError, ValueError)

# Bytes that a call may take from the system.
MORE = 64 << 20


def numbers(answer: Any) -> list[np.ndarray]:
    if isinstance(answer, np.ndarray):
        return [answer]
    if isinstance(answer, (int, float, np.generic)):
        return [np.asarray(answer)]
    if isinstance(answer, dict):
        return [a for key in sorted(answer) for a in numbers(answer[key])]
    if isinstance(answer, (tuple, list)):
        return [a for part in answer for a in numbers(part)]
    if dataclasses.is_dataclass(answer) and not isinstance(answer, type):
        return [a for f in dataclasses.fields(answer) for a in numbers(getattr(answer, f.name))]
    return []


def outcome(call: Call, **changes: Any) -> list[np.ndarray] | Exception:
    try:
        return numbers(call(**changes))
    except REFUSALS as error:
        return error


def same(one: list[np.ndarray], two: list[np.ndarray]) -> bool:
    return len(one) == len(two) and all(
        a.shape == b.shape and a.dtype.newbyteorder("=") == b.dtype.newbyteorder("=")
        and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
        for a, b in zip(one, two, strict=True)
    )  # fmt: skip


def near(one: list[np.ndarray], two: list[np.ndarray], within: float, full: float = 1.0) -> bool:
    """Say whether all numbers agree but for a part of the largest; integers mean parts of full."""
    if len(one) != len(two):
        return False
    for a, b in zip(one, two, strict=True):
        if a.shape != b.shape:
            return False
        got = a.astype(complex) / (full if a.dtype.kind == "u" else 1.0)
        scale = np.nanmax(np.abs(b), initial=1.0, where=np.isfinite(b))
        step = 1.01 / full if a.dtype.kind == "u" and full > 1.0 else 0.0
        if not np.isclose(got, b, 0.0, max(within * scale, step), equal_nan=True).all():
            return False
    return True


def names(error: Exception, *arguments: str) -> bool:
    return any(re.search(rf"\b{re.escape(name)}\b", str(error)) for name in arguments)


def converted(array: np.ndarray, dtype: str, picture: bool) -> np.ndarray:
    kind = np.dtype(dtype)
    if kind.kind == "b":
        return array > 0.5
    if kind.kind == "f":
        return array.astype(kind)
    if picture and kind.kind == "u":
        return np.rint(array * np.iinfo(kind).max).astype(kind)
    return np.rint(np.abs(array)).astype(kind)


def row(made: list[np.ndarray] | Exception) -> np.ndarray:
    return np.hstack([a.ravel() for a in made]) if isinstance(made, list) else np.zeros(0)


def of_layouts(call: Call) -> Iterator[str]:
    for argument, value in call.arrays.items():
        picture = argument in call.pictures
        ok = ("f4", "f8") if argument in call.floats else ("u1", "u2", "f4", "f8")
        if argument not in call.floats and not picture:
            ok = ("i4", "i8", "f2", *ok)
        taken = 0
        if not outcome(call):
            yield "an answer without numbers: nothing is compared"
        for dtype in values.DTYPES:
            plain = converted(value, dtype, picture)
            full = float(np.iinfo(plain.dtype).max) if picture and plain.dtype.kind == "u" else 1.0
            what = f"{argument} {dtype}"
            want = outcome(call, **{argument: plain.copy()})
            exact = outcome(call, **{argument: plain.astype(float) / full})
            if isinstance(want, Exception):
                if not names(want, argument, call.both.get(argument, argument)):
                    yield f"{what}: does not name it: {want}"
                # What is a number in one dtype is one in all others.
                if not isinstance(exact, Exception) and dtype in ok:
                    yield f"{what}: refused, but not as float64: {want}"
            elif isinstance(exact, Exception):
                yield f"{what}: taken, but not as float64: {exact}"
            elif not (call.light and full > 1.0):
                within = max(call.within, 4e-3) if dtype == "f2" else call.within
                if not near(want, exact, within, full):
                    yield f"{what}: not the answer of float64"
                kept = plain.dtype if plain.dtype.kind == "f" or picture else np.dtype(float)
                if call.keeps == argument and want[0].dtype != kept:
                    yield f"{what}: comes back as {want[0].dtype}"
            for layout in LAYOUTS if dtype in ("u1", "f4", "f8") else ("strided", "big-endian"):
                array = LAYOUTS[layout](plain)
                before = array.copy()
                got = outcome(call, **{argument: array})
                taken += not isinstance(got, Exception)
                if isinstance(got, Exception) or isinstance(want, Exception):
                    if type(got) is not type(want):
                        yield f"{what}, {layout}: {got!r:.80}, but in C order {want!r:.80}"
                elif not same(got, want):
                    yield f"{what}, {layout}: differs from C order"
                if not np.array_equal(array, before):
                    yield f"{what}, {layout}: written to"
        if not picture:
            rows = outcome(call, **{argument: value.tolist()})
            # A list may come back as one.
            if not near([row(rows)], [row(outcome(call))], call.within):
                yield f"{argument} as a list: {rows!r:.80}"
        if taken < len(LAYOUTS):
            yield f"{argument}: nothing but refusals"


def of_no_arrays(call: Call) -> Iterator[str]:
    for argument, value in call.arrays.items():
        takes = call.takes.get(argument, ("NaN",) if argument in call.pictures else ())
        both = call.both.get(argument, argument)
        for what, array in values.no_arrays(value).items():
            if what.removeprefix("one ") in takes:
                continue
            try:
                got = outcome(call, **{argument: array})
            except OSError:
                # A word is a file's name, where files are taken.
                continue
            others = call.given if what in ("empty", "too deep") else ()
            if not isinstance(got, Exception):
                yield f"{argument}: {what} is taken"
            elif not call.loose and not names(got, argument, both, *others):
                yield f"{argument}: {what}: not named: {got}"
        # One number means itself everywhere, or is refused.
        got = outcome(call, **{argument: np.array(0.5)})
        if isinstance(got, Exception):
            if not names(got, *call.given):
                yield f"{argument}: one number: not named: {got}"
        else:
            want = numbers(call(**{argument: np.full(value.shape, 0.5)}))
            wide = [np.broadcast_to(a, b.shape) for a, b in zip(got, want, strict=True)]
            if not near(wide, want, 1e-6):
                yield f"{argument}: one number is not itself everywhere"
        wide = np.broadcast_to(value[:1], value.shape)
        one, two = outcome(call, **{argument: wide}), outcome(call, **{argument: wide.copy()})
        if type(one) is not type(two) or (isinstance(one, list) and not same(one, two)):
            yield f"{argument}: broadcast, it is another"


def _answer(call: Call, **changes: Any) -> np.ndarray:
    made = call(**changes)
    found: np.ndarray = made[0] if isinstance(made, tuple) else made
    return found


def not_outputs(out: np.ndarray) -> dict[str, Any]:
    """Return what does not fit in the place of an array to write into."""
    byte = out.dtype.newbyteorder()
    found = {
        "a list": out.tolist(), "another dtype": out.astype(np.complex64),
        "another shape": np.zeros((*out.shape, 2), out.dtype),
        "one row more": np.zeros((out.shape[0] + 1, *out.shape[1:]), out.dtype),
        "read-only": read_only(out), "strided": strided(out), "backwards": backwards(out),
        "one number": np.broadcast_to(np.zeros((), out.dtype), out.shape),
    }  # fmt: skip
    if byte != out.dtype:
        # One byte has no order and is always aligned.
        found |= {"bytes turned": np.zeros(out.shape, byte), "misaligned": misaligned(out)}
        found["half as wide"] = out.astype(f"f{12 - out.itemsize}")
    if out.ndim > 1:
        found |= {"flat": out.ravel(), "Fortran": np.asfortranarray(out)}
    return found


def of_output(call: Call) -> Iterator[str]:
    generated = [np.float32, np.float64] if "dtype" in call.parameters else [None]
    for dtype in generated:
        also: dict[str, Any] = {} if dtype is None else {"dtype": dtype}
        want = _answer(call, **also)
        if dtype is not None and want.dtype != dtype:
            yield f"{dtype}: comes as {want.dtype}"
        # Dirty, and with neighbours.
        room = np.full((want.shape[0] + 2, *want.shape[1:]), 77, want.dtype)
        out = room[1:-1]
        if _answer(call, out=out, **also) is not out:
            yield "not returned"
        if not same([out], [want]):
            yield f"{dtype}: differs from a new one"
        if not (room[[0, -1]] == 77).all():
            yield "written beside it"
        for what, given in not_outputs(out).items():
            got = outcome(call, out=given, **also)
            if not isinstance(got, Exception) or not names(got, "out"):
                yield f"{what}: {got!r:.80}"
    for argument, value in call.arrays.items():
        plain = value.astype(want.dtype) if argument == call.keeps else value
        want = _answer(call, **{argument: plain})
        bytes_ = np.zeros(max(plain.nbytes, want.nbytes), np.uint8)
        shared = bytes_[: plain.nbytes].view(plain.dtype).reshape(plain.shape)
        shared[...] = plain
        over = bytes_[: want.nbytes].view(want.dtype).reshape(want.shape)
        got = outcome(call, **{argument: shared}, out=over)
        if isinstance(got, Exception):
            if not names(got, "out") or not np.array_equal(shared, plain):
                yield f"over {argument}: {got}"
        elif not same([over], [want]):
            # Small ones are copied before anything is written.
            yield f"over {argument}: another answer"


@contextlib.contextmanager
def little_memory() -> Iterator[None]:
    """Allow no more than `MORE` beyond what the process has now: what is beyond is not there."""
    has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (has + MORE, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def values_for(call: Call, argument: str) -> Iterator[tuple[Any, bool]]:
    parameter = call.parameters[argument]
    kind = str(parameter.annotation)
    if argument not in call.unused:
        for value in call.refused.get(argument, values.OUT_OF_RANGE.get(argument, ())):
            yield value, True
    for value in values.HOSTILE:
        if argument in call.heavy and (value is None or _is_large(value) or _is_word(value)):
            continue
        if kind.startswith("Sequence[str]") and isinstance(value, np.ndarray):
            continue
        if argument == "dask" and (value is True or isinstance(value, str)):
            # A cluster, or a search for one: `test_cluster.py` has both. A client that found none
            # may be tidied up while the next cluster starts, and Dask then waits for itself.
            continue
        must = not values.may_be(kind, value)
        if isinstance(value, str) and not must:
            files = "PathLike" in kind or "Path" in kind
            must = not (files or argument in call.words or "Any" in kind)
        far = parameter.default is math.inf or argument in call.infinite
        if isinstance(value, float) and value is math.inf and far:
            must = False
        yield value, must and not call.loose and argument not in call.unused


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and not value


def _is_large(value: Any) -> bool:
    return isinstance(value, (int, float)) and value > 2**20


Values = Callable[[Call, str], Iterator[tuple[Any, bool]]]


def of_arguments(call: Call, tried: Values = values_for) -> Iterator[str]:
    call()
    # Strengths of effects ("severity") are no parameters of their own.
    for argument in dict.fromkeys((*call.parameters, *call.refused)):
        if argument == "out":
            continue
        alone = argument in call.arrays or argument not in call.parameters
        told = ((value, True) for value in call.refused.get(argument, ()))
        for value, must in told if alone else tried(call, argument):
            with little_memory():
                found = _of_value(call, argument, value, must)
            if found:
                yield f"{argument}={value!r:.50}: {found}"


def _of_value(call: Call, argument: str, value: Any, must: bool) -> str:
    try:
        call(**{argument: value})
    except REFUSALS as error:
        # `os.fspath` says it as well as we could.
        named = names(error, "PathLike", *((argument,) if must else call.parameters))
        if not named and (must or call.strict):
            return f"not named: {str(error)[:120]}"
        long = len(str(error)) > 2000 and call.strict
        return f"{len(str(error))} letters of message" if long else ""
    except (OSError, MemoryError) as error:
        # Found out by trying.
        return type(error).__name__ if must else ""
    except Exception as error:
        return f"{type(error).__name__}: {str(error)[:120]}"
    except SystemExit:
        return "leaves Python"
    return "is taken" if must else ""


# They order work, or more threads; what they make is as small as ever.
NO_SIZES = ("seed", "index", "n", "workers", "group", "severity", "number", "pixels", "bytes")


def sizes_of(call: Call) -> Iterator[tuple[str, Any]]:
    for argument, value in call.given.items():
        if argument not in NO_SIZES and argument not in call.heavy:
            if isinstance(value, int) and not isinstance(value, bool):
                yield from ((argument, size) for size in values.SIZES)
            if isinstance(value, tuple) and len(value) == 2 and all(type(v) is int for v in value):
                yield from ((argument, shape) for shape in values.SHAPES)


def of_sizes(call: Call) -> Iterator[str]:
    call()
    outcomes = set()
    for argument, size in sizes_of(call):
        with little_memory():
            try:
                call(**{argument: size})
                outcomes.add("answered")
            except (*REFUSALS, OSError, MemoryError) as error:
                outcomes.add(type(error).__name__)
            except Exception as error:
                yield f"{argument}={size}: {type(error).__name__}: {error}"
    if outcomes == {"answered"}:
        yield "nothing was too large"
