"""Pictures for a screen: what notebooks and the viewer show."""

import base64
import html
import io
from collections.abc import Iterable, Sequence

import numpy as np

from flurries._contract import Array
from flurries.io.color import light_of, linear_to_srgb

QUALITY = 90

# Pixels of the longer side of a picture in a notebook's output; larger frames are thinned out.
LONGEST = 640


def on_screen(picture: Array) -> Array:
    """Return a frame as uint8 display values, (H, W, 3); what is transparent is black."""
    if picture.shape[2] == 4:
        picture = light_of(picture)[..., :3]
    if picture.dtype == np.uint8:
        return picture
    if picture.dtype == np.uint16:
        return np.asarray((picture.astype(np.uint32) + 128) // 257, np.uint8)
    display = linear_to_srgb(np.nan_to_num(picture))
    return np.asarray(np.clip(display, 0.0, 1.0) * 255.0 + 0.5, np.uint8)


def jpeg(picture: Array) -> bytes:
    """Return a picture as JPEG; colors at full resolution, since flakes are a pixel or two."""
    from PIL import Image

    target, image = io.BytesIO(), Image.fromarray(np.ascontiguousarray(picture))
    image.save(target, "JPEG", quality=QUALITY, subsampling=0)
    return target.getvalue()


def figure(picture: Array) -> str:
    """Return a frame as an element of HTML that needs no other file."""
    step = -(-max(picture.shape[:2]) // LONGEST)
    data = base64.b64encode(jpeg(on_screen(picture[::step, ::step]))).decode()
    return f"<img style='max-width:100%' src='data:image/jpeg;base64,{data}'>"


def listing(rows: Iterable[Sequence[str]]) -> str:
    """Return rows of text, with what they are about first, as a table of HTML."""
    cell = "<td style='padding:2px 10px;text-align:left'>"
    lines = (
        f"<tr>{cell}<b>{html.escape(row[0])}</b></td>"
        + "".join(f"{cell}{html.escape(text)}</td>" for text in row[1:])
        + "</tr>"
        for row in rows
    )
    return f"<table>{''.join(lines)}</table>"
