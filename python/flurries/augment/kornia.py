"""Weather as augmentations of kornia; gradients go through to what is seen of a picture."""

import itertools
from typing import Any, ClassVar

import numpy as np
import torch
from kornia.augmentation import IntensityAugmentationBase2D

from flurries import augment
from flurries._contract import Array, flag, integer, rate_of
from flurries.augment.pipelines import painted, transforms

__all__ = ["Fog", "Rainfall", "Snowfall"]


class _Augmentation(IntensityAugmentationBase2D):  # type: ignore[misc]
    """One weather; what channels are is told in docs/augment.md."""

    KIND: ClassVar[Any]

    def __init__(
        self, *, p: float = 0.5, same_on_batch: bool = False, keepdim: bool = False,
        depth_channel: int | None = None, alpha_channel: int | None = None, fps: float = 30.0,
        same: bool = False, **weather: Any,
    ) -> None:  # fmt: skip
        super().__init__(p=p, same_on_batch=same_on_batch, keepdim=keepdim)
        self.depth_channel, self.alpha_channel = depth_channel, alpha_channel
        for name in ("depth_channel", "alpha_channel"):
            if getattr(self, name) is not None:
                setattr(self, name, integer(name, getattr(self, name), low=0, high=1 << 20))
        if depth_channel is not None and depth_channel == alpha_channel:
            raise ValueError(f"alpha_channel must not be depth_channel, {depth_channel}")
        self.fps, self.same = rate_of(fps), flag("same", same)
        self.weather = self.KIND(**weather)

    @property
    def records(self) -> list[Any]:
        """The draws for each picture of the last batch, for `replay`; None where none were made."""
        index, drawn = self._params["index"], self._params["batch_prob"]
        return [
            self.weather.record(index=int(i)) if float(d) > 0.5 else None
            for i, d in zip(index, drawn, strict=True)
        ]

    def generate_parameters(self, batch_shape: Any) -> dict[str, torch.Tensor]:
        """Draw one index for each picture."""
        count = 1 if self.same_on_batch else int(batch_shape[0])
        indices = torch.randint(0, 2**62, (count,), dtype=torch.int64)
        return {"index": indices.expand(int(batch_shape[0])).contiguous()}

    def apply_transform(
        self, input: torch.Tensor, params: dict[str, torch.Tensor], flags: dict[str, Any],
        transform: torch.Tensor | None = None,
    ) -> torch.Tensor:  # fmt: skip
        """Return the pictures, each in its weather."""
        if input.numel() == 0:
            return input
        wanted = [int(i) for i in params["index"]]
        count = input.shape[1]
        others = [c for c in (self.depth_channel, self.alpha_channel) if c is not None]
        for channel in others:
            if channel >= count:
                raise ValueError(f"the input must have a channel {channel}, got {count} of them")
        depth: Any = None
        if self.depth_channel is not None:
            depth = input[:, self.depth_channel].detach().cpu().float().numpy()
        colors = [c for c in range(count) if c not in others]
        seen, alpha = painted(
            input[:, colors] if others else input,
            lambda planes: self._painted(planes, wanted, depth),
        )
        if not others:
            return seen
        result = input.clone()
        result[:, colors] = seen
        if self.alpha_channel is not None:
            before, opacity = input[:, self.alpha_channel], alpha.to(input.device, input.dtype)
            result[:, self.alpha_channel] = 1.0 - (1.0 - before) * (1.0 - opacity)
        return result

    def _painted(self, planes: Array, wanted: list[int], depth: Any) -> tuple[Array, Array]:
        """Return pictures in their weathers, and the layers; frames of a clip one after another."""
        if self.same or self.same_on_batch or len(set(wanted)) == len(wanted):
            found: tuple[Array, Array] = self.weather.batch(
                planes, index=wanted, depth=depth, return_layer=True
            )
            return found
        parts, first = [], 0
        for index, frames in itertools.groupby(wanted):
            last = first + len(list(frames))
            own = None if depth is None else depth[first:last]
            parts.append(self.weather.clip(
                planes[first:last], index=index, fps=self.fps, depth=own, return_layer=True
            ))  # fmt: skip
            first = last
        return np.concatenate([seen for seen, _ in parts]), np.concatenate([a for _, a in parts])


Snowfall, Rainfall, Fog = transforms(_Augmentation, augment.Snowfall, augment.Rainfall, augment.Fog)
