"""Weather as augmentations of kornia, in its pipelines.

    import kornia.augmentation as K
    from flurries.augment.kornia import Snowfall
    pipeline = K.AugmentationSequential(Snowfall(severity=(1, 4)), K.RandomHorizontalFlip())

Draws come from torch's random numbers. Each picture of a batch (B, C, H, W) of floats from 0 to 1
has a weather of its own, or with ``same_on_batch=True`` all have one. Boxes and masks pass through.
The weather is made on the CPU, and no gradient goes through it.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import torch
from kornia.augmentation import IntensityAugmentationBase2D

from flurries import augment
from flurries.augment.calibration import Profile
from flurries.augment.distance import Ground
from flurries.augment.draws import Range
from flurries.augment.signature import suggests
from flurries.augment.weather import Weather

__all__ = ["Fog", "Rainfall", "Snowfall"]


class _Augmentation(IntensityAugmentationBase2D):  # type: ignore[misc]
    """One weather.

    Parameters
    ----------
    p : float
        Probability of the augmentation, for each picture.
    same_on_batch : bool
        One weather for all pictures of a batch.
    keepdim : bool
        Give back a single picture without the dimension of the batch.
    weather : dict
        Fields of its kind.
    """

    KIND: ClassVar[type[Weather]]

    def __init__(
        self,
        *,
        p: float = 0.5,
        same_on_batch: bool = False,
        keepdim: bool = False,
        weather: dict[str, Any],
    ) -> None:
        super().__init__(p=p, same_on_batch=same_on_batch, keepdim=keepdim)
        self.weather = self.KIND(**weather)

    def generate_parameters(self, batch_shape: Any) -> dict[str, torch.Tensor]:
        """Draw one index for each picture."""
        count = 1 if self.same_on_batch else int(batch_shape[0])
        indices = torch.randint(0, 2**62, (count,), dtype=torch.int64)
        return {"index": indices.expand(int(batch_shape[0])).contiguous()}

    def apply_transform(
        self,
        input: torch.Tensor,
        params: dict[str, torch.Tensor],
        flags: dict[str, Any],
        transform: torch.Tensor | None = None,
    ) -> torch.Tensor:
        """Return the pictures, each in its weather."""
        if input.numel() == 0:
            return input
        kept = input.dtype
        images = input.detach().to("cpu")
        if kept == torch.bfloat16:
            images = images.float()
        planes = np.moveaxis(images.numpy(), 1, -1)
        seen = self.weather.batch(planes, index=[int(i) for i in params["index"]])
        result = torch.from_numpy(np.ascontiguousarray(np.moveaxis(seen, -1, 1)))
        return result.to(input.device, kept)


@suggests
class Snowfall(_Augmentation):
    """:class:`flurries.augment.Snowfall` in a pipeline; all but its `seed`."""

    KIND = augment.Snowfall

    def __init__(
        self,
        *,
        p: float = 0.5,
        same_on_batch: bool = False,
        keepdim: bool = False,
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
            p=p,
            same_on_batch=same_on_batch,
            keepdim=keepdim,
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
class Rainfall(_Augmentation):
    """:class:`flurries.augment.Rainfall` in a pipeline; all but its `seed`."""

    KIND = augment.Rainfall

    def __init__(
        self,
        *,
        p: float = 0.5,
        same_on_batch: bool = False,
        keepdim: bool = False,
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
            p=p,
            same_on_batch=same_on_batch,
            keepdim=keepdim,
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
class Fog(_Augmentation):
    """:class:`flurries.augment.Fog` in a pipeline; all but its `seed`."""

    KIND = augment.Fog

    def __init__(
        self,
        *,
        p: float = 0.5,
        same_on_batch: bool = False,
        keepdim: bool = False,
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
            p=p,
            same_on_batch=same_on_batch,
            keepdim=keepdim,
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
