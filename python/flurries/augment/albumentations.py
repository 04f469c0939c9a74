"""Weather as transforms of albumentations and of AlbumentationsX, see docs/augment.md.

Draws come from the pipeline's own random numbers, so that its seed rules them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, ClassVar

import albumentations as _host
import numpy as np
from albumentations.core import transforms_interface as _interface

from flurries import augment
from flurries._contract import rate_of
from flurries.augment.labels import thicker
from flurries.augment.pictures import mixed
from flurries.augment.signature import Fields, transforms

if TYPE_CHECKING:
    from typing_extensions import Unpack

__all__ = ["Fog", "Rainfall", "Snowfall"]

# AlbumentationsX samples in one call and refuses classes with the names of the others.
_SAMPLES = hasattr(_interface.BasicTransform, "sample_parameters")


class _Transform(_host.ImageOnlyTransform):  # type: ignore[misc]
    """One weather.

    Parameters
    ----------
    p : float
        Probability of the transform.
    fps : float
        Frames per second of `images`.
    depth_key : str, optional
        The name under which the pipeline is given the picture's depth, see
        :class:`flurries.augment.Snowfall`. ``additional_targets={"depth": "mask"}`` lets the
        pipeline's own transforms move it with the picture (in AlbumentationsX beside a `mask`
        only); without that this one has to stand before those that move.
    alpha_key : str, optional
        The name of a plane (H, W) of float32, zeros at first, that comes back with the opacity of
        the weather; several weathers add up as layers do. For `images` (T, H, W). It is moved with
        the picture if it is an additional target, as a depth is.
    record_key : str, optional
        The name of a list that comes back with what was drawn appended, for
        :func:`flurries.augment.replay`.
    weather
        Fields of its kind.
    """

    KIND: ClassVar[Any]

    def __init__(
        self, p: float = 0.5, fps: float = 30.0, depth_key: str | None = None,
        alpha_key: str | None = None, record_key: str | None = None, **weather: Unpack[Fields],
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
        covered = weather.apply(np.zeros(img.shape[:2], np.float32), depth=depth)
        bands = [img[..., band : band + 1] for band in range(img.shape[2])]
        seen = [mixed(band, covered.alpha, covered.color, weather.white) for band in bands]
        return np.concatenate(seen, axis=2)

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
        keys = {"depth_key": self.depth_key, "alpha_key": self.alpha_key}
        own = {"p": self.p, "fps": self.fps, **keys, "record_key": self.record_key}
        return {**own, **self.weather}

    def _of(self, index: int, data: Mapping[str, Any]) -> dict[str, Any]:
        drawn = {"record": self._drawing.record(index=index)}
        return drawn if self.depth_key is None else {**drawn, "depth": _plane(data[self.depth_key])}


if _SAMPLES:
    from albumentations.core.transforms_interface import SampledParams as _Sampled

    def _sample(self: _Transform, params: Any, data: Any, targets: Any, sampling: Any) -> Any:
        return _Sampled(params=self._of(sampling.py_random.getrandbits(62), data))

    _Transform.sample_parameters = _sample
else:

    def _depend(self: _Transform, params: Any, data: Any) -> dict[str, Any]:
        return self._of(self.py_random.getrandbits(62), data)

    _Transform.get_params_dependent_on_data = _depend


def _plane(given: Any) -> Any:
    """Return a depth or an opacity without the channel that AlbumentationsX gives to masks."""
    return given[..., 0] if np.ndim(given) > 2 and np.shape(given)[-1] == 1 else given


def _plain(value: Any) -> Any:
    """Return a field as JSON and YAML have it."""
    if isinstance(value, augment.Ground):
        return asdict(value)
    return list(value) if isinstance(value, tuple) else value


Snowfall, Rainfall, Fog = transforms(_Transform, augment.Snowfall, augment.Rainfall, augment.Fog)
