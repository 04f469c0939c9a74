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

    "rocket" starts at night, 640 x 427 px, public domain (SpaceX). "coffee" stands in daylight, 600
    x 400 px, CC0 (Rachel Michetti). It is fitted to a `size` (width, height) as by
    :func:`flurries.io.fit`.
    """
    choice("name", name, NAMES)
    pixels = read_picture(Path(__file__).with_name(f"{name}.jpg")).pixels
    return pixels if size is None else fit(pixels, size)
