"""The fixed cost model: nanoseconds of each operation on one thread of one machine.

Choices between methods follow these numbers and the scene, never a clock, so that all machines
choose alike. ``python benches/plan.py --constants`` measures every number again, by least squares
over runs of the kernels, and prints this table. Displayed times are these, scaled by a calibration
of the machine at hand (`flurries.plan.calibration`).
"""

from __future__ import annotations

from collections.abc import Mapping

# Nanoseconds for each operation, and what kind of work it is: "kernel" runs on all threads, "array"
# is NumPy's on one.
NANOSECONDS: dict[str, tuple[str, float]] = {
    # Texture, for each tile made: see flurries.spectral.operations.TileWork.
    "tile bin": ("kernel", 2.05),
    "tile multiply-add": ("kernel", 0.01),
    "tile fft": ("kernel", 0.0569),
    "large tile multiply-add": ("kernel", 0.109),
    "large tile fft": ("kernel", 0.194),
    "tile pixel": ("kernel", 0.1),
    "jittered bin": ("kernel", 23),
    "planned bin": ("kernel", 60.7),
    # Texture, for each pixel of the window.
    "texture pixel": ("kernel", 0.9),
    # ... before a depth: its farthest in each tile, and the tiles' fades.
    "limited pixel": ("array", 6.32),
    # Flakes: those of the box, those that touch the window, and runs of pixels in their rows, of
    # resting ones and of those that the shutter makes streaks of.
    "flake listed": ("array", 53.2),
    "flake placed": ("kernel", 85),
    "disc": ("kernel", 40),
    "disc run": ("kernel", 2.56),
    "streak": ("kernel", 195),
    "streak run": ("kernel", 31),
    # Gas: particles of the box, and pixels that they cover, of one colour or of many.
    "gas placed": ("kernel", 100.0),
    "gas pixel": ("kernel", 6.1),
    "lit gas pixel": ("kernel", 8.2),
    # The four layers of a double cone, for each pixel.
    "cone pixel": ("kernel", 9.8),
    # Planes and pictures, for each pixel.
    "mask pixel": ("kernel", 0.512),
    "joined pixel": ("kernel", 0.333),
    # A square root, by which machines are compared.
    "array number": ("array", 1.12),
    "copied byte": ("array", 0.066),
    "array pixel": ("array", 0.151),
    "veil pixel": ("array", 2.47),
    "byte pixel": ("kernel", 1.01),
    "fused pixel": ("kernel", 0.05),
    "word pixel": ("kernel", 1.29),
    "float pixel": ("kernel", 1.55),
    "decoded pixel": ("array", 8.0),
    "encoded pixel": ("array", 10.9),
    # Linear light to integers of display values: by the formula, or by a table.
    "encoded value": ("array", 10.0),
    "looked up value": ("array", 3.0),
    # What Python takes for a frame, an effect and a call of a kernel.
    "frame": ("array", 6570.0),
    "layer": ("array", 31780.0),
}


def nanoseconds(work: Mapping[str, float], scales: Mapping[str, float] | None = None) -> float:
    """Return the time of some operations; `scales` are factors by kind of work.

    An operation that the table does not have counts as 0.
    """
    total = 0.0
    for name, number in work.items():
        kind, each = NANOSECONDS.get(name, ("array", 0.0))
        total += number * each * (1.0 if scales is None else scales.get(kind, 1.0))
    return total
