"""Writes docs/images/edges.png: a pole and a hill in fog and snow, four times as large as made.

python docs/make_edges.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import flurries as fl
from flurries import io

FILE = Path(__file__).parent / "images" / "edges.png"
H, W, FINE, ZOOM = 90, 120, 16, 4


def filtered(plane: np.ndarray) -> np.ndarray:
    """Return the means of pixels of a plane that is `FINE` times as fine."""
    return plane.reshape(H, FINE, W, FINE).mean(axis=(1, 3)).astype(np.float32)


def main() -> None:
    y, x = ((one + 0.5) / FINE for one in np.mgrid[: H * FINE, : W * FINE])
    pole = abs(x - 44.0 - 0.21 * y) < 1.5
    near = pole | (62.0 + 10.0 * np.sin(x / 19.0) < y)
    depth, cover = filtered(np.where(near, 6.0, 1e10)), filtered(near)
    plate = (60.0 + 130.0 * (1.0 - cover[..., None])).repeat(3, axis=2).astype(np.uint8)
    rows = []
    for effect in (fl.Mist("fog", visibility=40.0), fl.Snow("heavy")):
        # A depth of one side or the other has no edges: what every pixel got before.
        hard = np.where(depth < 6.6, 6.0, 1e10).astype(np.float32)
        shown = [
            fl.Scene(plate, effects=effect, depth=one, camera=fl.Camera(900.0), lens=None).render(3)
            for one in (hard, depth)
        ]
        rows.append(np.hstack([one.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1) for one in shown]))
    io.write_picture(FILE, np.vstack(rows))


if __name__ == "__main__":
    main()
