"""Pictures beside the fields that have a look: each effect with two values of a field."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pictures
from PIL import Image

import flurries as fl

SIZE = (360, 240)
SMALL, LARGE = (0.002, 0.004, 0.012), (0.008, 0.018, 0.04)
LEFT, RIGHT = (-4.0, 0.0, 0.0), (4.0, 0.0, 0.0)

# By effect and field: the two values of the picture.
VALUES: dict[str, dict[str, tuple[Any, Any]]] = {
    "snow": {
        "density": (10.0, 200.0), "flake_size": (SMALL, LARGE), "opacity": (0.3, 0.99), "amount": (0.2, 1.0),
        "wind": (LEFT, RIGHT), "color": ("ambient", "#ffb060"), "haze": (0.0, 0.4), "shutter": (0.0, 1.0),
        "severity": (1, 5), "rate": (0.5, 5.0), "visibility": (3000.0, 300.0),
    },
    "rain": {"drop_size": ((0.0005, 0.0009, 0.003), (0.001, 0.002, 0.006)), "gain": (1.0, 6.0), "color": ("ambient", "#ffb060")},
    "mist": {
        "amount": (0.4, 1.0), "visibility": (300.0, 40.0), "structure": (0.0, 1.4), "color": ("local", "#ffb060"),
        "severity": (1, 5),
    },
    "tent_snow": {
        "amount": (0.3, 1.0), "fall": (0.7, 3.0), "wind": (LEFT, RIGHT), "haze": (0.0, 0.4), "texture": (0.2, 1.0),
        "exponent": (0.0, 1.5), "flakes": (1000, 20000), "flake_size": ((0.004, 0.012), (0.016, 0.048)),
        "flake_opacity": (0.3, 0.99),
    },
    "tent_rain": {"haze": (0.0, 0.4), "drops": (1000, 12000), "drop_size": ((0.001, 0.002), (0.004, 0.006)), "gain": (10.0, 60.0)},
    "cone_snow": {
        "texture_flakes": (500, 4000), "flakes": (50, 1500), "flake_size": ((0.004, 0.01), (0.016, 0.04)),
        "flake_opacity": (0.3, 0.99),
    },
    "cone_rain": {"wind": (LEFT, RIGHT), "shutter": (0.1, 1.0), "gain": (1.0, 8.0), "drops": (200, 2000), "spread": (0.2, 1.0)},
}  # fmt: skip
# What shows most of a field; the fields of strength have no look beside them.
LOOKS = {"snow": "heavy", "rain": "downpour", "tent_rain": "downpour"}
STRENGTH = ("density", "severity", "rate", "visibility")
KINDS = {kind.__name__: name for name, kind in pictures.KINDS.items()}
# A parameter's line in a docstring of numpydoc's kind.
PARAMETER = re.compile(r"(\w+) : \S")


def write(stage: Path) -> None:
    """Write the pictures: the first value on the left, the second on the right."""
    folder = stage / "fields"
    folder.mkdir()
    plate = fl.io.photograph("rocket", size=SIZE)
    for name, values in VALUES.items():
        depth = 40.0 if name == "mist" else None
        for field, pair in values.items():
            look = [LOOKS[name]] if name in LOOKS and field not in STRENGTH else []
            effects = [pictures.KINDS[name](*look, **{field: value}) for value in pair]
            scenes = [
                fl.Scene(plate, effects=[own], fps=24, seed=3, depth=depth) for own in effects
            ]
            sides = [np.asarray(scene.render(48)) for scene in scenes]
            Image.fromarray(np.hstack(sides)).save(folder / f"{name}_{field}.webp", quality=70)


def beside(kind: str, lines: list[str]) -> list[str]:
    """Return a class's docstring with a figure below each parameter that has one."""
    name = KINDS.get(kind, "")
    made: list[str] = []
    waiting: list[str] = []
    for line in [*lines, ""]:
        if waiting and not line.startswith(" "):
            made += ["", *waiting, ""]
            waiting = []
        made.append(line)
        found = PARAMETER.match(line)
        if found and found[1] in VALUES.get(name, {}):
            waiting = figure(name, found[1])
    return made


def figure(name: str, field: str) -> list[str]:
    """Return the lines of a field's figure."""
    first, second = VALUES[name][field]
    look = f" of ``{LOOKS[name]}``" if name in LOOKS and field not in STRENGTH else ""
    return [
        f"    .. figure:: /fields/{name}_{field}.webp",
        f"       :alt: {field} {first} and {second}",
        "",
        f"       ``{field}={first!r}`` and ``{second!r}``{look}",
    ]
