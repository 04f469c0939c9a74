"""All public functions and classes, from one list, each with a call that it takes."""

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np

import flurries as fl

# Modules of other libraries' transforms, which need those, and the one that runs when imported.
ELSEWHERE = ("albumentations", "kornia", "torchvision", "__main__")

# What libraries offer that need not be here.
GUESTS = {"view": "anywidget", "output.cluster.to_dask": "dask"}

# Parts of `CameraPath`, effects, weather and the command: they get what those have checked.
INNER = ("turning", "keys", "demo", "calibration")

# Parts of effects: the effect that is composed of them checks them all.
PARTS = {f"effects.{name}" for name in (
    "Field", "Flakes", "Motion", "Precipitation", "Texture", "Veil",
)}  # fmt: skip

# Classes that functions return and nobody makes.
RESULTS = {
    "augment.Weathered", "augment.benchmark.Scores", "augment.corrupt.Corrupted",
    "cone.Path", "cone.Rays", "cone.State", "effects.Frame", "effects.Layer", "scene.Rendered",
    "io.Deep", "io.Picture", "output.write.Summary",
}  # fmt: skip

# It takes seconds: `test_match.py` asks what its signature promises.
SLOW = {"match"}


@dataclass(frozen=True)
class Call:
    """A call that is taken, and what the signature does not say of it."""

    given: dict[str, Any]  # Every argument by its name, arrays as contiguous float64.
    of: Callable[..., Any] | None = None  # What is called, if not the public function itself.
    then: Callable[[Any], Any] = lambda made: made  # Makes arrays of an answer that is an object.
    # Refused all the same, by argument; in place of `values.OUT_OF_RANGE`.
    refused: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    # Arrays whose integers mean levels of their full scale.
    pictures: tuple[str, ...] = ()
    light: bool = False  # Whether levels mean display values, and floats light.
    keeps: str = ""  # The array whose float dtype the answer keeps.
    # What else than numbers an array may be: see `values.no_arrays`.
    takes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    floats: tuple[str, ...] = ()  # Arrays of which integers are refused.
    within: float = 2e-5  # Of float32's answers from float64's, relative to the largest.
    infinite: tuple[str, ...] = ()  # Numbers that may be infinite.
    words: tuple[str, ...] = ()  # Strings that are no choice of a few.
    unused: tuple[str, ...] = ()  # Not looked at beside the other arguments.
    loose: bool = False  # A wrong type may be taken, or refused in Python's own words.
    # A large number of them, or none at all, is an order for that much work.
    heavy: tuple[str, ...] = ()
    both: dict[str, str] = field(default_factory=dict)  # Arrays that must be alike.
    strict: bool = False  # All refusals are short and name an argument, whatever the type.

    def __call__(self, **changes: Any) -> Any:
        assert self.of is not None
        alike = {self.both[name]: value for name, value in changes.items() if name in self.both}
        return self.then(self.of(**{**self.given, **alike, **changes}))

    @property
    def parameters(self) -> dict[str, inspect.Parameter]:
        found = inspect.signature(self.of).parameters if self.of else {}
        return {n: p for n, p in found.items() if p.kind != p.VAR_KEYWORD}

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """The arguments that may come in any layout and dtype of real numbers."""
        return {
            name: value
            for name, value in self.given.items()
            if isinstance(value, np.ndarray) and value.dtype.kind != "c"
        }

    @property
    def writes(self) -> bool:
        """Whether it writes into one array of the caller's."""
        kind = str(self.parameters["out"].annotation) if "out" in self.parameters else ""
        return kind.endswith("| None") and not kind.startswith("tuple")


def _here(name: str) -> bool:
    return name not in GUESTS or importlib.util.find_spec(GUESTS[name]) is not None


@cache
def listed() -> dict[str, Callable[..., Any]]:
    """Return all that some `__all__` offers to call, by the shortest way to it."""
    found: dict[int, tuple[str, Callable[..., Any]]] = {}
    modules = ["flurries"]
    for module in pkgutil.walk_packages(fl.__path__, "flurries."):
        parts = module.name.split(".")
        hidden = any(part.startswith("_") for part in parts)
        guest = parts[-1] == "widget" and not _here("view")
        if not hidden and not guest and parts[-1] not in (*ELSEWHERE, *INNER):
            modules.append(module.name)
    for name in modules:
        module = importlib.import_module(name)
        for public in getattr(module, "__all__", ()):
            short = f"{name}.{public}".removeprefix("flurries.")
            if not _here(short.removeprefix("viewer.")):
                continue
            value = getattr(module, public)
            if inspect.isfunction(value) or inspect.isclass(value):
                kept = found.get(id(value))
                if kept is None or len(short) < len(kept[0]):
                    found[id(value)] = (short, value)
    return {
        name: value for name, value in sorted(found.values()) if name not in RESULTS | PARTS | SLOW
    }


def calls() -> dict[str, Call]:
    from public import arrays, refused, scenes

    functions = listed()
    return {
        name: replace(
            call,
            of=call.of or functions.get(name),
            strict=name in arrays.CALLS,
            refused={**call.refused, **refused.OUTSIDE.get(name, {})},
        )
        for name, call in {**arrays.CALLS, **scenes.CALLS}.items()
        if _here(name)
    }
