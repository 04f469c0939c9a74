"""What holds for every public function and class: one table, and a case for each aspect."""

from __future__ import annotations

import inspect
import signal
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

import flurries as fl
from flurries._contract import rectangular
from public import Call, calls, listed
from public.complaints import of_arguments, of_layouts, of_no_arrays, of_output, of_sizes, sizes_of
from public.refused import OUTSIDE
from public.scenes import write_files

Array = npt.NDArray[Any]
TABLE = calls()
OF_ARRAYS = [name for name, call in TABLE.items() if call.arrays]
ASPECTS = {
    of_layouts: OF_ARRAYS, of_no_arrays: OF_ARRAYS,
    of_output: [name for name, call in TABLE.items() if call.writes],
    of_arguments: [name for name, call in TABLE.items() if call.parameters],
    of_sizes: [name for name, call in TABLE.items() if list(sizes_of(call))],
}  # fmt: skip
LONGEST = 60


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("public")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_files()
    return folder


class Late(BaseException):
    """Not an OSError, as a TimeoutError is, which a call may raise."""


def _late(*_: Any) -> None:
    raise Late("takes longer than it may")


@pytest.fixture(autouse=True)
def quiet(files: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Beside its files, without warnings; one that hangs is a failed test."""
    monkeypatch.chdir(files)
    signal.signal(signal.SIGALRM, _late)
    signal.alarm(LONGEST)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.alarm(0)
        # What calls of these two left behind must not reach other tests.
        fl.set_threads(2)
        fl.settings(reproducible=False)


def test_everything_public_has_a_call():
    missing = set(listed()) - set(TABLE)
    assert not missing, f"put a call into tests/public: {sorted(missing)}"
    gone = {name for name, call in TABLE.items() if call.of is None}
    assert not gone, f"take these calls out of tests/public: {sorted(gone)}"
    assert OUTSIDE.keys() <= TABLE.keys()
    own = {name for name, call in TABLE.items() if call.of is listed().get(name)}
    assert all("(" in name or inspect.ismethod(TABLE[name].of) for name in set(TABLE) - own)
    assert all(
        len(ASPECTS[of]) > n for of, n in ((of_layouts, 60), (of_output, 25), (of_arguments, 130))
    )


# Arrays among words, arguments that a mode does not look at, and three of which
# `test_flakes.py`, `test_cameras.py` and `test_augment.py` have more.
UNTRIED = {
    "composite.join layers", "io.write_layers layers", "spectral.optical_depth patterns",
    "camera.importers.read_colmap down", "camera.importers.load down", "augment.Fog.record image",
    # A spectrum of one's own and rings exclude each other; the other row of the function has them.
    *(f"spectral.Texture {own}" for own in ("envelope", "rate")),
    *(f"spectral.Texture(own) ring_{of}" for of in ("edges", "gains")),
}  # fmt: skip


def test_every_array_argument_is_tried():
    untried = {
        f"{name} {argument}"
        for name, call in TABLE.items()
        for argument, parameter in call.parameters.items()
        if "ArrayLike" in str(parameter.annotation) and argument not in call.arrays
    }
    assert untried == UNTRIED


def test_options_are_keyword_only():
    """After the arrays: whoever writes numbers in a row cannot mean the wrong one."""
    for name, function in listed().items():
        module = name.split(".")[0]
        if module in ("spectral", "particles", "gas", "cone", "composite", "stereo"):
            for parameter in inspect.signature(function).parameters.values():
                if parameter.default is not parameter.empty and "Like" not in parameter.annotation:
                    assert parameter.kind is parameter.KEYWORD_ONLY, f"{name}: {parameter.name}"


# What a texture has that is asked for no more; the papers' numbers.
USUAL: dict[str, Any] = {
    "drift": (0.0, 0.0), "shift": (0.0, 0.0), "tile": 64, "overlap": 10, "exponent": 1.0,
    "wavelengths": (4.0, 32.0), "wavelength_max": 32.0, "alias": "keep", "soft_from": 0.4,
    "shutter": 0.0, "jitter": False, "blend": "power", "mean": 0.5, "spread": 3.0, "power": 2.0,
    "amount": 1.0, "preserve_mean": False, "renormalise": False, "dtype": np.float32,
}  # fmt: skip
UNUSUAL = {"temporal_filter alias": "cut", "random_phase tile": (0, 0)}


def test_defaults_are_the_papers():
    spectral = {name: getattr(fl.spectral, name) for name in (
        "field", "alpha", "opacity", "temporal_filter", "Texture", "tent_rate", "band_amplitude",
        "random_phase", "blend_tiles", "inverse_transform", "loop", "volume",
    )}  # fmt: skip
    for name, function in {**spectral, "tile_drift": fl.camera.tile_drift}.items():
        for key, parameter in inspect.signature(function).parameters.items():
            if key in USUAL and parameter.default is not parameter.empty:
                wanted = UNUSUAL.get(f"{name} {key}", USUAL[key])
                assert parameter.default == wanted, f"{name}: {key}"


@pytest.mark.parametrize(
    ("of", "name"),
    [(of, name) for of, names in ASPECTS.items() for name in names],
    ids=lambda one: getattr(one, "__name__", one),
)
def test_nothing_is_wrong_with_an_aspect(of: Any, name: str, capsys: pytest.CaptureFixture[str]):
    """The right answer, a refusal by name or MemoryError; an abort ends the run."""
    found = list(of(TABLE[name]))
    capsys.readouterr()
    assert found == []


def twice(
    numbers: npt.ArrayLike, *, mistake: str = "", size: int = 3, out: Array | None = None
) -> Any:
    """Return twice the numbers (H, W), with a mistake."""
    array, mistake = rectangular("numbers", numbers), str(mistake)
    if mistake == "takes all" or array.dtype.kind in "iuf":
        pass
    elif mistake == "names nothing":
        raise TypeError("bad")
    else:
        raise TypeError("numbers must be numbers")
    if mistake != "takes all" and (array.ndim != 2 or not array.size or np.isnan(array).any()):
        raise ValueError("numbers must be (H, W)")
    if mistake in ("leaves", "another error") and size == 0:
        raise SystemExit if mistake == "leaves" else KeyError
    if mistake != "any size" and (type(size) is not int or not 0 <= size < 2**31):
        if mistake == "asks first":
            np.zeros(2**25)
        raise ValueError(f"size must be small, got {size}"[: None if mistake == "long" else 200])
    if mistake == "memory order":
        array = np.frombuffer(array.tobytes("A"), array.dtype).reshape(array.shape)
    if mistake == "writes" and array.flags.writeable:
        array += 1
    made = array + array if mistake == "wraps" else 2.0 * array
    if size > 3:
        np.zeros(size)
    if out is None:
        return made
    if mistake != "any out" and (
        not isinstance(out, np.ndarray) or out.shape != made.shape or out.dtype != made.dtype
        or not out.flags.carray or np.may_share_memory(out, array)
    ):  # fmt: skip
        raise ValueError("out does not fit")
    if mistake == "keeps dirt":
        return np.minimum(out, made, out=out)
    out[...] = made
    return made if mistake == "returns another" else out


MISTAKES = {
    "memory order": (of_layouts, "differs from C order"),
    "wraps": (of_layouts, "not the answer of float64"), "writes": (of_layouts, "written to"),
    "takes all": (of_no_arrays, "is taken"),
    "names nothing": (of_no_arrays, "not named"), "any out": (of_output, "read-only"),
    "keeps dirt": (of_output, "differs from a new one"),
    "returns another": (of_output, "not returned"), "any size": (of_arguments, "is taken"),
    "leaves": (of_arguments, "leaves Python"), "another error": (of_arguments, "KeyError"),
    "asks first": (of_arguments, "MemoryError"), "long": (of_arguments, "letters of message"),
}  # fmt: skip


@pytest.mark.parametrize("mistake", ["", *MISTAKES])
def test_a_mistake_would_be_seen(mistake: str):
    given = {"numbers": 128.0 + np.arange(12.0).reshape(3, 4), "size": 3, "mistake": mistake}
    call = Call(given, of=twice, strict=True, unused=("mistake",))
    seen, phrase = MISTAKES.get(mistake, (of_layouts, ""))
    found = [line for of in ((seen,) if mistake else ASPECTS) for line in of(call)]
    assert any(phrase in line for line in found) if mistake else found == []


PICTURE = np.full((4, 6, 3), 0.5, np.float32)


def spoiled(shape, place, value, dtype=np.float32):
    array = np.full(shape, 0.5, dtype)
    array[place] = value
    return array


@pytest.mark.parametrize(("call", "message"), [
    (lambda: fl.composite.snow(PICTURE, spoiled((4, 6), (2, 3), 1.5)),
     r"alpha must be from 0 to 1 everywhere, got 1\.5 at \[2, 3\]"),
    (lambda: fl.composite.over(PICTURE, spoiled((4, 6, 4), (1, 5, 0), np.nan)),
     r"layer must be finite, got nan at \[1, 5, 0\]"),
    (lambda: fl.gas.phase(spoiled(5, 4, -2.0, np.float64)),
     r"cosine must be from -1 to 1, got -2 at \[4\]"),
    (lambda: fl.augment.occlusion(PICTURE[..., 0], [(0, 0, 2, 2), (3, 0, 1, 2)]),
     r"boxes must be .*, got \(3\.0, 0\.0, 1\.0, 2\.0\) at \[1\]"),
    (lambda: fl.Scene(background=spoiled((4, 6, 4), (3, 0, 3), 2.0)).render(),
     r"background: alpha must be from 0 to 1 everywhere, got 2 at \[3, 0\]"),
])  # fmt: skip
def test_the_first_bad_number_is_named_with_its_place(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("picture", [PICTURE, "photo.jpg"])
def test_a_picture_given_as_the_size_is_told_its_argument(picture):
    with pytest.raises((TypeError, ValueError), match=r"size must be .*; a picture is background="):
        fl.Scene(size=picture)


def test_a_normalized_picture_is_warned_of_and_a_plate_is_not():
    few = PICTURE.copy()
    few[0, 0] = -0.2
    normalized = (PICTURE - 0.6) / 0.2
    snowfall = fl.augment.Snowfall(severity=2)
    with pytest.warns(UserWarning, match="image is below 0 in 100% of its values"):
        snowfall(normalized, index=1)
    snowfall(few, index=1)
