"""Weather as transforms of albumentations and AlbumentationsX, ruled by a pipeline's own seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, ClassVar

import albumentations as _host
import numpy as np
from albumentations.core import transforms_interface as _interface

from flurries import augment
from flurries._contract import rate_of
from flurries.augment.pipelines import thicker, transforms

__all__ = ["Fog", "Rainfall", "Snowfall"]

# AlbumentationsX.
_SAMPLES = hasattr(_interface.BasicTransform, "sample_parameters")


class _Transform(_host.ImageOnlyTransform):  # type: ignore[misc]
    """One weather; what keys are is told in docs/augment.md."""

    KIND: ClassVar[Any]

    def __init__(
        self, p: float = 0.5, fps: float = 30.0, depth_key: str | None = None,
        alpha_key: str | None = None, record_key: str | None = None, **weather: Any,
    ) -> None:  # fmt: skip
        super().__init__(p=p)
        self.fps = rate_of(fps)
        self.depth_key, self.alpha_key, self.record_key = depth_key, alpha_key, record_key
        self._drawing = self.KIND(**weather)
        self.weather = {name: _plain(getattr(self._drawing, name)) for name in weather}

    @property
    def targets_as_params(self) -> list[str]:
        return [] if self.depth_key is None else [self.depth_key]

    def apply(self, img: Any, record: Mapping[str, Any], depth: Any = None, **params: Any) -> Any:
        weather = augment.replay(record)
        if img.ndim < 3 or img.shape[2] in (1, 3):
            return weather(img, depth=depth)
        if img.shape[2] == 4:
            raise ValueError(
                "image must have 1, 3, or 5 and more channels, got 4: give an alpha as a mask"
            )
        # Bands of a spectrum: each is covered as grey is.
        bands = [np.ascontiguousarray(img[..., k : k + 1]) for k in range(img.shape[2])]
        return np.concatenate([weather(band, depth=depth) for band in bands], axis=2)

    def apply_to_images(
        self, images: Any, *args: Any, record: Mapping[str, Any], depth: Any = None, **params: Any
    ) -> Any:
        return augment.replay(record).clip(images, fps=self.fps, depth=depth)

    def apply_with_params(self, params: Any, *args: Any, **kwargs: Any) -> dict[str, Any]:
        seen: dict[str, Any] = super().apply_with_params(params, *args, **kwargs)
        drawn = getattr(params, "params", params)
        if self.alpha_key is not None and self.alpha_key in seen:
            weather, given = augment.replay(drawn["record"]), seen[self.alpha_key]
            alpha = thicker(weather, _plane(given), self.fps, drawn.get("depth"))
            seen[self.alpha_key] = alpha.reshape(np.shape(given))
        if self.record_key is not None and self.record_key in seen:
            seen[self.record_key] = [*seen[self.record_key], drawn["record"]]
        return seen

    def get_transform_init_args(self) -> dict[str, Any]:
        own = ("p", "fps", "depth_key", "alpha_key", "record_key")
        return {name: getattr(self, name) for name in own} | self.weather


def _draw(
    self: _Transform, params: Any, data: Any, targets: Any = None, sampling: Any = None
) -> Any:
    """Return the draws of a call, as albumentations and AlbumentationsX want them."""
    random = sampling.py_random if _SAMPLES else self.py_random
    drawn = {"record": self._drawing.record(index=random.getrandbits(62))}
    if self.depth_key is not None:
        drawn["depth"] = _plane(data[self.depth_key])
    return _interface.SampledParams(params=drawn) if _SAMPLES else drawn


# AlbumentationsX refuses classes with the other's name of it.
setattr(_Transform, "sample_parameters" if _SAMPLES else "get_params_dependent_on_data", _draw)


def _plane(given: Any) -> Any:
    """Return a depth or an opacity without the channel that AlbumentationsX gives to masks."""
    return given[..., 0] if np.ndim(given) > 2 and np.shape(given)[-1] == 1 else given


def _plain(value: Any) -> Any:
    """Return a field as JSON and YAML have it."""
    if isinstance(value, augment.Ground):
        return asdict(value)
    return list(value) if isinstance(value, tuple) else value


Snowfall, Rainfall, Fog = transforms(_Transform, augment.Snowfall, augment.Rainfall, augment.Fog)
