"""Mist with structure: its spectrum, its mean, its ends, its motion and its light."""

import numpy as np
import pytest

import flurries as fl
from measure import cover

FOCAL = 600.0


def depth_of(effect, shape=(256, 256), t=0.0, *, seed=0, **about):
    about = {"camera": fl.Camera(FOCAL), **about}
    shown = fl.Scene(np.zeros((*shape, 3), np.float32), effects=[effect], seed=seed, **about)
    return -np.log1p(-cover(shown, t).astype(np.float64))


def spectrum_of(planes):
    """Return wavelengths, from a fourth of a window to 2 px, and the power over k^(-11/3)."""
    height, width = planes[0].shape
    window = np.outer(np.hanning(height), np.hanning(width))
    centred = [(plane - np.average(plane, weights=window)) * window for plane in planes]
    power = sum(np.abs(np.fft.rfft2(plane)) ** 2 for plane in centred)
    k = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width)[None, :])
    edges = np.geomspace(4.0 / max(height, width), 0.5, 12)
    ring = np.digitize(k, edges)
    means = [(k[ring == i].mean(), power[ring == i].mean()) for i in range(1, len(edges))]
    at, found = np.transpose(means)
    return 1.0 / at, found * at ** (11.0 / 3.0)


@pytest.mark.parametrize("wall", [None, 25.0])
def test_the_optical_depth_has_one_spectrum_down_to_the_pixel(wall):
    def of(**how):
        mist = fl.Mist(**how)
        return spectrum_of([depth_of(mist, (256, 320), seed=s, depth=wall) for s in range(24)])

    waves, power = of(visibility=60.0, structure=0.6)
    slope = np.polyfit(np.log(waves), np.log(power), 1)[0]
    assert abs(slope) < 0.1
    # No step where the two grids hand over, from 16 to 32 px: 1.3 to 1.4 while one cut off there.
    below, above = (waves > 6.0) & (waves < 16.0), waves > 32.0
    assert abs(np.log(power[above].mean() / power[below].mean())) < 0.2
    # Of the paper's gas no such line is to be had: its particles have one size.
    waves, power = of(method="particles", box=20.0)
    assert abs(np.polyfit(np.log(waves), np.log(power), 1)[0]) > 1.0


@pytest.mark.parametrize("structure", [0.0, 0.6, 1.5])
def test_five_per_cent_of_contrast_are_left_at_the_visibility(structure):
    sy, sx = (np.mgrid[:128, :192] + 0.5 - [[[64]], [[96]]]) / 230.0
    # Black things at that distance, not depth, from the camera.
    far = (50.0 / np.sqrt(1 + sx**2 + sy**2)).astype(np.float32)
    mist = fl.Mist(visibility=50.0, structure=structure)
    about = {"camera": fl.Camera(230.0), "depth": far, "effects": [mist]}
    black = np.zeros((*far.shape, 3), np.float32)
    left = [1.0 - cover(fl.Scene(black, seed=seed, **about), 0.0).mean() for seed in range(6)]
    assert np.abs(np.array(left) - 0.05).max() < (0.003 if structure else 1e-6)
    assert abs(np.mean(left) - 0.05) < 0.0015


def test_a_bank_in_the_world_ends_softly_and_holds_what_its_box_did():
    mist = fl.Mist(visibility=20.0, structure=1e-9, box=(12.0, 8.0, 10.0), center=(0, 0, 60.0))
    depth = depth_of(mist, (256, 384))
    assert depth[[0, -1]].max() < 0.01 * depth.max() and depth[:, [0, -1]].max() < 0.01
    # No edge: one pixel differs little from the next, and the middle is the densest.
    assert max(np.abs(np.diff(depth, axis=axis)).max() for axis in (0, 1)) < 0.03 * depth.max()
    # The integral over the picture is the extinction times the volume, seen at 60 m.
    area = depth.sum() * (60.0 / FOCAL) ** 2
    assert abs(area / (mist.extinction() * 12.0 * 8.0 * 10.0) - 1.0) < 0.03
    gone = fl.Mist(visibility=20.0, structure=0.5, box=(12.0, 8.0, 10.0), center=(0, 0, -60.0))
    assert not depth_of(gone, (256, 384)).any(), "a bank behind the camera shows"


def test_ground_mist_thins_above_its_top():
    camera = fl.Camera(FOCAL)
    mist = fl.Mist(visibility=40.0, structure=1e-9, top=-2.0, falloff=0.5)
    depth = depth_of(mist, (256, 256), camera=camera, depth=20.0)
    rows = depth[:, 128]
    assert np.all(np.diff(rows) > -1e-9) and rows[0] < 0.01 * rows[-1]
    # The lowest ray against a plain sum along it; four slices stand for it.
    s = (np.arange(20000) + 0.5) / 20000 * (20.0 - mist.near) + mist.near
    height = -s * (255.5 - 128) / FOCAL
    profile = 1.0 / (1.0 + np.exp((height + 2.0) / 0.5))
    want = mist.extinction() * profile.mean() * (20.0 - mist.near) * np.hypot(1, 127.5 / FOCAL)
    assert abs(rows[-1] / want - 1.0) < 0.1
    # A camera that has climbed is farther above it.
    path = fl.CameraPath(camera, position=[[0.0, -5.0, 0.0], [0.0, -5.0, 0.0]])
    assert depth_of(mist, (256, 256), camera=path, depth=20.0).max() < 0.2 * depth.max()


