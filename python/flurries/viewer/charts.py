"""The spectrum and the tent of one tile, as the functions of `flurries.spectral` give them."""

import math
from dataclasses import dataclass

import numpy as np

from flurries import spectral
from flurries._contract import Array
from flurries.effects.field import Field
from flurries.scene.scene import Scene

# Bins a side: enough for a smooth surface, few enough to draw while a slider is dragged.
_FEWEST, _MOST = 32, 56


@dataclass(frozen=True)
class Chart:
    rate: Array  # Cycles per frame of each wave.
    power: Array  # Squared amplitude of each wave over the largest without aliasing and shutter.
    velocity: tuple[float, float]  # Pixels per frame of the longest wave.
    band: tuple[float, float]  # Pixels.
    tile: tuple[int, int, int]  # The tile in pixels.
    kept: float  # Share of the power that aliasing and shutter leave.


def field_of(effect: object) -> Field | None:
    return getattr(getattr(getattr(effect, "parts", None), "texture", None), "field", None)


def chart(scene: Scene, t: float, index: int, at: tuple[float, float]) -> Chart | None:
    if not 0 <= index < len(scene.effects):
        return None
    effect = scene.effects[index]
    frame = next((frame for one, frame in scene._program.views(t) if one is effect), None)
    field = field_of(effect)
    if field is None or frame is None:
        return None
    asked = field.request(frame, field.motion.way(frame))
    row, top = _nearest(asked.shape[0], asked.tile[0], asked.overlap, at[1])
    col, left = _nearest(asked.shape[1], asked.tile[1], asked.overlap, at[0])
    # The ring of the longest waves is the last.
    last = asked.velocity.shape
    x, y = asked.velocity[min(row, last[0] - 1), min(col, last[1] - 1), -1].tolist()
    velocity, (shortest, longest) = (x, y), asked.wavelengths
    side = min(max(asked.tile[0], _FEWEST), _MOST)
    size = (side, side)
    tent = spectral.tent_rate(size, velocity, wavelength_max=longest)
    band = (max(shortest, 2.0), min(longest, float(side)))
    amplitude = spectral.band_amplitude(size, wavelengths=band, exponent=asked.exponent)
    left_over = spectral.temporal_filter(
        amplitude, velocity, alias=asked.alias, shutter=asked.shutter, wavelength_max=longest
    )
    power = left_over**2 / np.max(amplitude**2)
    power[amplitude == 0.0] = math.nan
    rates, powers = (np.fft.fftshift(plane).astype(np.float32) for plane in (tent, power))
    kept = float(np.sum(left_over**2))
    return Chart(rates, powers, velocity, asked.wavelengths, (left, top, asked.tile[0]), kept)


def _nearest(length: int, tile: int, overlap: int, share: float) -> tuple[int, int]:
    """Return the number and the start of the tile whose middle is nearest to a place."""
    starts = spectral.tile_starts(length, tile=tile, overlap=overlap)
    best = int(np.argmin(np.abs(starts + tile / 2 - share * length)))
    return best, int(starts[best])
