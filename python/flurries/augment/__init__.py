"""Weather for data sets: snow, rain and fog on arrays, with labels."""

import importlib
from types import ModuleType

from flurries.augment.calibration import contrast_loss
from flurries.augment.distance import Ground
from flurries.augment.labels import Weathered, occlusion
from flurries.augment.weather import replay
from flurries.augment.weathers import Fog, Rainfall, Snowfall

__all__ = [
    "Fog", "Ground", "Rainfall", "Snowfall", "Weathered", "contrast_loss", "occlusion", "replay",
]  # fmt: skip

_LATER = ("albumentations", "benchmark", "corrupt", "kornia", "torchvision")


def __getattr__(name: str) -> ModuleType:
    if name in _LATER:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_LATER])
