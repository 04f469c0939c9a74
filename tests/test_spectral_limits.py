"""The texture at its limits: bands without waves, huge numbers, and any number of threads.

Refusals of arguments that have the wrong type, shape or range are those of `test_public.py`.
"""

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl
import textured
from every import every

S = fl.spectral
ONES = np.ones((16, 16))
FRAME: dict[str, Any] = {"drift": (1.0, 1.0), "seed": 1, "tile": 32}


@every("size", [1, 2, 3, 4])
@every("name", ["band_amplitude", "field", "alpha"])
def test_a_band_without_waves_is_refused(name: str, size: int):
    """The message names the size of the tile and the argument to change."""
    with warnings.catch_warnings(), pytest.raises(ValueError, match="wavelengths") as refusal:
        warnings.simplefilter("ignore", UserWarning)
        if name == "band_amplitude":
            S.band_amplitude((size, size))
        else:
            getattr(textured, name)((40, 30), drift=(1.0, 2.0), seed=1, tile=size, overlap=0)
    assert str(size) in str(refusal.value)


@pytest.mark.parametrize("name", ["field", "alpha"])
def test_a_band_longer_than_the_tile_warns(name: str):
    with pytest.warns(UserWarning, match="wavelengths") as warned:
        getattr(S, name)((40, 30), drift=(1.0, 2.0), seed=1, texture=S.Texture(tile=24))
    # Shown at the caller's line, not somewhere inside.
    assert [w.filename for w in warned] == [__file__]


HUGE = 1.7e308
EXTREME: dict[str, Callable[[], Any]] = {
    **{f"drift {v}": lambda v=v: textured.field((40, 30), **{**FRAME, "drift": (v, -v)})
       for v in (1e-310, 1e15, 1e100, HUGE)},
    "velocity, cut": lambda: textured.field((40, 30), **FRAME, velocity=(HUGE, HUGE), alias="cut"),
    "velocity": lambda: textured.field((40, 30), **FRAME, velocity=(HUGE, HUGE), shutter=1.0),
    "shift_rate": lambda: textured.field((40, 30), **FRAME, velocity=(1.0, 1.0),
                                  shift_rate=(HUGE, -HUGE), shutter=1.0),
    "tent_rate": lambda: S.tent_rate((16, 16), (HUGE, HUGE), wavelength_max=1e-300),
    "tent_rate, tiny": lambda: S.tent_rate((16, 16), (1.0, 1.0), wavelength_max=5e-324),
    "advance_phase": lambda: S.advance_phase(ONES, (1e300, 1.0), wavelength_max=1e-10),
    "advance_phase of many turns": lambda: S.advance_phase(1e308 * ONES, (1.0, 1.0)),
    "temporal_filter": lambda: S.temporal_filter(1e200 * ONES, (9.0, 9.0), renormalise=True),
    "inverse_transform": lambda: S.inverse_transform(1e39 * ONES, 0 * ONES),
    "velocity_from_paper": lambda: S.velocity_from_paper(1e308, 0.0, period=1e-10),
    "exponent": lambda: S.band_amplitude((32, 32), exponent=1e308),
    "volume": lambda: S.volume(4, 16, (1e100, -1e99), seed=1, wavelengths=(2.0, 8.0)),
    "opacity": lambda: S.opacity(np.array([[HUGE, -HUGE]]), spread=1e-300),
    "tile_drift": lambda: fl.camera.tile_drift(
        (64, 64), (1e308, 0.0, 1e308), fl.camera.Camera(600.0), near_depth=1e-10
    ),
}  # fmt: skip


@every("name", EXTREME)
def test_extreme_but_finite_numbers_never_give_nan(name: str):
    # Where a phase has lost all its digits the picture is another one; where a product leaves the
    # range of the numbers a refusal is as good. NaN in the picture is not.
    with warnings.catch_warnings():
        # That a drift is too far to hold its phases is said by a warning; see the next test.
        warnings.simplefilter("ignore", UserWarning)
        try:
            result = EXTREME[name]()
        except ValueError:
            return
    assert np.isfinite(result).all()


@pytest.mark.parametrize("cycles, warned", [(0.9e12, 0), (1.1e12, 1)])
def test_a_drift_that_loses_its_phases_is_warned_of(cycles: float, warned: int):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        S.field((40, 30), drift=(0.0, cycles * 32.0), seed=1)
        S.advance_phase(ONES, (cycles * 32.0, 0.0))
    assert [w.filename for w in caught] == [__file__] * (2 * warned)
