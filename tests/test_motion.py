"""Rendered frames move as commanded, measured by scikit-image, which knows nothing of waves."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.registration import phase_cross_correlation

import textured
from every import every

SIZE = 512
BANDS = [30.0, 15.0, 7.5, 4.2]
ANGLES = [0.0, 37.0, 90.0, 200.0, -60.0]
# Cycles between the two frames. A band's waves go different ways, so that the likeness to a rigid
# shift falls (.98, .91, .68 after 1/4, 1/2, 1 cycle): a quarter of a cycle is well inside.
STEP = 0.25


def moved_by(angle: float) -> np.ndarray:
    """(x, y) of one cycle in the direction of the angle."""
    return np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])


def measured(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Displacement (x, y) of the content in px, from the peak of the cross-correlation.

    Without whitening, which would weigh the rounding outside the band like the band itself.
    """
    shift, _, _ = phase_cross_correlation(first, second, upsample_factor=500, normalization=None)
    return -shift[::-1]


def check(displacement: np.ndarray, wavelength: float, angle: float) -> None:
    """Within 3 % and 0.5 degrees of the command, STEP cycles of the wave."""
    commanded = STEP * wavelength * moved_by(angle)
    speed = np.hypot(*displacement) / (STEP * wavelength)
    turn = np.arctan2(
        commanded[0] * displacement[1] - commanded[1] * displacement[0], commanded @ displacement
    )
    assert speed == pytest.approx(1.0, abs=0.03)
    assert abs(np.degrees(turn)) < 0.5


@every("angle", ANGLES)
@every("wavelength", BANDS)
def test_narrow_bands_move_as_commanded(wavelength: float, angle: float):
    # The drift is that of wavelengths[1], here the upper edge of the narrow band.
    band = (0.97 * wavelength, 1.03 * wavelength)
    drift = STEP * band[1] * moved_by(angle)
    first, second = (
        textured.field((SIZE, SIZE), drift=t * drift, seed=3, tile=SIZE, overlap=0,
                          wavelengths=band)
        for t in (0.0, 1.0)
    )  # fmt: skip
    check(measured(first, second), wavelength, angle)


def test_the_printed_sign_would_be_caught():
    # Negative control: Eq. 6 as printed moves the snow the other way.
    drift = STEP * 30.0 * moved_by(37.0)
    first, second = (
        textured.field((SIZE, SIZE), drift=t * drift, seed=3, tile=SIZE, overlap=0,
                          wavelengths=(29.1, 30.0))
        for t in (0.0, -1.0)
    )  # fmt: skip
    with pytest.raises(AssertionError):
        check(measured(first, second), 29.5, 37.0)
