"""Weather as transforms of torchvision (v2), drawn from torch's random numbers: docs/augment.md."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from torchvision import tv_tensors
from torchvision.transforms import v2

from flurries import augment
from flurries._contract import rate_of, real
from flurries.augment.pipelines import painted, thicker, transforms
from flurries.augment.weather import Weather

__all__ = ["Alpha", "Depth", "Fog", "Rainfall", "Records", "Snowfall"]


class Depth(tv_tensors.Mask):  # type: ignore[misc]
    """The depth of a picture, (H, W) floats in metres.

    In the sample beside the picture it goes through flips and crops as a mask does, and the
    weather of these transforms lies before it.
    """


class Alpha(tv_tensors.Mask):  # type: ignore[misc]
    """The opacity of the weather before a picture, (H, W) float32; of a video (T, H, W).

    In the sample beside the picture, zeros at first, it comes back with the opacity of the weather;
    several weathers add up as layers do. It goes through flips and crops as a mask does, so that
    :func:`flurries.augment.occlusion` of it holds for the boxes at the pipeline's end.
    """

    @classmethod
    def before(cls, picture: Any) -> Alpha:
        """Return that of a picture or a video without weather: a tensor's, or Pillow's."""
        if isinstance(picture, torch.Tensor):
            film = isinstance(picture, tv_tensors.Video)
            shape = (*(picture.shape[-4:-3] if film else ()), *picture.shape[-2:])
        else:
            shape = (picture.height, picture.width)
        return cls(torch.zeros(shape))


class Records(list[Any]):
    """The draws: each weather appends its own, for :func:`flurries.augment.replay`."""


class _Transform(v2.Transform):  # type: ignore[misc]
    """One weather, with a probability; `fps` is that of videos."""

    KIND: ClassVar[Any]
    _transformed_types = (*v2.Transform._transformed_types, Records)

    def __init__(self, *, p: float = 1.0, fps: float = 30.0, **weather: Any) -> None:
        super().__init__()
        self.p = real("p", p, low=0.0, high=1.0)
        self.fps = rate_of(fps)
        self.weather = self.KIND(**weather)

    def make_params(self, flat_inputs: list[Any]) -> dict[str, Any]:
        """Draw the weather of one call."""
        if float(torch.rand(())) >= self.p:
            return {"record": None, "depth": None}
        index = int(torch.randint(0, 2**62, ()))
        depths = [given for given in flat_inputs if isinstance(given, Depth)]
        depth = depths[0].detach().cpu().float().numpy() if len(depths) == 1 else None
        if len(depths) > 1:
            raise ValueError(f"a sample must have one Depth, got {len(depths)}")
        return {"record": self.weather.record(index=index), "depth": depth}

    # Its name before torchvision 0.21.
    _get_params = make_params

    def transform(self, inpt: Any, params: dict[str, Any]) -> Any:
        """Return one input in the weather; labels as they are."""
        record, depth = params["record"], params["depth"]
        if record is None:
            return inpt
        if isinstance(inpt, Records):
            return Records([*inpt, record])
        drawn = augment.replay(record)
        if isinstance(inpt, Alpha):
            alpha = thicker(drawn, inpt.detach().cpu().numpy(), self.fps, depth)
            return tv_tensors.wrap(torch.from_numpy(alpha).to(inpt.device), like=inpt)
        visible = (tv_tensors.Image, tv_tensors.Video)
        if isinstance(inpt, tv_tensors.TVTensor) and not isinstance(inpt, visible):
            # Boxes, masks, key points and what may come to be.
            return inpt
        if not isinstance(inpt, torch.Tensor):
            return _pillow(drawn, inpt, depth)
        if inpt.numel() == 0:
            return inpt
        if inpt.ndim < 2 + isinstance(inpt, visible):
            raise ValueError(f"a picture must have shape (..., C, H, W), got {tuple(inpt.shape)}")
        film = isinstance(inpt, tv_tensors.Video)
        given = inpt[None] if inpt.ndim == 2 else inpt

        def pictures(planes: Any) -> tuple[Any, Any]:
            flat = planes.reshape(-1, *planes.shape[-4 if film else -3 :])
            weather = partial(drawn.clip, fps=self.fps) if film else drawn
            seen = [weather(one, depth=depth, return_layer=True) for one in flat]
            whole, layers = (np.stack(part) for part in zip(*seen, strict=True))
            return whole.reshape(planes.shape), layers.reshape(*planes.shape[:-1], 4)

        result = painted(given, pictures)[0].reshape(inpt.shape)
        if isinstance(inpt, tv_tensors.TVTensor):
            result = tv_tensors.wrap(result, like=inpt)
        return result

    _transform = transform

    def extra_repr(self) -> str:
        return f"p={self.p}, {self.weather}"


def _pillow(weather: Weather, picture: Any, depth: Any) -> Any:
    """Return a picture of Pillow in a weather: grey stays grey, and an alpha stays as it is."""
    from PIL import Image

    alpha = picture.convert("RGBA").getchannel("A") if picture.has_transparency_data else None
    grey = picture.mode in ("1", "L", "LA", "La")
    plain = np.asarray(picture.convert("L" if grey else "RGB"))
    seen = Image.fromarray(weather(plain, depth=depth))
    if alpha is not None:
        seen.putalpha(alpha)
    return seen


Snowfall, Rainfall, Fog = transforms(_Transform, augment.Snowfall, augment.Rainfall, augment.Fog)
