"""Reference frames, made by the twin and never by the kernels: `python tests/make_frames.py`.

Each is a small float EXR in tests/frames. They change only on purpose, in a commit of their own:
they are what another machine, another NumPy and another year are compared with.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import skimage.data

import twin
import twin_camera

FRAMES = Path(__file__).parent / "frames"
WHITE = 250.0 / 255.0

# name: (shape, arguments of field). Between them they use every option of a frame.
FIELDS: dict[str, tuple[twin.Shape, dict[str, Any]]] = {
    "falling": ((160, 192), {"drift": (40.0, 250.0), "seed": 7}),
    "odd_tiles_linear": (
        (97, 131),
        {"drift": (-300.0, 12.5), "seed": -5, "tile": 31, "overlap": 15, "blend": "linear",
         "wavelengths": (3.0, 31.0)},
    ),
    "forward_flight": (
        (160, 160),
        {"drift": twin_camera.tile_drift(
            (160, 160), (0.3, -1.0, 6.0), twin_camera.Camera(160.0), near_depth=3.0),
         "shift": (3.25, -8.5), "seed": 2**63 - 1},
    ),
    "blurred_and_cut": (
        (128, 128),
        {"drift": (10.0, 20.0), "seed": 11, "velocity": (6.0, 18.0), "shift_rate": (0.5, 0.0),
         "alias": "soft", "shutter": 0.5, "jitter": True},
    ),
    "wind_by_depth": (
        (128, 128),
        {"drift": [(60.0, 0.0), (0.0, 60.0)], "ring_edges": (4.0, 11.0, 32.0), "seed": 12,
         "shortest": np.linspace(4.0, 14.0, 9).reshape(3, 3), "exponent": 0.8},
    ),
}  # fmt: skip

# name: (name of a field, arguments of opacity)
ALPHAS: dict[str, tuple[str, dict[str, Any]]] = {
    "alpha_default": ("falling", {}),
    "alpha_flakes": (
        "forward_flight", {"mean": 0.3, "spread": 2.0, "power": 3.0, "amount": 0.8}
    ),
}  # fmt: skip

# name: (name of an alpha, size of the picture)
COMPOSITES: dict[str, tuple[str, twin.Shape]] = {"snow_on_astronaut": ("alpha_default", (96, 112))}


def photograph(shape: twin.Shape) -> np.ndarray:
    """A crop of scikit-image's astronaut, (H, W, 3) in [0, 1], display values."""
    top, left = 40, 170
    crop = skimage.data.astronaut()[top : top + shape[0], left : left + shape[1]]
    return crop.astype(np.float64) / 255.0


def composite(background: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Eq. 7: snow*alpha + (1 - alpha)*background with snow = 250/255."""
    opacity = alpha[: background.shape[0], : background.shape[1], None]
    return WHITE * opacity + (1.0 - opacity) * background


def make() -> dict[str, np.ndarray]:
    """Every reference frame, by name."""
    frames = {name: twin.field(shape, **given) for name, (shape, given) in FIELDS.items()}
    for name, (source, given) in ALPHAS.items():
        frames[name] = twin.opacity(frames[source], **given)
    for name, (source, shape) in COMPOSITES.items():
        frames[name] = composite(photograph(shape), frames[source])
    return frames


def write(path: Path, frame: np.ndarray) -> None:
    """One float EXR, its rows in C order."""
    pixels = np.ascontiguousarray(frame, dtype=np.float32)
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], channels, "float")
    spec.channelnames = ("Y",) if channels == 1 else ("R", "G", "B")
    spec["compression"] = "zip"
    spec["DateTime"] = "2000:01:01 00:00:00"  # else every run would write other bytes
    output = oiio.ImageOutput.create(str(path))
    # Channels stand in an axis of their own: a 2-D array would be read with a wrong stride.
    shaped = pixels.reshape(*pixels.shape[:2], channels)
    if not (output.open(str(path), spec) and output.write_image(shaped) and output.close()):
        raise OSError(f"{path.name}: {output.geterror()}")


def read(name: str) -> np.ndarray:
    """A reference frame, (H, W) or (H, W, 3) float32."""
    path = FRAMES / f"{name}.exr"
    image = oiio.ImageInput.open(str(path))
    if image is None:
        raise OSError(f"{path.name}: {oiio.geterror()}")
    pixels = np.asarray(image.read_image("float"))
    image.close()
    return pixels[:, :, 0] if pixels.ndim == 3 and pixels.shape[2] == 1 else pixels


if __name__ == "__main__":
    FRAMES.mkdir(exist_ok=True)
    for name, frame in make().items():
        write(FRAMES / f"{name}.exr", frame)
        print(f"{name}: {frame.shape}, {(FRAMES / f'{name}.exr').stat().st_size // 1024} KiB")
