"""A refusal of one number among many says which it is and where."""

import numpy as np
import pytest

import flurries as fl

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
