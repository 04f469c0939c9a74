"""JPEG, encoded in memory.

OpenImageIO's JPEG writer leaves errors to libjpeg's own handler, and that one ends the process: a
full disk would take the whole program with it. Pillow, which comes with scikit-image, encodes to
memory and raises; the bytes are then written like any other file.
"""

from __future__ import annotations

import io
from collections.abc import Mapping

from flurries.io.color import Array
from flurries.io.pictures.metadata import description

_DESCRIPTION, _SOFTWARE, _MOMENT = 0x010E, 0x0131, 0x0132  # Tags of EXIF.
_LONGEST_TEXT = 60_000


def encode_jpeg(
    pixels: Array, quality: int, strings: Mapping[str, str], profile: bytes | None = None
) -> bytes:
    """Return a baseline JPEG of (H, W, 1) or (H, W, 3) uint8, colors not subsampled."""
    from PIL import Image

    image = Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    tags = Image.Exif()
    text = description(strings)
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"metadata of {len(text)} characters do not fit into a JPEG; use EXR")
    if text:
        tags[_DESCRIPTION] = text
    tags[_SOFTWARE] = "flurries"
    tags[_MOMENT] = strings["DateTime"]
    buffer = io.BytesIO()
    image.save(
        buffer,
        format="JPEG",
        quality=quality,
        subsampling=0,
        exif=tags.tobytes(),
        icc_profile=profile,
    )
    return buffer.getvalue()
