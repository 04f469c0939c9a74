"""Two photographs, free of rights, that come with the package; scikit-image distributes both."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from flurries._contract import Array, choice
from flurries.io.pictures.fitting import fit
from flurries.io.pictures.reader import read_picture

NAMES = ("rocket", "coffee")


def photograph(
    name: Literal["rocket", "coffee"] = "rocket", *, size: Sequence[int] | None = None
) -> Array:
    """Return a photograph that comes with the package, (height, width, 3) uint8, sRGB.

    Parameters
    ----------
    name : {"rocket", "coffee"}
        "rocket" starts at night, 640 x 427 px, public domain (SpaceX). "coffee" stands in daylight,
        600 x 400 px, CC0 (Rachel Michetti).
    size : (width, height), optional
        Pixels that it is fitted to, as :func:`flurries.io.fit` does; its own if not given.
    """
    choice("name", name, NAMES)
    pixels = read_picture(Path(__file__).with_name(f"{name}.jpg")).pixels
    return pixels if size is None else fit(pixels, size)
