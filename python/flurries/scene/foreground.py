"""What stands in front of the weather: masks and pictures with alpha, still or moving, in depth."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from flurries._contract import finite, numbers, sealed, shares, suggesting
from flurries._kept import Kept
from flurries._warnings import warn_of_levels
from flurries.frame.matte import Deep, Front, Matte
from flurries.io import fit, open_background
from flurries.io.files import file_of, path_text
from flurries.io.pictures.reader import Picture, luminance
from flurries.io.sources import open_matte
from flurries.scene.depth import distance_of
from flurries.scene.numbered import Display, Planes, placed

MOST_MATTES = 64


@suggesting
@dataclass(frozen=True, eq=False)
class Foreground:
    """A picture in front of the weather, with its own depth.

    Parameters
    ----------
    source : path or array
        A mask (H, W) of the background's own pixels, 1 in front; or a picture with alpha (H, W, 4),
        straight for integers, premultiplied for floats. A file, an image sequence
        (``roto.%04d.png``) or a film goes by the shot's frame numbers. Of an EXR's Cryptomatte what
        is named after a colon stands in front: ``plate.####.exr:house,tree``.
    depth : float, array or path, optional
        How far away it stands, as a scene's `depth`: weather that is nearer falls in front of it.
        If not given it stands before all weather.

    Examples
    --------
    >>> import numpy as np, flurries as fl
    >>> mask = np.zeros((48, 64), np.uint8)
    >>> mask[20:, 30:] = 255
    >>> actor = fl.scene.Foreground(mask, depth=4.0)
    >>> scene = fl.Scene(size=(64, 48), foreground=[actor], effects=[fl.Snow("heavy")])
    >>> scene.render(0).shape
    (48, 64, 3)
    """

    source: Any
    depth: Any = None

    def __post_init__(self) -> None:
        for name in ("source", "depth"):
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(eq=False)
class Mattes:
    """All that stands in front of a scene's weather, for every frame."""

    # Back to front, each with its depth; None is before all weather.
    parts: tuple[tuple[Planes, Planes | None], ...]
    _kept: Kept = field(default_factory=partial(Kept, 1))

    @property
    def planes(self) -> dict[str, Planes]:
        found: dict[str, Planes | None] = {}
        for number, (part, far) in enumerate(self.parts, 1):
            found |= {called(number): part, f"{called(number)} depth": far}
        return {name: one for name, one in found.items() if one is not None}

    @property
    def still(self) -> bool:
        return all(one.still for one in self.planes.values())

    @property
    def deep(self) -> bool:
        return any(far is not None for _, far in self.parts)

    def frame(self, t: float) -> Front:
        """Return the mattes at frame floor(t); the very same object while it is kept."""

        def make() -> Front:
            flat = tuple(part.frame(t) for part, far in self.parts if far is None)
            deep = [(part.frame(t), far.frame(t)) for part, far in self.parts if far is not None]
            return Front(flat, Deep.of(deep) if deep else None)

        return self._kept.once(tuple(one.place(t) for one in self.planes.values()), make)


def called(number: int) -> str:
    """Return the name of a scene's first, second and further matte."""
    return "foreground" if number == 1 else f"foreground{number}"


def frozen(value: Any) -> Any:
    """Return an argument as nobody can change it: of an array that can be, a copy."""
    if not isinstance(value, np.ndarray) or (value.base is None and not value.flags.writeable):
        return value
    return sealed(value.copy())


def listed(value: Any) -> list[Foreground]:
    several = isinstance(value, (list, tuple)) and any(
        isinstance(one, (Foreground, str, os.PathLike, np.ndarray)) for one in value
    )
    given: Sequence[Any] = value if several else [value]
    if len(given) > MOST_MATTES:
        raise ValueError(f"foreground must be at most {MOST_MATTES} mattes, got {len(given)}")
    return [one if isinstance(one, Foreground) else Foreground(one) for one in given]


def mattes_of(
    value: Any, shape: tuple[int, int], *, display: Display | None = None, **numbers: Any
) -> Mattes | None:
    """Return the mattes of a scene's `foreground` argument; `numbers`: see `Planes.of`."""
    if value is None or (isinstance(value, (list, tuple)) and len(value) == 0):
        return None
    parts = []
    for number, one in enumerate(listed(value), 1):
        name = called(number)
        flat = one.depth is None
        if isinstance(one.source, (str, os.PathLike)):
            with file_of(name):
                over = display is not None
                source: Any = open_matte(one.source, overscan=over)
                source = source or open_background(path_text(name, one.source), overscan=over)
            of_picture = partial(_of_picture, shape=shape, display=display, flat=flat)
            matte = Planes.of(name, source, of_picture, **numbers)
            if matte.still:
                # A mask that cannot be read is refused now.
                matte.frame(0.0)
        else:
            matte = Planes(_of_array(one.source, shape, flat))
        far = None
        if not flat:
            far = distance_of(one.depth, shape, name=f"{name} depth", display=display, **numbers)
            # Of a depth that has two for a pixel the near one.
            far = far.then(lambda d: d if d.ndim == 2 else np.ascontiguousarray(d[..., 0]))
        parts.append((matte, far))
    return Mattes(tuple(parts))


def _of_picture(
    picture: Picture, shape: tuple[int, int], display: Display | None, flat: bool
) -> Matte:
    if picture.alpha is not None:
        rgba = placed(picture.rgba(), picture.display, shape, display, fit, 0)
        return _of_array(rgba, shape, flat)
    mask = picture.pixels if picture.pixels.ndim == 2 else luminance(picture)
    fitted = placed(mask, picture.display, shape, display, fit, 0.0)
    return Matte(mask if fitted is mask else np.clip(fitted, 0.0, 1.0), None)


def _of_array(value: Any, shape: tuple[int, int], flat: bool) -> Matte:
    """Return a mask (H, W) or a picture (H, W, 4), before all weather or at a depth."""
    given = numbers("foreground", value, "a path or an array of ", "bool")
    if given.shape[:2] != shape or given.ndim not in (2, 3) or given.shape[2:] not in ((), (4,)):
        raise ValueError(f"foreground must have shape {shape} or {(*shape, 4)}, got {given.shape}")
    scale = 1.0 / float(np.iinfo(given.dtype).max) if given.dtype.kind == "u" else 1.0
    plane = np.array(given, dtype=np.float32, order="C") * np.float32(scale)
    cover = plane if plane.ndim == 2 else plane[..., 3]
    shares("foreground: alpha", cover)
    finite("foreground", plane)
    if plane.ndim == 2:
        return Matte(cover, None)
    warn_of_levels("foreground", plane, "divide them by 255")
    # A flat picture hides what is behind it by itself; the weather is whole under it.
    cover = np.zeros_like(cover) if flat else np.ascontiguousarray(cover)
    return Matte(cover, plane, linear_light=given.dtype.kind == "f")
