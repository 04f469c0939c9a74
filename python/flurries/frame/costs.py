"""The fixed cost model: nanoseconds of each operation on one thread of one machine.

Choices between methods follow these numbers and the scene, never a clock, so that all machines
choose alike. ``python benches/plan.py --constants`` measures every number again, by least squares
over runs of the kernels, and prints this table. Displayed times are these, scaled by a calibration
of the machine at hand (`flurries.frame.calibration`).
"""

from __future__ import annotations

from collections.abc import Mapping

# Nanoseconds for each operation, and what kind of work it is: "kernel" runs on all threads, "array"
# is NumPy's on one.
NANOSECONDS: dict[str, tuple[str, float]] = {
    # Texture, for each tile made: see flurries.spectral.operations.TileWork.
    "tile bin": ("kernel", 1.45),
    "tile multiply-add": ("kernel", 0.01),
    "tile fft": ("kernel", 0.0615),
    "large tile multiply-add": ("kernel", 0.073),
    "large tile fft": ("kernel", 0.16),
    "tile pixel": ("kernel", 0.1),
    "jittered bin": ("kernel", 23),
    "planned bin": ("kernel", 39.6),
    # Texture, for each pixel of the window.
    "texture pixel": ("kernel", 0.25),
    # ... before a depth: its farthest in each tile, and the tiles' fades.
    "limited pixel": ("array", 4.83),
    # Flakes: those of the box, those that touch the window, and runs of pixels in their rows, of
    # resting ones and of those that the shutter makes streaks of.
    "flake listed": ("array", 45),
    "flake placed": ("kernel", 60),
    "disc": ("kernel", 5),
    "disc run": ("kernel", 3.0),
    "streak": ("kernel", 220),
    "streak run": ("kernel", 33),
    # Gas: particles of the box, and pixels that they cover, of one color or of many.
    "gas placed": ("kernel", 100.0),
    "gas pixel": ("kernel", 6.05),
    "lit gas pixel": ("kernel", 6.3),
    # ... with structure, each pixel of a slice.
    "slice pixel": ("kernel", 3.9),
    "lit slice pixel": ("kernel", 12.0),
    # The four layers of a double cone, for each pixel.
    "cone pixel": ("kernel", 4.5),
    # Planes and pictures, for each pixel.
    "mask pixel": ("kernel", 0.535),
    # Color by places, and the light of each lamp.
    "shaded pixel": ("kernel", 4.0),
    "lit pixel": ("kernel", 3.0),
    "joined pixel": ("kernel", 0.2),
    # A square root, and a texture with flakes of 512 px: by these two machines are compared.
    "array number": ("array", 1.05),
    "weather": ("kernel", 1460000),
    "copied byte": ("array", 0.062),
    "array pixel": ("array", 0.135),
    "veil pixel": ("array", 2.26),
    "8 bit pixel": ("kernel", 0.35),
    "fused pixel": ("kernel", 0.17),
    "16 bit pixel": ("kernel", 0.45),
    "32 bit pixel": ("kernel", 0.85),
    # Of a layer with a linear color at each pixel, mixed in display values.
    "colored pixel": ("array", 43.0),
    "decoded pixel": ("array", 8.0),
    # Integers of display values to linear light, and back by the formula, or by a table.
    "decoded value": ("array", 1.2),
    "encoded value": ("array", 5.5),
    "looked up value": ("array", 2.13),
    # The texture of flakes: products of waves and phases, and pixels of tiles.
    "flake term": ("kernel", 0.25),
    "flake tile": ("kernel", 0.6),
    # What Python takes for a frame, an effect and a call of a kernel.
    "frame": ("array", 6400),
    "layer": ("array", 26000),
}


def milliseconds(work: Mapping[str, float], scales: Mapping[str, float] | None = None) -> float:
    """Return the time of some operations; `scales` are factors by kind of work.

    An operation that the table does not have counts as 0.
    """
    total = 0.0
    for name, number in work.items():
        kind, each = NANOSECONDS.get(name, ("array", 0.0))
        total += number * each * (1.0 if scales is None else scales.get(kind, 1.0))
    return 1e-6 * total
