"""What the viewer leaves behind: a scene file, Python that makes the scene, a short film."""

import math
from dataclasses import fields, is_dataclass
from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

from flurries.io import write_layers, write_picture
from flurries.io.sources import Source
from flurries.scene.scene import Scene

LENGTH = 3.0  # Seconds of the film.

# Fields that may name a file, and how many numbers of an array stand in the text itself.
_FILES, _FEW = ("background", "foreground", "depth", "source"), 64


def save(scene: Scene, path: Path) -> None:
    """Write a scene to a TOML file, and pictures that were given as arrays beside it."""
    files: dict[str, Any] = {}
    for name in ("background", "foreground"):
        array = getattr(scene, name)
        if isinstance(array, np.ndarray):
            suffix = ".exr" if array.dtype.kind == "f" else ".png"
            files[name] = path.with_name(f"{path.stem}-{name}{suffix}")
            write_picture(files[name], np.uint8(255) * array if array.dtype == bool else array)
    if isinstance(scene.depth, np.ndarray):
        files["depth"] = path.with_name(f"{path.stem}-depth.exr")
        write_layers(files["depth"], {"depth": scene.depth.astype(np.float32)})
    scene._derive(**files).save(path)


def film(scene: Scene, path: Path) -> Path:
    """Write the first three seconds of a scene beside its scene file, over what was there."""
    target = path.with_suffix(".mp4")
    scene.write(target, range(1, round(LENGTH * scene.fps) + 1), overwrite=True)
    return target


class Python:
    """Calls that make objects again, with the fields that are not usual."""

    def __init__(self, path: Path) -> None:
        """Larger arrays are written beside `path`."""
        self.path, self.arrays, self.imports = path, 0, {"import flurries as fl"}

    def of(self, scene: Scene) -> str:
        given = "".join(f"    {one},\n" for one in self.fields(scene))
        return "\n".join(sorted(self.imports)) + f"\n\nscene = fl.Scene(\n{given})\n"

    def fields(self, value: Any) -> list[str]:
        """Return "name=value" for each field that is not as it is by default."""
        usual = {name: one.default for name, one in signature(type(value)).parameters.items()}
        given = [f.name for f in fields(value) if f.init and f.name in usual]
        own = getattr(value, "_arguments", None) or {name: getattr(value, name) for name in given}
        return [
            f"{name}={self.said(one, file=name in _FILES)}"
            for name, one in own.items() if repr(one) != repr(usual[name])
        ]  # fmt: skip

    def said(self, value: Any, *, file: bool = False) -> str:
        """Return Python for a value; a name that is one of a file is made absolute."""
        if isinstance(value, Source):
            more = f", damaged={value.damaged!r}, overscan={value.overscan!r}"
            return f"fl.io.open_background({self.said(value.spec, file=True)}{more})"
        if is_dataclass(value):
            return f"{self.named(type(value))}({', '.join(self.fields(value))})"
        if isinstance(value, np.ndarray) and (value.size > _FEW or value.dtype != np.float64):
            self.arrays += 1
            self.imports.add("import numpy as np")
            array = self.path.with_name(f"{self.path.stem}-{self.arrays}.npy")
            np.save(array, value)
            return f"np.load({str(array)!r})"
        if isinstance(value, (tuple, list, np.ndarray)):
            said = [self.said(part, file=file) for part in value]
            return f"({', '.join(said)}{',' if len(said) == 1 else ''})"
        if isinstance(value, (str, Path)) and file:
            here = not str(value).startswith("#") and "://" not in str(value)
            return repr(str(Path(value).resolve() if here else value))
        value = value.item() if isinstance(value, np.generic) else value
        return f"float('{value}')" if value in (math.inf, -math.inf) else repr(value)

    def named(self, kind: type) -> str:
        fl = import_module("flurries")  # The names as users reach them.
        for way in ("", "effects.", "scene.", "camera."):
            if getattr(getattr(fl, way[:-1]) if way else fl, kind.__name__, None) is kind:
                return f"fl.{way}{kind.__name__}"
        self.imports.add(f"from {kind.__module__} import {kind.__name__}")
        return kind.__name__
