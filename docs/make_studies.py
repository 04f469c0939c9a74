"""Make the pictures of the studies: textures on polygons, and the snow that they stand for.

python docs/make_studies.py [polygon ...]
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from skimage import data, transform

import flurries as fl
from flurries import io

IMAGES = Path(__file__).parent / "images"


def save(name: str, picture: np.ndarray) -> None:
    """Write display values from 0 to 1 as a JPEG."""
    IMAGES.mkdir(exist_ok=True)
    pixels = np.rint(255 * np.clip(picture, 0.0, 1.0)).astype(np.uint8)
    io.write_picture(IMAGES / name, pixels, quality=88)


# A small 3-D scene, as in the paper's first demonstration --------------------------------------

SIZE = (480, 800)  # rows, columns
FOCAL = 700.0


def seen(plane: np.ndarray, corner: np.ndarray, across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Return the rows, columns where a polygon of the scene shows its picture, (2, H, W).

    The polygon is corner + u across + v down, u and v from 0 to 1, x right, y down, z forward; NaN
    is beside it.
    """
    rows, cols = np.mgrid[: SIZE[0], : SIZE[1]] + 0.5
    rays = np.stack([(cols - SIZE[1] / 2) / FOCAL, (rows - SIZE[0] / 2) / FOCAL, np.ones(SIZE)])
    # corner + u across + v down = depth * ray
    system = np.linalg.inv(np.stack([across, down, corner], axis=1))
    u, v, w = np.einsum("ij,jhw->ihw", system, rays)
    u, v = u / w, v / w
    inside = (w > 0) & (u >= 0) & (u < 1) & (v >= 0) & (v < 1)
    height, width = plane.shape[:2]
    return np.where(inside, np.stack([v * height, u * width]) - 0.5, np.nan)


def mapped(plane: np.ndarray, at: np.ndarray, mode: str) -> np.ndarray:
    """Return a picture as the polygon shows it; 0 beside it."""
    places = np.where(np.isnan(at), -1e6, at)
    sample = np.stack(
        [
            transform.warp(channel, places, order=1, mode=mode, preserve_range=True)
            for channel in np.atleast_3d(plane).transpose(2, 0, 1)
        ],
        axis=-1,
    )
    sample[np.isnan(at[0])] = 0.0
    return sample if plane.ndim == 3 else sample[..., 0]


def polygon() -> None:
    """Exported textures tiled over the far polygon of a room, flakes in front of it.

    Reads the files as an engine would: 8-bit luminance, repeated 3 x 2 times across a canvas that
    stands at an angle. Frames 0 and 20 of a loop of 60.
    """
    with tempfile.TemporaryDirectory() as folder:
        *files, side = fl.spectral.export_loop(
            Path(folder) / "snow_%04d.png", 60, (128, 128), (1.2, 3.0), seed=3,
            wavelengths=(2.5, 20.0), exponent=0.85, mean=0.15, spread=2.2,
        )  # fmt: skip
        textures = [io.read_picture(file).pixels for file in files]
        described = json.loads(side.read_text())
    print("polygon:", {key: described[key] for key in ("size", "frames", "mean_opacity")})
    painting = io.fit(data.rocket(), (768, 512)) / 255.0
    wall = np.full((4, 4, 3), (0.33, 0.27, 0.24))
    floor = np.full((4, 4, 3), (0.20, 0.16, 0.13))
    room = (np.array([-9.0, -5.0, 11.0]), np.array([18.0, 0, 0]), np.array([0, 10.0, 0]))
    ground = (np.array([-9.0, 2.2, 3.0]), np.array([18.0, 0, 0]), np.array([0, 0, 9.0]))
    canvas = (np.array([-2.7, -1.85, 6.4]), np.array([6.0, 0, 1.9]), np.array([0.0, 3.6, 0.0]))
    images = []
    for t in (0, 20):
        image = mapped(wall, seen(wall, *room), "edge")
        for plane, place in ((floor, ground), (painting, canvas)):
            at = seen(plane, *place)
            image = np.where(np.isnan(at[0])[..., None], image, mapped(plane, at, "edge"))
            if plane is painting:
                texture = textures[t % len(textures)]
                grey = (texture if texture.ndim == 2 else texture[..., 0]) / 255.0
                tiled = np.tile(grey, (2, 3))
                alpha = mapped(tiled, seen(tiled, *place), "wrap")
                image += alpha[..., None] * (250 / 255 - image)
        flakes = flakes_before(canvas, t)
        images.append(fl.composite.snow(image, flakes, intensity=250 / 255))
    save("polygon.jpg", np.hstack(images))


def flakes_before(canvas: tuple[np.ndarray, ...], t: int) -> np.ndarray:
    """Return the alpha of 900 flakes that fall between the eye and the canvas."""
    corner, across, _ = canvas
    box, middle = (9.0, 5.0, 5.0), (0.0, -0.3, 3.6)
    points = fl.particles.positions(
        900, box, seed=4, velocity=(0.012, 0.045, 0.0), time=float(t), center=middle,
        sway=(0.03, 0.15),
    )  # fmt: skip
    fade = fl.particles.edge_fade(points, box, center=middle)
    normal = np.cross(across, (0.0, 1.0, 0.0))
    before = (points - corner) @ normal * np.sign(-corner @ normal) > 0.0
    return fl.particles.splat(
        SIZE, points[before], 0.012, fl.Camera(FOCAL), opacity=0.85 * fade[before],
        velocity=(0.012, 0.045, 0.0), shutter=0.5, near=1.0, dtype=np.float64,
    )  # fmt: skip


STUDIES: dict[str, Callable[[], None]] = {"polygon": polygon}


def main() -> None:
    """Make the studies named on the command line, or all."""
    for name in sys.argv[1:] or STUDIES:
        STUDIES[name]()


if __name__ == "__main__":
    main()
