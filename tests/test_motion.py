"""Rendered frames move as commanded, measured by scikit-image, which knows nothing of waves."""

import numpy as np
import pytest
from skimage.registration import phase_cross_correlation

import textured
from every import every

SIZE = 512
# Cycles between the two frames: a band's waves go different ways, and far apart they are unlike.
STEP = 0.25


def check(wavelength: float, angle: float, times: tuple[float, float]) -> None:
    """A narrow band moves by STEP cycles within 3 %, in its direction within half a degree."""
    way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    # The drift is that of wavelengths[1], here the upper edge of the band.
    band = (0.97 * wavelength, 1.03 * wavelength)
    torus = {"seed": 3, "tile": SIZE, "overlap": 0, "wavelengths": band}
    first, second = (
        textured.field((SIZE, SIZE), drift=t * STEP * band[1] * way, **torus) for t in times
    )
    # Without whitening, which would weigh the rounding outside the band like the band itself.
    shift, _, _ = phase_cross_correlation(first, second, upsample_factor=500, normalization=None)
    across, down = -shift[::-1]
    assert np.hypot(across, down) == pytest.approx(STEP * wavelength, rel=0.03)
    assert abs(np.degrees(np.angle((across + 1j * down) / (way[0] + 1j * way[1])))) < 0.5


@every("angle", [0.0, 37.0, 90.0, 200.0, -60.0])
@every("wavelength", [30.0, 7.5, 4.2])
def test_narrow_bands_move_as_commanded(wavelength: float, angle: float):
    check(wavelength, angle, (0.0, 1.0))


def test_the_printed_sign_would_be_caught():
    # Negative control: Eq. 6 as printed moves the snow the other way.
    with pytest.raises(AssertionError):
        check(29.5, 37.0, (0.0, -1.0))
