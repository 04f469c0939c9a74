"""Weather as transforms of torchvision (v2), in its pipelines.

    from torchvision.transforms import v2
    from flurries.augment.torchvision import Snowfall
    pipeline = v2.Compose([v2.ToImage(), Snowfall(severity=(1, 4)), v2.RandomHorizontalFlip()])

Draws come from torch's random numbers, which a DataLoader seeds for each of its workers. Boxes and
masks pass through. A `tv_tensors.Video` is the frames of one film, and its weather moves; plain
tensors of more than three dimensions are batches whose pictures have one weather. A :class:`Depth`
in the sample is how far away its picture's things are. No gradient goes through the weather.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import torch
from torchvision import tv_tensors
from torchvision.transforms import v2

from flurries import augment
from flurries._contract import real
from flurries.augment.calibration import Profile
from flurries.augment.distance import Ground
from flurries.augment.draws import Range
from flurries.augment.signature import suggests
from flurries.augment.weather import Weather

__all__ = ["Depth", "Fog", "Rainfall", "Snowfall"]


class Depth(tv_tensors.Mask):  # type: ignore[misc]
    """How far away what a picture shows is, (H, W) floats in metres.

    In the sample beside the picture it goes through flips and crops as a mask does, and the
    weather of these transforms lies before it.
    """


class _Transform(v2.Transform):  # type: ignore[misc]
    """One weather.

    Parameters
    ----------
    p : float
        Probability of the transform.
    fps : float
        Frames per second of videos.
    weather : dict
        Fields of its kind.
    """

    KIND: ClassVar[type[Weather]]

    def __init__(self, *, p: float, fps: float, weather: dict[str, Any]) -> None:
        super().__init__()
        self.p = real("p", p, low=0.0, high=1.0)
        self.fps = real("fps", fps, low=1e-3, high=1e6)
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
        record = params["record"]
        visible = (tv_tensors.Image, tv_tensors.Video)
        # Boxes, masks, key points and what may come to be.
        label = isinstance(inpt, tv_tensors.TVTensor) and not isinstance(inpt, visible)
        if record is None or label:
            return inpt
        drawn, depth = augment.replay(record), params["depth"]
        if not isinstance(inpt, torch.Tensor):
            return painted(drawn, inpt, depth)
        if inpt.numel() == 0:
            return inpt
        given = inpt.detach().cpu()
        # NumPy has no bfloat16.
        planes = (given.float() if given.dtype == torch.bfloat16 else given).numpy()
        if isinstance(inpt, tv_tensors.Video):
            seen = film(drawn, planes, self.fps, depth)
        else:
            seen = pictures(drawn, planes, depth)
        result = torch.from_numpy(seen).to(inpt.device, inpt.dtype)
        if isinstance(inpt, tv_tensors.TVTensor):
            result = tv_tensors.wrap(result, like=inpt)
        return result

    _transform = transform

    def extra_repr(self) -> str:
        return f"p={self.p}, {self.weather}"


def painted(weather: Weather, picture: Any, depth: Any) -> Any:
    """Return a picture of Pillow in a weather: grey stays grey, and an alpha stays as it is."""
    from PIL import Image

    alpha = picture.convert("RGBA").getchannel("A") if picture.has_transparency_data else None
    grey = picture.mode in ("1", "L", "LA", "La")
    plain = np.asarray(picture.convert("L" if grey else "RGB"))
    seen = Image.fromarray(weather(plain, depth=depth))
    if alpha is not None:
        seen.putalpha(alpha)
    return seen


def pictures(weather: Weather, planes: Any, depth: Any) -> Any:
    """Return (..., C, H, W) in one weather."""
    if planes.ndim < 2:
        raise ValueError(f"a picture must have shape (..., C, H, W), got {planes.shape}")
    if planes.ndim == 2:
        return weather(planes, depth=depth)
    flat = planes.reshape(-1, *planes.shape[-3:])
    seen = [np.moveaxis(weather(np.moveaxis(image, 0, -1), depth=depth), -1, 0) for image in flat]
    return np.ascontiguousarray(np.stack(seen)).reshape(planes.shape)


def film(weather: Weather, planes: Any, fps: float, depth: Any) -> Any:
    """Return (..., T, C, H, W) in one weather that moves."""
    flat = planes.reshape(-1, *planes.shape[-4:])
    seen = [
        np.moveaxis(weather.clip(np.moveaxis(c, 1, -1), fps=fps, depth=depth), -1, 1) for c in flat
    ]
    return np.ascontiguousarray(np.stack(seen)).reshape(planes.shape)


@suggests
class Snowfall(_Transform):
    """:class:`flurries.augment.Snowfall` in a pipeline; all but its `seed`."""

    KIND = augment.Snowfall

    def __init__(
        self,
        *,
        p: float = 1.0,
        fps: float = 30.0,
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
            fps=fps,
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
        *,
        p: float = 1.0,
        fps: float = 30.0,
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
            fps=fps,
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
        *,
        p: float = 1.0,
        fps: float = 30.0,
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
            fps=fps,
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
