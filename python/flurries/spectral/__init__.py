"""Falling snow as a texture whose spectrum lies on the tent surface (Langer 2004, sections 3-7).

The steps are here one by one, on NumPy arrays, and :func:`field` and :func:`alpha` make a whole
frame of overlapping tiles in one pass. `shape` is (H, W) in pixels, of a tile or of a picture. Wave
tables (H, W) are in ``numpy.fft.fftfreq`` order, x right and y down; phases and rates are in
cycles, lengths in pixels.

Two vectors move the texture, both in pixels of the picture's content and both accumulated since
time 0: the *drift* is the displacement of the longest wave, ``wavelengths[1]`` or `wavelength_max`
(the nearest snow); a wave of wavelength L moves by ``drift * L`` over it. The *shift* is the
displacement of all waves alike (a turning camera). What has a velocity moves by it in a frame.
"""

from flurries.spectral.flakes import flake_patterns, optical_depth
from flurries.spectral.frame import alpha, field, movie
from flurries.spectral.tables import (
    BANDS,
    advance_phase,
    band_amplitude,
    random_phase,
    temporal_filter,
    tent_rate,
    velocity_from_paper,
)
from flurries.spectral.texture import Texture, cloud
from flurries.spectral.tiles import blend_tiles, inverse_transform, opacity, tile_starts
from flurries.spectral.volume import export_loop, loop, volume

__all__ = [
    "BANDS", "Texture", "advance_phase", "alpha", "band_amplitude", "blend_tiles", "cloud",
    "export_loop", "field", "flake_patterns", "inverse_transform", "loop", "movie", "opacity",
    "optical_depth", "random_phase", "temporal_filter", "tent_rate", "tile_starts",
    "velocity_from_paper", "volume",
]  # fmt: skip
