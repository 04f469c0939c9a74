"""What holds for every function on arrays: `out`, layouts, dtypes, and bits that stay the same."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
import twin

S = fl.spectral
TABLE = twin.band_amplitude((16, 16), wavelengths=(2.5, 16.0))
PHASE = twin.random_phase((16, 16), seed=1)
PIXELS = np.random.default_rng(0).standard_normal((16, 16))
TILES = np.random.default_rng(0).standard_normal((2, 2, 16, 16))
FRAME = {"drift": (3.0, 9.0), "seed": 3, "tile": 16, "overlap": 5, "wavelengths": (2.5, 16.0)}

# Each function that gives a frame-sized array, with everything but `out`.
CALLS: dict[str, Callable[..., Any]] = {
    "tent_rate": lambda **o: S.tent_rate((16, 16), (1.0, 2.0), **o),
    "band_amplitude": lambda **o: S.band_amplitude((16, 16), wavelengths=(3.0, 16.0), **o),
    "random_phase": lambda **o: S.random_phase((16, 16), seed=1, **o),
    "advance_phase": lambda **o: S.advance_phase(PHASE, (1.0, 2.0), **o),
    "temporal_filter": lambda **o: S.temporal_filter(TABLE, (9.0, 9.0), **o),
    "inverse_transform": lambda **o: S.inverse_transform(TABLE, PHASE, **o),
    "inverse_transform f64": lambda **o: S.inverse_transform(TABLE, PHASE, dtype=np.float64, **o),
    "blend_tiles": lambda **o: S.blend_tiles(TILES, (27, 20), overlap=5, **o),
    "field": lambda **o: S.field((27, 20), **FRAME, **o),
    "field f64": lambda **o: S.field((27, 20), **FRAME, dtype=np.float64, **o),
    "opacity": lambda **o: S.opacity(PIXELS, **o),
    "opacity f32": lambda **o: S.opacity(PIXELS.astype(np.float32), **o),
    "alpha": lambda **o: S.alpha((27, 20), **FRAME, **o),
}


@pytest.mark.parametrize("name", CALLS)
def test_out_is_filled_and_returned(name: str):
    call = CALLS[name]
    want = call()
    out = np.full(want.shape, np.nan, want.dtype)  # dirty on purpose
    assert call(out=out) is out
    assert np.array_equal(out, want)


@pytest.mark.parametrize("name", CALLS)
def test_out_into_a_view(name: str):
    # C order inside a larger buffer; what stands around it stays.
    call = CALLS[name]
    want = call()
    buffer = np.full((want.shape[0] + 2, want.shape[1]), 7.0, want.dtype)
    call(out=buffer[1:-1])
    assert np.array_equal(buffer[1:-1], want)
    assert np.all(buffer[[0, -1]] == 7.0)


@pytest.mark.parametrize("name", CALLS)
def test_out_that_does_not_fit_is_refused(name: str):
    call = CALLS[name]
    want = call()
    other = np.float32 if want.dtype == np.float64 else np.float64
    readonly = np.empty_like(want)
    readonly.flags.writeable = False
    wrong = {
        "dtype": np.empty(want.shape, other),
        "int": np.empty(want.shape, np.int32),
        "byte order": np.empty(want.shape, want.dtype.newbyteorder()),
        "shape": np.empty((want.shape[0] + 1, want.shape[1]), want.dtype),
        "transposed shape": np.empty((want.shape[0], want.shape[1] + 1), want.dtype),
        "flat": np.empty(want.size, want.dtype),
        "Fortran order": np.empty(want.shape, want.dtype, order="F"),
        "strided": np.empty((want.shape[0], 2 * want.shape[1]), want.dtype)[:, ::2],
        "backwards": np.empty_like(want)[::-1],
        "read-only": readonly,
        "list": want.tolist(),
    }
    for what, out in wrong.items():
        with pytest.raises((TypeError, ValueError), match="out"):
            call(out=out)
            pytest.fail(f"accepted: {what}")


# Functions of arrays, as functions of those arrays only.
OF_ARRAYS: dict[str, tuple[Callable[..., Any], list[np.ndarray]]] = {
    "advance_phase": (lambda p: S.advance_phase(p, (1.0, 2.0)), [PHASE]),
    "temporal_filter": (lambda a: S.temporal_filter(a, (9.0, 9.0)), [TABLE]),
    "inverse_transform": (lambda a, p: S.inverse_transform(a, p, dtype=np.float64), [TABLE, PHASE]),
    "blend_tiles": (lambda t: S.blend_tiles(t, (27, 20), overlap=5), [TILES]),
    "opacity": (lambda z: S.opacity(z), [PIXELS]),
    "drift per tile": (
        lambda d: S.field((27, 20), **{**FRAME, "drift": d}),
        [np.random.default_rng(1).uniform(-9, 9, (2, 2, 2))],
    ),
    "shortest": (
        lambda s: S.field((27, 20), **FRAME, shortest=s),
        [np.random.default_rng(1).uniform(3, 9, (2, 2))],
    ),
}


def layouts(array: np.ndarray) -> dict[str, np.ndarray]:
    """The same numbers in other memory."""
    last = array.shape[-1]
    padded = np.zeros((*array.shape[:-1], 2 * last))
    padded[..., ::2] = array
    misaligned = np.zeros(array.nbytes + 1, np.uint8)[1:].view(np.float64).reshape(array.shape)
    misaligned[...] = array
    readonly = array.copy()
    readonly.flags.writeable = False
    return {
        "Fortran": np.asfortranarray(array),
        "transposed": np.ascontiguousarray(np.moveaxis(array, 0, -1)).transpose(
            -1, *range(array.ndim - 1)
        ),
        "backwards": np.ascontiguousarray(array[::-1, ::-1])[::-1, ::-1],
        "strided": padded[..., ::2],
        "misaligned": misaligned,
        "big-endian": array.astype(">f8"),
        "read-only": readonly,
        "subclass": array.view(type("Sub", (np.ndarray,), {})),
        "nested lists": array.tolist(),
    }


@pytest.mark.parametrize("name", OF_ARRAYS)
def test_layout_does_not_matter(name: str):
    call, arrays = OF_ARRAYS[name]
    before = [a.copy() for a in arrays]
    want = call(*arrays)
    variants = [layouts(a) for a in arrays]
    for layout in variants[0]:
        got = call(*(v[layout] for v in variants))
        assert np.array_equal(got, want), layout
        assert got.flags.c_contiguous, layout
    assert all(np.array_equal(a, b) for a, b in zip(arrays, before, strict=True)), "input changed"


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("name", ["opacity", "blend_tiles"])
def test_float_dtypes_are_kept(name: str, dtype: type):
    call, arrays = OF_ARRAYS[name]
    assert call(*(a.astype(dtype) for a in arrays)).dtype == dtype


@pytest.mark.parametrize("name", OF_ARRAYS)
@pytest.mark.parametrize("dtype", [complex, bool, object, "U4", "M8[s]"])
def test_other_dtypes_are_refused_by_name(name: str, dtype: Any):
    call, arrays = OF_ARRAYS[name]
    wrong = [np.zeros(a.shape).astype(dtype) for a in arrays]
    argument = {
        "advance_phase": "phase", "temporal_filter": "amplitude", "inverse_transform": "amplitude",
        "blend_tiles": "tiles", "opacity": "field", "drift per tile": "drift",
        "shortest": "shortest",
    }[name]  # fmt: skip
    with pytest.raises((TypeError, ValueError), match=argument):
        call(*wrong)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize(
    "options",
    [
        {"shape": (300, 257)},
        {"shape": (300, 257), "tile": 31, "overlap": 16, "wavelengths": (3.0, 31.0)},
        {"shape": (512, 512), "tile": 512, "overlap": 0},
        {"shape": (300, 257), "velocity": (9.0, 14.0), "alias": "cut", "shutter": 1.0,
         "jitter": True},
        {"shape": (64, 64)},
    ],
)  # fmt: skip
def test_bits_do_not_depend_on_threads(options: dict, dtype: type, threads):
    frames = []
    for count in (1, 2, 3, 8):
        threads(count)
        frames.append(fl.spectral.field(**options, drift=(1.0, 7.0), seed=2, dtype=dtype))
        frames.append(fl.spectral.alpha(**options, drift=(1.0, 7.0), seed=2, dtype=dtype))
    for field, alpha in zip(frames[2::2], frames[3::2], strict=True):
        assert field.tobytes() == frames[0].tobytes()
        assert alpha.tobytes() == frames[1].tobytes()


def test_steps_do_not_depend_on_threads(threads):
    table = twin.band_amplitude((300, 257))
    phase = twin.random_phase((300, 257), seed=1)
    tiles = np.random.default_rng(0).standard_normal((7, 5, 64, 64))
    results = []
    for count in (1, 2, 3):
        threads(count)
        results.append(
            [
                fl.spectral.inverse_transform(table, phase).tobytes(),
                fl.spectral.advance_phase(phase, (1.0, 2.0)).tobytes(),
                fl.spectral.temporal_filter(table, (9.0, 20.0), renormalise=True).tobytes(),
                fl.spectral.blend_tiles(tiles, (388, 280)).tobytes(),
                fl.spectral.opacity(phase).tobytes(),
                fl.spectral.random_phase((300, 257), seed=1).tobytes(),
                fl.spectral.band_amplitude((300, 257)).tobytes(),
            ]
        )
    assert results[0] == results[1] == results[2]


def test_frames_in_any_order_are_the_same():
    # A frame is a pure function of its arguments: no state is left behind by other frames.
    def frame(t: int) -> bytes:
        return fl.spectral.field((90, 70), drift=(1.1 * t, 2.3 * t), seed=2).tobytes()

    forward = [frame(t) for t in range(30)]
    order = np.random.default_rng(5).permutation(30)
    assert all(frame(int(t)) == forward[t] for t in order)
