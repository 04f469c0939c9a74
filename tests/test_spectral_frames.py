"""The kernels against reference frames in files, which another program reads back."""

from __future__ import annotations

from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from skimage.metrics import structural_similarity

import flurries as fl
import make_frames
import twin
from every import every

# The files hold float32, the twin works in float64: half a unit in the last place of a value below
# 8 is 2.4e-7. The kernels in float32 may add 2e-6 (see test_spectral_field.py).
LIMIT = {np.float64: 3e-7, np.float32: 2.3e-6}
DTYPES = [np.float64, np.float32]


def agrees(got: np.ndarray, want: np.ndarray, limit: float) -> bool:
    """Every pixel within the limit, and a structural similarity of 1 to six digits."""
    assert got.shape == want.shape
    close = np.abs(got.astype(np.float64) - want).max() <= limit
    similar = structural_similarity(
        got.astype(np.float64), want.astype(np.float64), data_range=float(np.ptp(want)),
        channel_axis=2 if want.ndim == 3 else None,
    )  # fmt: skip
    return bool(close and similar > 1.0 - 1e-6)


def field(name: str, dtype: type, **changes: Any) -> np.ndarray:
    shape, given = make_frames.FIELDS[name]
    return fl.spectral.field(shape, **{**given, **changes}, dtype=dtype)


def alpha(name: str, dtype: type) -> np.ndarray:
    source, given = make_frames.ALPHAS[name]
    shape, arguments = make_frames.FIELDS[source]
    return fl.spectral.alpha(shape, **arguments, **given, dtype=dtype)


@every("dtype", DTYPES)
@every("name", make_frames.FIELDS)
def test_field_is_the_reference(name: str, dtype: type):
    assert agrees(field(name, dtype), make_frames.read(name), LIMIT[dtype])


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", make_frames.ALPHAS)
def test_alpha_is_the_reference(name: str, dtype: type):
    assert agrees(alpha(name, dtype), make_frames.read(name), LIMIT[dtype])


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("name", make_frames.COMPOSITES)
def test_composite_is_the_reference(name: str, dtype: type):
    source, shape = make_frames.COMPOSITES[name]
    got = make_frames.composite(make_frames.photograph(shape), alpha(source, dtype))
    assert agrees(got, make_frames.read(name), LIMIT[dtype])


def turned(name: str) -> Any:
    """The drift of a field, the other way."""
    return np.negative(make_frames.FIELDS[name][1]["drift"])


@every("name", make_frames.FIELDS)
def test_another_field_is_not_the_reference(name: str):
    # Negative control: the same comparison refuses the other direction, the next seed, half a pixel
    # of drift of the longest wave, the picture turned over, and one pixel that is off by 1e-5.
    want, seed = make_frames.read(name), make_frames.FIELDS[name][1]["seed"]
    others = [
        field(name, np.float64, drift=turned(name)),
        field(name, np.float64, seed=seed - 1),
        field(name, np.float64, drift=-turned(name) + 0.5),
        field(name, np.float64)[::-1],
        field(name, np.float64)[:, ::-1],
    ]
    spot = field(name, np.float64)
    spot[3, 4] += 1e-5
    for other in [*others, spot]:
        assert not agrees(other, want, LIMIT[np.float32])
    # and the similarity alone sees the wrong pictures too
    for other in others:
        assert structural_similarity(other, want.astype(float), data_range=np.ptp(want)) < 0.999


def test_another_composite_is_not_the_reference():
    want = make_frames.read("snow_on_astronaut")
    background = make_frames.photograph(want.shape[:2])
    shape, given = make_frames.FIELDS["falling"]
    other = fl.spectral.alpha(shape, **{**given, "seed": 8}, dtype=np.float64)
    assert not agrees(make_frames.composite(background, other), want, LIMIT[np.float32])
    assert not agrees(background, want, LIMIT[np.float32])


def test_the_files_are_what_the_twin_makes():
    # float32 in the file, rounding of another FFT library at most one unit more.
    made = make_frames.make()
    assert sorted(path.stem for path in make_frames.FRAMES.glob("*.exr")) == sorted(made)
    for name, frame in made.items():
        assert np.abs(frame - make_frames.read(name)).max() < 5e-7, name


@every("name", sorted(make_frames.make()))
def test_the_files_are_small_float_pictures(name: str):
    path = make_frames.FRAMES / f"{name}.exr"
    assert path.stat().st_size < 150 * 1024
    spec = oiio.ImageBuf(str(path)).spec()
    assert spec.format == oiio.FLOAT
    assert spec.channelnames == (("R", "G", "B") if name in make_frames.COMPOSITES else ("Y",))


def test_the_reference_itself_is_snow():
    # A file of zeros would agree with a kernel of zeros.
    falling = make_frames.read("falling").astype(np.float64)
    assert falling.std() == pytest.approx(1.0, abs=0.1)
    assert make_frames.read("alpha_default").mean() == pytest.approx(twin.opacity_mean(), abs=0.03)