def test_it_moves_with_the_wind_at_its_depth():
    moved = []
    for depths in ((4.0, 5.0), (16.0, 20.0)):
        mist = fl.Mist(visibility=60.0, structure=0.6, wind=(3.0, 0.0, 0.0), depths=depths)
        first, later = (depth_of(mist, (128, 128), t, seed=3) for t in (0.0, 6.0))
        across = np.fft.ifft2(np.fft.fft2(later) * np.conj(np.fft.fft2(first))).real
        moved.append(np.unravel_index(across.argmax(), across.shape)[1])
    # Slices of one effect stand at depths of their own, so ask for the mean's neighbourhood.
    assert moved[0] >= 2.5 * moved[1] > 0
    assert abs(moved[1] - 3.0 * 6.0 / 30.0 * FOCAL / 18.0) < 3.0


@pytest.mark.parametrize("t", [0.0, 900.0])
def test_both_eyes_of_a_camera_that_flies_see_one_mist(t):
    mist = fl.Mist(visibility=60.0, structure=0.6, depths=(16.0, 20.0), color=1.0)
    path = fl.CameraPath(fl.Camera(FOCAL), velocity=(0.0, 0.0, 3.0))
    film = fl.Scene(np.zeros((128, 256, 3), np.float32), camera=path, effects=[mist], seed=3)
    left, right = np.diff(film.stereo(t, distance=0.2, convergence=12.0), axis=2)[..., 0]
    across = np.fft.ifft2(np.fft.fft2(right) * np.conj(np.fft.fft2(left))).real
    # Their slice stands at 17 m; its short waves, which it shares with those beyond, at 31 m.
    least, most = (FOCAL * 0.2 * (1.0 / 12.0 - 1.0 / depth) for depth in (17.0, 32.0))
    assert least < np.unravel_index(across.argmax(), across.shape)[1] <= most
    assert across.max() > 0.9 * np.linalg.norm(left) * np.linalg.norm(right)


def test_the_side_to_the_sun_is_bright_by_the_gas_before_it():
    """Of a cloud in a slice of its own: all of its light against the way to the sun, summed."""
    # Of its six slices the fourth has its middle at 60 m.
    sides = (20.0, 12.0, 16.0)
    center = (0.0, 0.0, 60.0 - 0.15 * float(np.linalg.norm(sides)) / np.sqrt(3.0))
    cloud = fl.Mist(
        box=sides, center=center, visibility=12.0, structure=1e-9, scatter="even", forward=0.0,
        color=1.0, depths=(59.99, 60.01),
    )  # fmt: skip
    way = np.array([0.48, 0.6, 0.64])
    about = {"camera": fl.Camera(FOCAL), "sun": fl.scene.Sun(tuple(way), ambient=0.0)}
    black = np.zeros((160, 200, 3), np.float32)
    found = fl.Scene(black, effects=[cloud], **about).layers(0.0)
    at = np.mgrid[:160, :200][::-1].T.swapaxes(0, 1) + 0.5 - [100, 80]
    points = np.concatenate([at / FOCAL * 60.0, np.zeros((160, 200, 1))], axis=2)[::4, ::4]
    s = np.linspace(0.0, 60.0, 601)
    points[..., 2] = 60.0 - center[2]
    squared = sum(((points[..., a, None] - s * way[a]) * (3.6 / sides[a])) ** 2 for a in range(3))
    peak = 3.6**3 / (2.0 * np.pi) ** 1.5
    before = cloud.extinction() * peak * np.exp(-0.5 * squared).sum(axis=2) * (s[1] - s[0])
    alpha, image = found.alpha[::4, ::4], found.image[::4, ::4, 0]
    inside = alpha > 0.1 * alpha.max()
    # Beyond the outermost cells' middles the light is theirs.
    inside[:, :1] = inside[:, -1:] = False
    light = image[inside] / alpha[inside]
    np.testing.assert_allclose(light, np.exp(-before)[inside], atol=0.02)
    assert light.min() < 0.1 and light.max() > 0.7


def test_the_sky_lights_the_top_and_dims_below_it():
    plate = np.full((160, 200, 3), 0.3, np.float32)
    about = {"camera": fl.Camera(FOCAL), "depth": 20.0}

    def color(mist):
        scene = fl.Scene(plate, effects=[mist], **about)
        layer = scene.layers(0.0).layers["mist"].rgba.astype(np.float64)
        part = scene.render(0.0, region=np.s_[40:80, 90:150])
        np.testing.assert_array_equal(part, scene.render(0.0)[40:80, 90:150])
        shown = layer[..., 3] > 1e-4
        return np.where(shown, layer[..., 1] / np.maximum(layer[..., 3], 1e-4) / 0.3, 1.0)

    slab = {"visibility": 10.0, "top": -0.5, "falloff": 0.05, "depths": (15.0, 20.0), "box": 40.0}
    even = color(fl.Mist(structure=1e-9, **slab))
    # Far below its top there is the mean gas above: 1 - .45 (1 - exp(-.5)); at the top the sky.
    assert np.abs(even[-1] - (1.0 - 0.45 * (1.0 - np.exp(-0.5)))).max() < 1e-3
    assert np.abs(even[:20] - 1.0).max() < 0.01 and np.diff(even, axis=0).max() < 1e-4
    stirred = color(fl.Mist(structure=1.1, **slab))
    assert stirred.min() > 0.55 - 1e-6 and stirred.max() < 1.0 + 1e-6
    assert stirred[140:].std() > 0.02
    # Gas without a top, and gas with a color of its own, have one.
    assert np.abs(color(fl.Mist(visibility=10.0, structure=1.1)) - 1.0).max() < 1e-4
    own = color(fl.Mist(visibility=10.0, structure=1.1, top=-0.5, color=1.0))
    assert np.ptp(own[60:]) < 1e-4
