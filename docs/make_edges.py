"""Writes docs/images/edges.png: a pole and a hill in fog and snow, four times as large as made.

python docs/make_edges.py; with --cost it prints what edges cost in a frame of 1080p instead, with
--alpha how far a plate with alpha is off at its edges, from the means of one 8 times as large.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import flurries as fl
from flurries import io

FILE = Path(__file__).parent / "images" / "edges.png"
H, W, FINE, ZOOM = 90, 120, 16, 4


def filtered(plane: np.ndarray) -> np.ndarray:
    """Return the means of pixels of a plane that is `FINE` times as fine."""
    return plane.reshape(H, FINE, W, FINE).mean(axis=(1, 3)).astype(np.float32)


def cost() -> None:
    """Print how long frames take before a hill's filtered depth, over that before a hard one."""
    y, x = np.mgrid[:1080, :1920].astype(np.float32)
    share = np.clip(y - 500.0 - 200.0 * np.sin(x / 300.0), 0.0, 1.0)
    print(f"{((share > 0) & (share < 1)).mean():.2%} of the pixels show two depths")
    for effect in (fl.Snow("heavy"), fl.Rain("downpour"), fl.Mist("fog")):
        least = [np.inf, np.inf]
        scenes = [
            fl.Scene(
                "#405060", size=(1920, 1080), effects=effect, depth=2000.0 - 1940.0 * one, fps=24
            )
            for one in (np.round(share), share)
        ]
        for t in range(16):
            which = (t + t // 2) % 2
            start = time.process_time()
            scenes[which].render(t)
            if t > 3:
                least[which] = min(least[which], time.process_time() - start)
        print(f"{effect.NAME}: {least[1] / least[0]:.2f}")


def alpha() -> None:
    """Print errors at the edges of a red pole before nothing, in fog, by how it is given."""
    ways: dict[str, list[float]] = {}
    fog = fl.Mist(visibility=40.0, structure=0.0, color=0.6)
    for lean in (0.0, 0.07, 0.21, 0.5):
        y, x = ((one + 0.5) / 8 for one in np.mgrid[: 64 * 8, : 96 * 8])
        near = abs(x - 30.0 - lean * y) < 1.5

        def mean(plane: np.ndarray) -> np.ndarray:
            return plane.reshape(64, 8, 96, 8, -1).mean(axis=(1, 3)).astype(np.float32).squeeze()

        def plate(cover: np.ndarray) -> np.ndarray:
            return (cover[..., None] * np.array((0.8, 0.1, 0.05, 1.0))).astype(np.float32)

        def shown(picture: np.ndarray, focal: float = 150.0, **more: object) -> np.ndarray:
            more |= {"camera": fl.Camera(focal), "lens": None}
            return fl.Scene(picture, effects=fog, **more).render(0)

        wanted = mean(shown(plate(near), 1200.0, depth=np.where(near, 6.0, 1e10)))
        cover = mean(near)
        edge, own = (cover > 0.0) & (cover < 1.0), plate(cover)
        pole = fl.scene.Foreground(own, depth=6.0)
        found = {
            "the depth of what covers a pixel at all": shown(
                own, depth=np.where(cover > 0, 6, 1e10)
            ),
            "the depth of what covers half of it": shown(own, depth=np.where(cover < 0.5, 1e10, 6)),
            "both depths by their shares": shown(own, depth=mean(np.where(near, 6.0, 1e10))),
            "as a picture at a depth (--matte pole.exr@6)": shown(
                np.zeros_like(own), depth=np.full(edge.shape, 1e10), foreground=[pole]
            ),
        }
        for name, picture in found.items():
            off = abs(picture - wanted)[edge]
            ways.setdefault(name, []).append(off[..., :3].max())
            ways.setdefault(name + ", opacity", []).append(off[..., 3].max())
    for name, most in ways.items():
        print(f"{name}: off by {max(most):.3f}")


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
    cost() if "--cost" in sys.argv else alpha() if "--alpha" in sys.argv else main()
