"""Pictures of torch in weather: channels first, on any device, with gradients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from flurries._contract import Array

# Takes pictures (..., H, W, C) and returns them in weather, and their layers (..., H, W, 4).
Painted = Callable[[Array], tuple[Array, Array]]


def painted(given: torch.Tensor, weather: Painted) -> torch.Tensor:
    """Return pictures (..., C, H, W) in a weather, as they came: dtype, device and gradient."""
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
    result = result.to(given.device, given.dtype)
    if given.requires_grad and torch.is_grad_enabled():
        # What is seen is linear in the picture: (1 - alpha) of each pixel shows.
        left = torch.from_numpy(1.0 - layer[..., None, :, :, 3]).to(given.device, given.dtype)
        result = result + (given - given.detach()) * left
    return result
