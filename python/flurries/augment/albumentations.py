"""Weather as transforms of albumentations and of AlbumentationsX, in their pipelines.

    import albumentations as A
    from flurries.augment.albumentations import Snowfall
    pipeline = A.Compose([Snowfall(severity=(1, 4), p=0.5), A.HorizontalFlip()])

Draws come from the pipeline's own random numbers, so that its seed rules them. Boxes, masks and key
points pass through. `images`, the frames of a film, get one weather that moves. What was drawn is
kept by the pipeline's own replay.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import albumentations as _host
from albumentations.core import transforms_interface as _interface

from flurries import augment
from flurries._contract import real
from flurries.augment.calibration import Profile
from flurries.augment.distance import Ground
from flurries.augment.draws import Range
from flurries.augment.signature import suggests
from flurries.augment.weather import Weather

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
        The name under which the pipeline is given the picture's depth, see :class:`Snowfall`; its
        own transforms do not move a depth, so this one has to stand before them.
    weather : dict
        Fields of its kind.
    """

    KIND: ClassVar[type[Weather]]

    def __init__(
        self, p: float, fps: float, depth_key: str | None, *, weather: dict[str, Any]
    ) -> None:
        super().__init__(p=p)
        self.fps = real("fps", fps, low=1e-3, high=1e6)
        self.depth_key = depth_key
        self.weather = weather
        self._drawing = self.KIND(**weather)

    @property
    def targets_as_params(self) -> list[str]:
        return [] if self.depth_key is None else [self.depth_key]

    def apply(self, img: Any, record: Mapping[str, Any], depth: Any = None, **params: Any) -> Any:
        return augment.replay(record)(img, depth=depth)

    def apply_to_images(
        self, images: Any, *args: Any, record: Mapping[str, Any], depth: Any = None, **params: Any
    ) -> Any:
        return augment.replay(record).clip(images, fps=self.fps, depth=depth)

    def get_transform_init_args(self) -> dict[str, Any]:
        return {"p": self.p, "fps": self.fps, "depth_key": self.depth_key, **self.weather}

    def _of(self, index: int, data: Mapping[str, Any]) -> dict[str, Any]:
        drawn = {"record": self._drawing.record(index=index)}
        return drawn if self.depth_key is None else {**drawn, "depth": data[self.depth_key]}


if _SAMPLES:
    from albumentations.core.transforms_interface import SampledParams as _Sampled

    def _sample(self: _Transform, params: Any, data: Any, targets: Any, sampling: Any) -> Any:
        return _Sampled(params=self._of(sampling.py_random.getrandbits(62), data))

    _Transform.sample_parameters = _sample
else:

    def _depend(self: _Transform, params: Any, data: Any) -> dict[str, Any]:
        return self._of(self.py_random.getrandbits(62), data)

    _Transform.get_params_dependent_on_data = _depend


@suggests
class Snowfall(_Transform):
    """:class:`flurries.augment.Snowfall` in a pipeline; all but its `seed`."""

    KIND = augment.Snowfall

    def __init__(
        self,
        p: float = 0.5,
        fps: float = 30.0,
        depth_key: str | None = None,
        *,
        amount: Range | None = None,
        severity: int | tuple[int, int] | None = None,
        profile: Profile = "natural",
        veil: float = 0.25,
        wind: Range = (-1.5, 1.5),
        fall: Range = (1.0, 1.8),
        exposure: Range = (0.005, 0.02),
        color: Range | tuple[float, float, float] = (0.9, 1.0),
        ground: Ground | None = None,
        focal: float = 1.2,
        white: float = 1.0,
        weather_seed: int | None = None,
    ) -> None:
        super().__init__(
            p,
            fps,
            depth_key,
            weather={
                "amount": amount,
                "severity": severity,
                "profile": profile,
                "veil": veil,
                "wind": wind,
                "fall": fall,
                "exposure": exposure,
                "color": color,
                "ground": ground,
                "focal": focal,
                "white": white,
                "weather_seed": weather_seed,
            },
        )


@suggests
class Rainfall(_Transform):
    """:class:`flurries.augment.Rainfall` in a pipeline; all but its `seed`."""

    KIND = augment.Rainfall

    def __init__(
        self,
        p: float = 0.5,
        fps: float = 30.0,
        depth_key: str | None = None,
        *,
        amount: Range | None = None,
        severity: int | tuple[int, int] | None = None,
        profile: Profile = "natural",
        veil: float = 0.25,
        wind: Range = (-2.0, 2.0),
        fall: Range = (6.0, 9.0),
        exposure: Range = (0.015, 0.03),
        color: Range | tuple[float, float, float] = (0.78, 0.95),
        ground: Ground | None = None,
        focal: float = 1.2,
        white: float = 1.0,
        weather_seed: int | None = None,
    ) -> None:
        super().__init__(
            p,
            fps,
            depth_key,
            weather={
                "amount": amount,
                "severity": severity,
                "profile": profile,
                "veil": veil,
                "wind": wind,
                "fall": fall,
                "exposure": exposure,
                "color": color,
                "ground": ground,
                "focal": focal,
                "white": white,
                "weather_seed": weather_seed,
            },
        )


@suggests
class Fog(_Transform):
    """:class:`flurries.augment.Fog` in a pipeline; all but its `seed`."""

    KIND = augment.Fog

    def __init__(
        self,
        p: float = 0.5,
        fps: float = 30.0,
        depth_key: str | None = None,
        *,
        amount: Range | None = None,
        severity: int | tuple[int, int] | None = None,
        profile: Profile = "natural",
        visibility: Range | None = None,
        patches: Range = (0.0, 0.3),
        wind: Range = (-0.1, 0.1),
        color: Range | tuple[float, float, float] = (0.75, 0.92),
        ground: Ground | None = None,
        focal: float = 1.2,
        white: float = 1.0,
        weather_seed: int | None = None,
    ) -> None:
        super().__init__(
            p,
            fps,
            depth_key,
            weather={
                "amount": amount,
                "severity": severity,
                "profile": profile,
                "visibility": visibility,
                "patches": patches,
                "wind": wind,
                "color": color,
                "ground": ground,
                "focal": focal,
                "white": white,
                "weather_seed": weather_seed,
            },
        )
