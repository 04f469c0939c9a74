"""What the transforms of other libraries' pipelines share: their classes, an opacity, tensors."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from flurries._contract import Array, rectangular, suggesting
from flurries.augment.weather import Weather

if TYPE_CHECKING:
    import torch

_Kind = TypeVar("_Kind", bound=type)


def transforms(host: _Kind, *weathers: type) -> Iterator[_Kind]:
    """Yield a transform of a pipeline's library for each weather, named and told as that is."""
    make: Any = getattr(host, "__init__")  # noqa: B009 - mypy refuses the plain name
    own = [p for p in inspect.signature(make).parameters.values() if p.kind is not p.VAR_KEYWORD]
    for weather in weathers:
        told = [
            inspect.Parameter(f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default)
            for f in fields(weather) if f.name != "seed"
        ]  # fmt: skip

        @functools.wraps(make)
        def init(self: Any, *args: Any, **given: Any) -> None:
            make(self, *args, **given)

        vars(init)["__signature__"] = inspect.Signature([*own, *told])
        page = f":class:`flurries.augment.{weather.__name__}` in a pipeline; all but its `seed`."
        parts = {"KIND": weather, "__init__": init, "__doc__": page, "__module__": host.__module__}
        made: Any = suggesting(type(host)(weather.__name__, (host,), parts))
        yield made


def thicker(weather: Weather, given: Any, fps: float, depth: Any) -> Array:
    """Return an opacity with that of a weather over it, of a picture (H, W) or a film (T, H, W)."""
    before = rectangular("alpha", given)
    if before.dtype.kind != "f" or before.ndim not in (2, 3) or before.size == 0:
        raise ValueError(
            "alpha must be float of shape (H, W), or (T, H, W) for a film, got "
            f"{before.dtype} {before.shape}"
        )
    made = weather if before.ndim == 2 else functools.partial(weather.clip, fps=fps)
    _, layer = made(np.zeros(before.shape, np.float32), depth=depth, return_layer=True)
    return np.asarray(1.0 - (1.0 - before) * (1.0 - layer[..., 3]), before.dtype)


def painted(
    given: torch.Tensor, weather: Callable[[Array], tuple[Array, Array]]
) -> tuple[torch.Tensor, torch.Tensor]:
    """Return pictures (..., C, H, W) in a weather, as they came, and the opacity (..., H, W)."""
    # The weather takes (..., H, W, C), and returns that and layers (..., H, W, 4).
    import torch

    channels = given.shape[-3]
    if channels not in (1, 3):
        raise ValueError(
            f"a picture must have 1 or 3 channels, (..., C, H, W), got {tuple(given.shape)}: give "
            "what is no color, such as an alpha, beside the picture"
        )
    if not (given.dtype.is_floating_point or given.dtype in (torch.uint8, torch.uint16)):
        raise TypeError(f"a picture must be uint8, uint16 or float, got {given.dtype}")
    plain = given.detach().cpu()
    # NumPy has no bfloat16.
    planes = (plain.float() if plain.dtype == torch.bfloat16 else plain).numpy()
    seen, layer = weather(np.moveaxis(planes, -3, -1))
    result = torch.from_numpy(np.ascontiguousarray(np.moveaxis(seen, -1, -3)))
    result, alpha = result.to(given.device, given.dtype), torch.from_numpy(layer[..., 3])
    if given.requires_grad and torch.is_grad_enabled():
        # What is seen is linear in the picture: (1 - alpha) of each pixel shows.
        left = (1.0 - alpha)[..., None, :, :].to(given.device, given.dtype)
        result = result + (given - given.detach()) * left
    return result, alpha
