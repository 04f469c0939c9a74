"""The picture of docs/concepts.md: spectra in space and time of two textures and of all flakes.

python docs/make_spectra.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

import flurries as fl
from flurries import io

IMAGES = Path(__file__).parent / "images"

# Snow straight down before a camera that stands; px, frames, metres, metres per second.
SIZE, FRAMES, FOCAL, FALL = (160, 128), 192, 400.0, 1.2
NEAR, FAR = 4.0, 32.0
Floats = npt.NDArray[np.float64]


def effects() -> list[fl.effects.TentSnow | fl.Snow]:
    """Return the tent's texture from `NEAR` to `FAR`, and flakes there: synthesized, and drawn."""
    tent = fl.effects.TentSnow(
        flakes=0, haze=0.0, wind=(0.0, 0.0, 0.0), fall=FALL, near_depth=NEAR, shutter=0.0,
        alias="keep", wavelengths=(4.0, 32.0), tile=128, overlap=40,
    )  # fmt: skip
    flakes = [
        fl.Snow(
            density=60.0, wind=(0.0, 0.0, 0.0), fall=FALL, near=NEAR, far=FAR, shutter=0.0,
            sway=(0.0, 1.0), flake_size=(0.009, 0.009, 0.009), method=method,
        )
        for method in ("flakes", "simulated")
    ]  # fmt: skip
    return [tent, *flakes]


def spectrum(effect: fl.effects.TentSnow | fl.Snow) -> Floats:
    """Return the power by frequency in time (down) and along y (across), each in fftshift order."""
    scene = fl.Scene(size=SIZE, camera=fl.Camera(FOCAL), effects=[effect], seed=2)
    film = np.stack([scene.layers(t).alpha for t in range(FRAMES)]).astype(np.float64)
    film -= film.mean()
    window = np.hanning(FRAMES)[:, None, None] * np.hanning(SIZE[1])[:, None]
    # Waves along y alone: the mean over columns, of runs as short as the picture has many of.
    runs = film.reshape(FRAMES, SIZE[1], SIZE[0] // 8, 8).mean(axis=3)
    power = np.abs(np.fft.fft2(runs * window, axes=(0, 1))) ** 2
    return np.asarray(np.fft.fftshift(power.mean(axis=2)))


def panel(power: Floats, width: int = 384) -> npt.NDArray[np.uint8]:
    """Return a picture of a spectrum, and thin lines where flakes at NEAR and FAR are."""
    shown = np.log10(power + 1e-12)
    top = np.percentile(shown, 99.7)
    gray = np.clip((shown - top) / 3.5 + 1.0, 0.0, 1.0)
    rows, cols = gray.shape
    step_y, step_x = width / rows, width / cols
    y = (np.arange(width) / step_y).astype(int)
    x = (np.arange(width) / step_x).astype(int)
    picture = np.repeat((255 * gray[y][:, x])[..., None], 3, axis=2)
    along = (np.arange(width) + 0.5) / width - 0.5
    for depth, color in ((NEAR, (255, 120, 40)), (FAR, (60, 160, 255))):
        # Flakes that move down by v px a frame: frequencies in time are -v times those in y.
        at = np.rint((0.5 - FOCAL * FALL / 30.0 / depth * along) * width - 0.5).astype(int)
        inside = (at >= 0) & (at < width) & (np.arange(width) % 6 < 3)
        picture[at[inside], np.arange(width)[inside]] = color
    return picture.astype(np.uint8)


def main() -> None:
    """Write the picture: the tent's texture, ours, every flake drawn."""
    gap = np.full((384, 8, 3), 255, np.uint8)
    panels = [panel(spectrum(effect)) for effect in effects()]
    io.write_picture(IMAGES / "spectra.jpg", np.hstack([panels[0], gap, panels[1], gap, panels[2]]))


if __name__ == "__main__":
    main()
