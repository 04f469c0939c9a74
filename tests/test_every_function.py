"""What holds for every public function: layouts and dtypes of arrays, and hostile arguments.

The list is made from the package, the calls are in `public.py`: a function without one fails.
The right answer or a TypeError or ValueError that names the argument; never a wrong answer, and
never a written input.
"""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import inspect
import math
import signal
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from public import Call, calls, functions, methods

NAMES = sorted(functions())
METHODS = sorted(methods())
DTYPES = ("u1", "u2", "i4", "i8", "f2", "f4", "f8", "?")
REFUSALS = (TypeError, ValueError)

# The sizes are tried in so many processes.
PARTS = 2


class Subclass(np.ndarray):
    """One that is nothing but another type."""


def _misaligned(array: np.ndarray) -> np.ndarray:
    room = np.empty(array.nbytes + 1, np.uint8)
    view = room[1:].view(array.dtype).reshape(array.shape)
    view[...] = array
    return view


def _spread(array: np.ndarray) -> np.ndarray:
    wide = np.zeros(tuple(2 * n for n in array.shape), array.dtype)
    cut = tuple(slice(None, None, 2) for _ in array.shape)
    wide[cut] = array
    return wide[cut]


def _read_only(array: np.ndarray) -> np.ndarray:
    array = array.copy()
    array.flags.writeable = False
    return array


def _turned(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array.T).T


def _backwards(array: np.ndarray) -> np.ndarray:
    cut = tuple(slice(None, None, -1) for _ in array.shape)
    return array[cut].copy()[cut]


LAYOUTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "C": np.copy,
    "Fortran": np.asfortranarray,
    "transposed": _turned,
    "backwards": _backwards,
    "strided": _spread,
    "read-only": _read_only,
    "misaligned": _misaligned,
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "subclass": lambda a: a.copy().view(Subclass),
}


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Call]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {**calls(tmp_path_factory.mktemp("public")), **methods()}


