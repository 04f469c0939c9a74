"""Rendered frames move as commanded, measured by scikit-image, which knows nothing of waves."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.registration import optical_flow_ilk, phase_cross_correlation

import flurries as fl
import twin
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
        fl.spectral.field((SIZE, SIZE), drift=t * drift, seed=3, tile=SIZE, overlap=0,
                          wavelengths=band)
        for t in (0.0, 1.0)
    )  # fmt: skip
    check(measured(first, second), wavelength, angle)


def band_pass(picture: np.ndarray, wavelength: float) -> np.ndarray:
    """The waves within 3 % of the wavelength, by masking the picture's Fourier transform."""
    f = np.fft.fftfreq(SIZE)
    radius = np.hypot(f[:, None], f[None, :]) * wavelength
    kept = (radius > 1 / 1.03) & (radius < 1 / 0.97)
    return np.fft.ifft2(np.fft.fft2(picture) * kept).real


def test_the_printed_sign_would_be_caught():
    # Negative control: Eq. 6 as printed moves the snow the other way.
    drift = STEP * 30.0 * moved_by(37.0)
    first, second = (
        fl.spectral.field((SIZE, SIZE), drift=t * drift, seed=3, tile=SIZE, overlap=0,
                          wavelengths=(29.1, 30.0))
        for t in (0.0, -1.0)
    )  # fmt: skip
    with pytest.raises(AssertionError):
        check(measured(first, second), 29.5, 37.0)


@pytest.mark.parametrize("tile", [64, 128])
def test_bands_move_across_tiles(tile: int):
    # The same on a tiled picture. Tiles stand while their waves pass, which holds the peak of the
    # correlation back by about wavelength/(5 tile): 1.5 % and 0.8 % here.
    drift = STEP * 8.2 * moved_by(70.0)
    first, second = (
        fl.spectral.field((SIZE, SIZE), drift=t * drift, seed=5, tile=tile, wavelengths=(7.0, 8.2))
        for t in (0.0, 1.0)
    )
    power = twin.band_amplitude((tile, tile), wavelengths=(7.0, 8.2)) ** 2
    f = np.hypot(*twin.frequencies((tile, tile)))
    # the least-squares shift of waves that each move by STEP/f
    check(measured(first, second), np.sum(power * f) / np.sum(power * f**2), 70.0)


def test_rings_move_by_themselves():
    # Wind by depth, here coarse waves to the right and fine waves down.
    first, second = (
        fl.spectral.field((SIZE, SIZE), drift=np.multiply(t, [(0.0, 8.0), (8.0, 0.0)]), seed=6,
                          tile=SIZE, overlap=0, ring_edges=(4.0, 12.0, 32.0))
        for t in (0.0, 1.0)
    )  # fmt: skip
    check(measured(band_pass(first, 7.5), band_pass(second, 7.5)), 7.5, 90.0)
    check(measured(band_pass(first, 24.0), band_pass(second, 24.0)), 24.0, 0.0)


def test_a_shift_moves_all_waves_alike():
    # A turning camera: the picture moves as a whole, by whole pixels exactly.
    options = {"drift": (0.0, 0.0), "seed": 7, "tile": 128, "overlap": 0, "dtype": np.float64}
    still = fl.spectral.field((128, 128), **options)
    moved = fl.spectral.field((128, 128), **options, shift=(5.0, -3.0))
    assert np.abs(moved - np.roll(still, (-3, 5), axis=(0, 1))).max() < 1e-12
    assert measured(still, fl.spectral.field((128, 128), **options, shift=(0.5, 1.25))) == (
        pytest.approx((0.5, 1.25), abs=0.01)
    )


def flow_from_focus(velocity: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Cosine between optical flow and the ray from the focus of expansion, and its distance."""
    camera = fl.camera.Camera(SIZE / 2)
    drift = fl.camera.tile_drift((SIZE, SIZE), velocity, camera, near_depth=3.0)
    first, second = (
        fl.spectral.field((SIZE, SIZE), drift=t * drift, seed=9, wavelengths=(4.0, 32.0))
        for t in (0.0, 1.0)
    )
    down, right = optical_flow_ilk(first, second, radius=15)
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5 - SIZE / 2
    x = x - camera.focal * velocity[0] / velocity[2]
    y = y - camera.focal * velocity[1] / velocity[2]
    distance = np.hypot(x, y)
    cosine = (right * x + down * y) / (np.hypot(right, down) * distance + 1e-30)
    return cosine, distance


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.06), (0.005, -0.01, 0.05)])
def test_forward_flight_flows_from_the_focus_of_expansion(velocity):
    # 0.06 per frame at a depth of 3: the nearest snow moves 2 % of its distance to the focus.
    cosine, distance = flow_from_focus(velocity)
    assert np.median(cosine[distance > 30.0]) >= 0.99
    assert np.mean(cosine[distance > 30.0] > 0.0) > 0.97
