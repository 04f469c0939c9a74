"""Pictures that commands of the package make: every preset still and moving, on the photograph."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scenes import spelled

import flurries as fl
from flurries.io.photographs import NAMES

SIZE = (480, 320)
FRAMES = 24

KINDS: dict[str, type[Any]] = {
    "snow": fl.Snow, "rain": fl.Rain, "mist": fl.Mist, "tent_snow": fl.effects.TentSnow,
    "tent_rain": fl.effects.TentRain, "cone_snow": fl.effects.ConeSnow, "cone_rain": fl.effects.ConeRain,
}  # fmt: skip


def presets(kind: type[Any]) -> tuple[str, ...]:
    """Return the names of the looks of an effect."""
    return tuple(kind.PRESETS)


def scene_of(kind: type[Any], name: str) -> fl.Scene:
    """Return a look over the photograph; mist wants to know how far away things are."""
    changes: dict[str, Any] = {}
    # The paper's looks have no metres of their own.
    if kind is fl.Mist and "visibility" not in kind.PRESETS[name]:
        changes["visibility"] = 30.0
    effect = kind(name, **changes)
    depth = 40.0 if kind is fl.Mist else None
    picture = fl.io.photograph(NAMES[0], size=SIZE)
    return fl.Scene(picture, effects=[effect], fps=24, seed=3, depth=depth)


def write(stage: Path, *, films: bool) -> None:
    """Write the pictures, the gallery and the page of presets."""
    folder = stage / "looks"
    folder.mkdir()
    gallery = [GALLERY]
    for title, kind in KINDS.items():
        figures = []
        for name in presets(kind):
            file = folder / f"{title}_{name.replace(' ', '_')}.webp"
            film(file, scene_of(kind, name), FRAMES if films else 1)
            figures.append(figure(f"looks/{file.name}", f"{spelled(kind)}({name!r})"))
        gallery.append(
            f"## `{spelled(kind)}`\n\n::::{{container}} looks\n" + "".join(figures) + "::::\n"
        )
    (stage / "gallery.md").write_text("\n".join(gallery), encoding="utf-8")


def figure(file: str, text: str) -> str:
    """Return a picture with the call that makes it."""
    return f":::{{figure}} {file}\n:alt: {text}\n\n`{text}`\n:::\n"


def film(file: Path, scene: fl.Scene, frames: int) -> None:
    """Write frames as an animated WebP that repeats, or a still."""
    start = round(2 * scene.fps)
    pages = [Image.fromarray(np.asarray(scene.render(start + n))) for n in range(frames)]
    pages[0].save(
        file, quality=70, method=2, save_all=frames > 1, append_images=pages[1:],
        duration=round(1000 / scene.fps), loop=0,
    )  # fmt: skip


GALLERY = """# Gallery

Every look by name, one second of it over a photograph that comes with the package, 480 x 320 px. The line
under each picture makes it; give it to a scene:

```text
snow = fl.Snow("heavy")
scene = fl.Scene(fl.io.photograph(), effects=[snow], fps=24)
scene.write("snow.mp4", "48-71")
```

More pictures: [snow and rain as populations](snow.md), [looks of the paper's texture](looks.md),
[mist and fog](gas.md), [the double cone](cone.md), and the [notebooks](notebooks/index.md).
"""
