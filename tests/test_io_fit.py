"""Pictures are fitted to a size: where geometry says, in light, without rings."""

import numpy as np
import pytest
import skimage.data
import skimage.transform

from flurries.io import fit, linear_to_srgb
from stills import same_bits


def smooth(height, width):
    y, x = np.mgrid[:height, :width] + 0.5
    waves = [np.sin(x / 17 + 0.3) * np.cos(y / 13), np.cos(x / 23 - y / 19), np.sin(y / 29)]
    return (0.5 + 0.4 * np.stack(waves, axis=-1)).astype(np.float32)


@pytest.mark.parametrize("size", [(120, 75), (320, 200), (37, 90), (200, 31), (161, 100), (90, 90)])
@pytest.mark.parametrize("how", ["cover", "stretch", "contain"])
def test_fit_puts_things_where_geometry_says(size, how):
    picture = smooth(100, 160)
    width, height = size
    fitted = fit(picture, size, how)
    assert fitted.shape == (height, width, 3)
    assert fitted.dtype == np.float32
    across, down = width / 160, height / 100
    if how != "stretch":
        across = down = (max if how == "cover" else min)(across, down)
    # scikit-image counts from pixel centres: the middle of the frame is the middle of the picture.
    map_back = skimage.transform.AffineTransform(
        scale=(1 / across, 1 / down),
        translation=(79.5 - (width - 1) / 2 / across, 49.5 - (height - 1) / 2 / down),
    )
    wanted = skimage.transform.warp(
        picture, map_back, output_shape=(height, width), order=3, mode="edge"
    )
    inside = np.zeros((height, width), bool)
    rows, columns = min(height, round(100 * down)), min(width, round(160 * across))
    top, left = (height - rows) // 2, (width - columns) // 2
    inside[top + 4 : top + rows - 4, left + 4 : left + columns - 4] = True
    tolerance = np.full((height, width, 1), 0.004)
    if how != "stretch":
        # A kept aspect is exact to a pixel over the whole length, and exact in the middle; the
        # waves rise by at most 0.4 / 13 a pixel.
        y, x = np.abs(
            np.mgrid[:height, :width] - np.array([height - 1, width - 1])[:, None, None] / 2
        )
        tolerance[..., 0] += 0.4 / 13 * (y / (100 * down) / down + x / (160 * across) / across)
    assert (np.abs(fitted - wanted) <= tolerance)[inside].all()
    # The control: half a pixel beside it would show.
    shifted = fit(picture[:, 1:], size, how)
    assert not (np.abs(shifted - wanted) <= tolerance)[inside].all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("channels", [(), (1,), (3,), (4,)])
def test_fit_keeps_the_dtype_and_flat_areas(dtype, channels):
    whole = np.dtype(dtype).kind == "u"
    value = 77 if whole else 0.3
    picture = np.full((13, 17, *channels), value, dtype)
    fitted = fit(picture, (31, 9))
    assert fitted.shape == (9, 31, *channels)
    assert fitted.dtype == dtype
    np.testing.assert_allclose(fitted.astype(float), float(picture.flat[0]), rtol=1e-6)
    same = fit(picture, (17, 13))
    assert same_bits(same, picture)
    assert not np.may_share_memory(same, picture)


def test_fit_averages_light_and_not_display_values():
    board = np.indices((64, 64)).sum(axis=0) % 2 * np.uint8(255)
    middle = fit(board.astype(np.uint8), (8, 8))[2:-2, 2:-2]
    wanted = round(float(linear_to_srgb(0.5)) * 255)
    assert np.abs(middle.astype(int) - wanted).max() <= 1
    # The control: display values would average to 128.
    plain = fit(board.astype(np.uint8), (8, 8), encoding="linear")[2:-2, 2:-2]
    assert np.abs(plain.astype(int) - 128).max() <= 1


def test_fit_does_not_ring_and_keeps_light():
    stars = np.zeros((100, 100), np.float32)
    stars[::10, ::10] = 50
    for size in ((37, 37), (250, 250)):
        fitted = fit(stars, size)
        assert fitted.min() >= 0
        assert fitted.max() <= 50
    y, x = np.mgrid[:100, :100] - 49.5
    lamp = np.exp(-(x**2 + y**2) / 50).astype(np.float32)
    for size in ((37, 37), (250, 250)):
        assert abs(fit(lamp, size).mean() / lamp.mean() - 1) < 0.002


def test_fit_mixes_no_color_from_where_there_is_nothing():
    picture = np.zeros((40, 40, 4), np.uint8)
    picture[..., 1] = 255  # invisible green
    picture[10:30, 10:30] = [255, 0, 0, 255]
    fitted = fit(picture, (23, 23))
    seen = fitted[..., 3] > 10
    assert seen.sum() > 50
    assert fitted[seen][:, 1].max() <= 1
    assert fitted[seen][:, 0].min() >= 254


def test_contain_has_bars_and_cover_has_none():
    white = np.ones((50, 100, 4), np.float32)
    contained = fit(white, (60, 60), "contain")
    np.testing.assert_array_equal(contained[15:45], 1)
    np.testing.assert_array_equal(contained[:15], 0)
    np.testing.assert_array_equal(contained[45:], 0)
    upright = fit(white.swapaxes(0, 1), (60, 60), "contain")
    np.testing.assert_array_equal(upright, contained.swapaxes(0, 1))
    np.testing.assert_array_equal(fit(white, (61, 33), "cover"), 1)
    np.testing.assert_array_equal(fit(white, (3, 200), "contain").sum(axis=(0, 2)) > 0, True)
