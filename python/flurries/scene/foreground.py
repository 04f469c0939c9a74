"""A scene's foreground: a mask, or a picture with alpha, from arrays and files."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from flurries._contract import rectangular, warn_of_levels
from flurries.frame.matte import Matte
from flurries.io import fit, read_mask, read_picture


def foreground_of(value: Any, shape: tuple[int, int]) -> Matte:
    """Return the foreground of a scene's argument, of the scene's size."""
    if isinstance(value, (str, os.PathLike)):
        return _of_file(value, shape)
    given = rectangular("foreground", value)
    given = given.astype(given.dtype.newbyteorder("="), copy=False)
    if given.dtype not in (np.uint8, np.uint16, np.bool_, np.float16, np.float32, np.float64):
        raise TypeError(f"foreground must be a path or an array, got an array of {given.dtype}")
    if given.shape[:2] != shape or given.ndim not in (2, 3) or given.shape[2:] not in ((), (4,)):
        raise ValueError(f"foreground must have shape {shape} or {(*shape, 4)}, got {given.shape}")
    whole = given.dtype.kind in "ub"
    scale = 1.0 / float(np.iinfo(given.dtype).max) if given.dtype.kind == "u" else 1.0
    plane = np.array(given, dtype=np.float32, order="C") * np.float32(scale)
    cover = plane if plane.ndim == 2 else np.ascontiguousarray(plane[..., 3])
    if not bool(((cover >= 0.0) & (cover <= 1.0)).all()):
        raise ValueError("foreground: alpha must be from 0 to 1 everywhere")
    if not np.isfinite(plane).all():
        raise ValueError("foreground must be finite, got NaN or infinity")
    if plane.ndim == 2:
        return Matte(cover, None)
    warn_of_levels("foreground", plane, "divide them by 255")
    # A picture hides what is behind it by itself; the weather is whole under it.
    return Matte(np.zeros_like(cover), plane, linear_light=not whole)


def _of_file(path: Any, shape: tuple[int, int]) -> Matte:
    size = (shape[1], shape[0])
    picture = read_picture(path)
    if picture.alpha is None:
        mask = read_mask(path)
        return Matte(mask if mask.shape == shape else np.clip(fit(mask, size), 0.0, 1.0), None)
    rgba = picture.rgba()
    return foreground_of(rgba if rgba.shape[:2] == shape else fit(rgba, size), shape)
