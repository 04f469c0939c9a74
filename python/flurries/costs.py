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
    "tile bin": ("kernel", 0.35),
    "tile multiply-add": ("kernel", 0.0115),
    "tile fft": ("kernel", 0.22),
    "tile pixel": ("kernel", 0.08),
    "planned bin": ("kernel", 130.0),
    # Texture, for each pixel of the window.
    "texture pixel": ("kernel", 0.25),
    # Flakes: those of the box, those that touch the window, and their pixels.
    "flake placed": ("array", 80.0),
    "flake drawn": ("kernel", 150.0),
    "flake pixel": ("kernel", 0.7),
    # Planes and pictures, for each pixel.
    "mask pixel": ("kernel", 0.5),
    "joined pixel": ("kernel", 0.6),
    "array number": ("array", 0.9),
    "copied byte": ("array", 0.1),
    "array pixel": ("array", 1.0),
    "veil pixel": ("array", 20.0),
    "byte pixel": ("kernel", 0.35),
    "word pixel": ("kernel", 0.5),
    "float pixel": ("kernel", 0.9),
    "decoded pixel": ("array", 8.0),
    "encoded pixel": ("array", 40.0),
    # What Python takes for a frame, an effect and a call of a kernel.
    "frame": ("array", 30_000.0),
    "layer": ("array", 100_000.0),
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