@pytest.fixture(autouse=True)
def quiet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Away from the checkout, without warnings; one that hangs is a failed test."""
    import flurries as fl

    monkeypatch.chdir(tmp_path)
    # Plots take a second; they have tests of their own.
    monkeypatch.setattr("flurries.accuracy.plot.save", lambda *_, **__: [])
    signal.signal(signal.SIGALRM, _late)
    signal.alarm(300)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.alarm(0)
        # What calls of these two left behind must not reach other tests.
        fl.set_threads(2)
        fl.set_reproducible(False)


class Late(BaseException):
    """Not an OSError, as a TimeoutError is, which a call may raise."""


def _late(*_: Any) -> None:
    raise Late("takes longer than it may")


def arrays(answer: Any) -> list[np.ndarray]:
    """Return all numbers of an answer, whatever it is made of."""
    if isinstance(answer, np.ndarray):
        return [answer]
    if isinstance(answer, (int, float, np.generic)):
        return [np.asarray(answer)]
    if isinstance(answer, dict):
        return [a for key in sorted(answer) for a in arrays(answer[key])]
    if isinstance(answer, (tuple, list)):
        return [a for part in answer for a in arrays(part)]
    if dataclasses.is_dataclass(answer) and not isinstance(answer, type):
        return [a for f in dataclasses.fields(answer) for a in arrays(getattr(answer, f.name))]
    return []


def given(call: Call, **changes: Any) -> dict[str, Any]:
    """Return the arguments, some of them changed."""
    alike = {call.both[name]: value for name, value in changes.items() if name in call.both}
    return {**call.given, **alike, **changes}


def run(call: Call, **changes: Any) -> list[np.ndarray]:
    return arrays(call.of(**given(call, **changes)))


def same(one: list[np.ndarray], two: list[np.ndarray]) -> bool:
    return len(one) == len(two) and all(
        a.shape == b.shape and a.dtype.newbyteorder("=") == b.dtype.newbyteorder("=")
        and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
        for a, b in zip(one, two, strict=True)
    )  # fmt: skip


def named(error: Exception, name: str) -> bool:
    return name.lower() in str(error).lower()


# The list ----------------------------------------------------------------------------------------


def test_every_public_function_has_a_call(table: dict[str, Call]):
    missing = set(NAMES) - set(table)
    assert not missing, f"put a valid call into tests/public.py: {sorted(missing)}"
    assert not set(table) - set(NAMES) - set(METHODS)
    assert len(NAMES) > 100


def test_a_function_that_is_forgotten_is_noticed(monkeypatch: pytest.MonkeyPatch):
    import flurries.composite

    def forgotten() -> None: ...

    monkeypatch.setattr(flurries.composite, "forgotten", forgotten, raising=False)
    monkeypatch.setattr(flurries.composite, "__all__", [*flurries.composite.__all__, "forgotten"])
    assert set(functions()) - set(NAMES) == {"composite.forgotten"}


@pytest.mark.parametrize("name", NAMES)
def test_every_array_argument_is_tried(name: str, table: dict[str, Call]):
    """What the signature calls array-like is in the call, and among its arrays."""
    call = table[name]
    tried = {*call.numbers, *call.pictures, *call.spectra}
    for parameter in inspect.signature(call.of).parameters.values():
        # But for a number in an array's place, and what only goes into a file: `methods`.
        if isinstance(call.given.get(parameter.name), np.ndarray) and "io.write" not in name:
            assert parameter.name in tried, parameter.name


# Arrays ------------------------------------------------------------------------------------------

ARRAYS = [*NAMES, *METHODS]


@pytest.mark.parametrize("name", ARRAYS)
def test_layouts_times_dtypes(name: str, table: dict[str, Call]):
    call = table[name]
    wrong = []
    tried = 0
    for argument in (*call.numbers, *call.pictures):
        # Whole numbers from 0 on mean the same in every dtype.
        whole = np.rint(np.abs(call.given[argument]))
        for dtype in DTYPES:
            base = np.ascontiguousarray(whole.astype(dtype))
            if call.pictures and argument in call.pictures and dtype in ("u1", "u2"):
                base = (base * np.iinfo(dtype).max).astype(dtype)
            try:
                want = run(call, **{argument: base})
            except REFUSALS as error:
                want = error
            for layout, made in LAYOUTS.items():
                tried += 1
                array = made(base)
                before = array.copy()
                try:
                    got = run(call, **{argument: array})
                except REFUSALS as error:
                    if not (named(error, argument) or named(error, call.both.get(argument, "\0"))):
                        wrong.append(f"{argument} {dtype} {layout}: does not name it: {error}")
                    if not isinstance(want, Exception):
                        wrong.append(f"{argument} {dtype} {layout}: refused, C is not: {error}")
                    continue
                if isinstance(want, Exception):
                    wrong.append(f"{argument} {dtype} {layout}: taken, C is refused: {want}")
                elif not same(got, want):
                    wrong.append(f"{argument} {dtype} {layout}: differs from C")
                if not np.array_equal(array, before):
                    wrong.append(f"{argument} {dtype} {layout}: written to")
    assert not wrong, f"{len(wrong)} of {tried}:\n" + "\n".join(wrong[:20])


@pytest.mark.parametrize("name", ARRAYS)
def test_dtypes_mean_the_same_numbers(name: str, table: dict[str, Call]):
    """Of every dtype that is taken the answer is that of float64, within its own precision."""
    call = table[name]
    for argument in (*call.numbers, *call.pictures):
        whole = np.rint(np.abs(call.given[argument]))
        try:
            want = run(call, **{argument: whole})
        except REFUSALS:
            continue
        for dtype in DTYPES:
            if dtype == "?" and whole.max() > 1:
                continue
            if argument in call.light and dtype in ("u1", "u2"):
                continue
            base = whole.astype(dtype)
            picture = argument in call.pictures
            if picture and dtype in ("u1", "u2"):
                base = (base * np.iinfo(dtype).max).astype(dtype)
            try:
                got = run(call, **{argument: base})
            except REFUSALS:
                continue
            assert len(got) == len(want)
            for a, b in zip(got, want, strict=True):
                full = float(np.iinfo(a.dtype).max) if picture and a.dtype.kind == "u" else 1.0
                scale = np.nanmax(np.abs(b), initial=1.0, where=np.isfinite(b))
                # Of what keeps its dtype the rounding, of integer pictures one step.
                within = max(call.within, 2e-3 if a.dtype == np.float16 else 1e-5)
                if picture and a.dtype.kind == "u":
                    within = 1.01 / full
                near = np.isclose(
                    a.astype(float) / full, b.astype(float), rtol=0.0, atol=within * scale,
                    equal_nan=True,
                )  # fmt: skip
                assert near.all(), (argument, dtype, np.abs(a / full - b).max())


@pytest.mark.parametrize("name", ARRAYS)
def test_broadcast_arrays(name: str, table: dict[str, Call]):
    call = table[name]
    for argument in (*call.numbers, *call.pictures):
        value = call.given[argument]
        if value.ndim < 2:
            continue
        wide = np.broadcast_to(value[:1], value.shape)
        try:
            got = run(call, **{argument: wide})
        except REFUSALS as error:
            with pytest.raises(type(error)):
                run(call, **{argument: wide.copy()})
            continue
        assert same(got, run(call, **{argument: wide.copy()})), argument


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_that_are_none(name: str, table: dict[str, Call]):
    """Empty, 0-d, of other shapes, of other kinds: refused by name, or the answer of a list."""
    call = table[name]
    for argument in (*call.numbers, *call.pictures):
        value = call.given[argument]
        odd = {
            "empty": value[:0],
            "0-d": np.array(1.0),
            "another dimension": value[None, None, None],
            "complex": value.astype(complex),
            "object": value.astype(object),
            "text": value.astype(str),
            "dates": np.zeros(value.shape, "M8[s]"),
            "records": np.zeros(value.shape, [("a", float)]),
            "words": "abc",
            "ragged": [[1.0, 2.0], [3.0]],
            "NaN": np.full(value.shape, np.nan),
            "infinity": np.full(value.shape, -np.inf),
            "huge": np.full(value.shape, 1e300),
        }
        for what, array in odd.items():
            try:
                got = run(call, **{argument: array})
            except REFUSALS as error:
                # What does not fit another argument may name that.
                fits = any(named(error, other) for other in call.given) and what in SHAPES
                fits = fits or named(error, call.both.get(argument, "\0"))
                assert named(error, argument) or fits, (argument, what, str(error))
                continue
            except OSError:
                # Words are a file's name, where files are taken.
                assert what == "words", (argument, what)
                continue
            if what == "0-d":
                # One number for all, where that is what a number means.
                assert same(got, run(call, **{argument: 1.0})), (argument, what)
            elif what == "empty":
                assert argument in call.empty, (argument, what)
            elif what in ("NaN", "infinity", "huge"):
                # Pictures may hold what they like; geometry may not make it up.
                if argument not in call.pictures and what == "NaN":
                    assert argument in ("field", "flow", "values", "depth", "plane", "cosine",
                                        "position"), (argument, what)  # fmt: skip
            elif not (call.shapeless and what == "another dimension"):
                pytest.fail(f"{argument}: {what} was taken")


SHAPES = ("empty", "0-d", "another dimension")


# Other arguments ---------------------------------------------------------------------------------

HOSTILE = (
    math.nan, math.inf, -math.inf, -1, 0, 2**31 - 1, 2**31 + 1, 2**63, -(2**63) - 1, 1e308, 1e-308,
    "x" * 100_000, "", b"\0", None, True, [], {}, object(), 1j, (1, 2, 3, 4, 5, 6, 7), "\0",
    ["a", None], type, float, np.float16(7.5), np.array([]),
)  # fmt: skip

# Seconds of a core that a refusal may take.
PROMPT = 0.05


def ordered(call: Call, argument: str, value: Any) -> bool:
    """Whether a value is an order for a lot of work, or for all there is."""
    if argument == "dask" and (value is True or isinstance(value, str)):
        # A cluster, or a search for one: `test_cluster.py` and `test_augment_workers.py` have both.
        # A client that found none may be tidied up while the next cluster starts, and Dask then
        # waits for itself for ever.
        return True
    return argument in call.heavy and value in (None, "", 2**31 - 1, 2**31 + 1)


def hostile(call: Call) -> Iterator[tuple[str, Any]]:
    """Yield arguments and values for them."""
    for argument, parameter in inspect.signature(call.of).parameters.items():
        if parameter.kind != parameter.VAR_KEYWORD:
            for value in HOSTILE:
                if isinstance(value, np.ndarray) or not ordered(call, argument, value):
                    yield argument, value


@pytest.mark.parametrize("name", ARRAYS)
def test_hostile_arguments(name: str, table: dict[str, Call], capsys: pytest.CaptureFixture[str]):
    """Documented exceptions only, and at once."""
    call = table[name]
    taken = (*REFUSALS, OSError, MemoryError)
    for argument, value in hostile(call):
        # Again if late: the first call imports, a busy machine may have taken the time.
        for _ in range(3):
            began = time.thread_time()
            try:
                answer = call.of(**{**copy.copy(call.given), argument: value})
            except REFUSALS:
                if time.thread_time() - began > PROMPT:
                    continue
                break
            except (OSError, MemoryError):
                # Found out by trying.
                break
            except Exception as error:
                pytest.fail(f"{argument}={value!r:.60}: {type(error).__name__}: {error}")
            except SystemExit:
                pytest.fail(f"{argument}={value!r:.60}: leaves Python")
            if hasattr(answer, "__next__"):
                with contextlib.suppress(*taken):
                    next(answer)
            break
        else:
            pytest.fail(f"{argument}={value!r:.60}: refused late")
    capsys.readouterr()


# Sizes -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", range(PARTS))
def test_sizes_under_a_limit_of_memory(part: int, tmp_path: Path):
    """In a process that may have 64 MiB more: an answer, a refusal or MemoryError, no abort."""
    script = Path(__file__).with_name("sizes_under_limit.py")
    done = subprocess.run(
        [sys.executable, str(script), str(part), str(PARTS)], cwd=tmp_path, timeout=300,
        capture_output=True, text=True, errors="replace",
    )  # fmt: skip
    assert done.returncode == 0, f"ends with {done.returncode}\n{done.stdout[-500:]}{done.stderr}"
    *_, last = done.stdout.splitlines()
    outcomes = dict(word.split("=") for word in last.split())
    assert int(outcomes["MemoryError"]) > 0 and int(outcomes["refused"]) > 0


def test_an_abort_is_noticed(tmp_path: Path):
    """The control: a library that cannot get memory and ends the process."""
    script = Path(__file__).with_name("sizes_under_limit.py")
    done = subprocess.run(
        [sys.executable, str(script), "abort"], cwd=tmp_path, timeout=300, capture_output=True
    )
    assert done.returncode != 0


# Output ------------------------------------------------------------------------------------------


# A folder.
NOT_ONE_ARRAY = ("augment.corrupt.corrupt",)


def outputs(table: dict[str, Call]) -> list[str]:
    """Return the names of those that write into an array that they are given."""
    return [n for n, call in table.items() if "out" in inspect.signature(call.of).parameters
            and n not in NOT_ONE_ARRAY]  # fmt: skip


@pytest.mark.parametrize("name", ARRAYS)
def test_output_arrays(name: str, table: dict[str, Call]):
    """`out` is returned with the answer in it; what does not fit or overlaps is refused."""
    call = table[name]
    if name not in outputs(table):
        assert "out" not in inspect.signature(call.of).parameters or name in NOT_ONE_ARRAY
        return
    want = call.of(**call.given)
    want = want[0] if isinstance(want, tuple) else want
    out = np.full_like(want, 77)
    got = call.of(**call.given, out=out)
    assert (got[0] if isinstance(got, tuple) else got) is out
    assert same([out], [want])
    byte = out.dtype.newbyteorder()
    refused = {
        "a list": out.tolist(),
        "another dtype": out.astype(np.complex64),
        "bytes turned": np.zeros(out.shape, byte),
        "another shape": np.zeros((*out.shape, 2), out.dtype),
        "flat": np.zeros(out.size, out.dtype) if out.ndim > 1 else np.zeros((1, out.size)),
        "read-only": _read_only(out),
        "strided": _spread(out),
        "backwards": _backwards(out),
        "misaligned": _misaligned(out),
        "one number": np.broadcast_to(np.zeros((), out.dtype), out.shape),
    }
    if out.ndim > 1:
        refused["Fortran"] = np.asfortranarray(out)
    if byte == out.dtype:
        # One byte has no order and is always aligned.
        del refused["bytes turned"], refused["misaligned"]
    for what, given_out in refused.items():
        with pytest.raises(REFUSALS, match=r"\bout\b"):
            call.of(**call.given, out=given_out)
            pytest.fail(f"{what} was taken")
    for argument in (*call.numbers, *call.pictures):
        value = call.given[argument]
        if value.nbytes < out.nbytes:
            # The input is a part of what is written.
            room = np.zeros(out.nbytes, np.uint8)
            shared = room[: value.nbytes].view(value.dtype).reshape(value.shape)
            over = room.view(out.dtype).reshape(out.shape)
        else:
            room = np.zeros(value.nbytes, np.uint8)
            shared = room.view(value.dtype).reshape(value.shape)
            over = room[: out.nbytes].view(out.dtype).reshape(out.shape)
        shared[...] = value
        try:
            got = call.of(**given(call, **{argument: shared}), out=over)
        except REFUSALS as error:
            assert named(error, "out") and named(error, "overlap"), error
        else:
            # Small ones are copied before anything is written.
            assert same([over], [want]), argument


def test_many_write_into_an_array_of_the_caller(table: dict[str, Call]):
    assert len(outputs(table)) > 25


# Controls ----------------------------------------------------------------------------------------


def test_a_wrong_answer_is_noticed():
    """The control: a function that reads memory in the order that it finds."""

    def careless(picture: Any) -> Any:
        return np.frombuffer(
            bytes(picture.data if picture.flags.c_contiguous else picture.T.data), picture.dtype
        ).reshape(picture.shape)

    call = Call(careless, {"picture": np.arange(12.0).reshape(3, 4)}, numbers=("picture",))
    with pytest.raises(AssertionError, match="differs from C"):
        test_layouts_times_dtypes("careless", {"careless": call})
    assert sys.version_info >= (3, 10)
