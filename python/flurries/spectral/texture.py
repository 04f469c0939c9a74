"""What a field of waves is made of, whatever moves it: its band, filter, tiles, or own spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries._contract import LARGEST, OVERLAP, TILE, Float64
from flurries.spectral.own import amplitude_of, odd_rate
from flurries.spectral.tables import ALIAS, BANDS, SOFT_FROM, Aliasing, band_of
from flurries.spectral.tiles import BLEND, Blend


def edges_of(value: npt.ArrayLike) -> Float64:
    edges = check.table("ring_edges", value, ndim=1)
    if len(edges) < 2 or not (np.diff(edges) > 0).all():
        came = edges.tolist() if len(edges) < 10 else f"{len(edges)} that do not increase"
        raise ValueError(f"ring_edges must be at least two increasing wavelengths, got {came}")
    return edges


@check.suggesting
@dataclass(frozen=True, eq=False, kw_only=True)
class Texture:
    """What a field of waves is made of; :func:`field` and :func:`alpha` move it and draw its seed.

    Parameters
    ----------
    wavelengths, exponent
        See :func:`band_amplitude`.
    alias, soft_from, shutter
        See :func:`temporal_filter`. Power that they take is not restored.
    jitter : bool
        Spread each wave's direction on the tent over its cell of the lattice. Without it the waves
        exactly across the motion stand still: 8 % of the power for vertical snow and 64 px tiles.
    tile, overlap : int
        Tile size in pixels (a pair (rows, cols) for tiles that are not square) and pixels shared by
        neighbours. A torus is one tile of the image's size with overlap 0.
    blend : {"power", "linear"}
        See :func:`blend_tiles`.
    ring_edges : (rings + 1,), optional
        Increasing wavelengths in pixels; ring r holds edges[r] < wavelength <= edges[r + 1], the
        outer rings what lies beyond. For wind that varies with depth.
    ring_gains : (rings,), optional
        Relative amplitude of each ring's waves, 0 or more; the whole keeps the variance 1.
    envelope : (rows, cols) of a tile, optional
        A spectrum of your own in place of the band: amplitude of each wave in fftfreq order, 0 or
        more. Waves k and -k get the mean of both, frequency 0 gets nothing, and the whole is scaled
        to variance 1. `wavelengths[1]` is still the wave that a drift belongs to.
    rate : (rows, cols) of a tile, optional
        A temporal law of your own: cycles per frame of each wave in fftfreq order, odd in k; it is
        added to what drift and shift do. ``-(fx * vx + fy * vy)`` moves the picture as a whole by
        (vx, vy) pixels per frame. With it or an envelope tiles are made one by one, which takes a
        tenth of a second and more for a million pixels, and without jitter and rings.

    Examples
    --------
    Gravity waves of deep water, which all run to the right or left: longer ones are faster.

    >>> import flurries as fl
    >>> import numpy as np
    >>> fx, fy = np.meshgrid(np.fft.fftfreq(64), np.fft.fftfreq(64))
    >>> f = np.hypot(fx, fy)
    >>> water = fl.spectral.Texture(
    ...     envelope=np.exp(-((f - 0.1) ** 2) / (2 * 0.03**2)),
    ...     rate=-np.sign(fx) * 0.1 * np.sqrt(f),
    ... )
    >>> fl.spectral.field((480, 640), seed=7, texture=water, time=12.0).shape
    (480, 640)
    """

    wavelengths: tuple[float, float] = BANDS["paper"]
    exponent: float = 1.0
    alias: Aliasing = "keep"
    soft_from: float = SOFT_FROM
    shutter: float = 0.0
    jitter: bool = False
    tile: int | tuple[int, int] = TILE
    overlap: int = OVERLAP
    blend: Blend = "power"
    ring_edges: npt.ArrayLike | None = None
    ring_gains: npt.ArrayLike | None = None
    envelope: npt.ArrayLike | None = None
    rate: npt.ArrayLike | None = None

    def __post_init__(self) -> None:
        def settle(**values: Any) -> None:
            for name, value in values.items():
                if isinstance(value, np.ndarray):
                    value = value.copy()  # The caller's may change.
                    value.flags.writeable = False
                object.__setattr__(self, name, value)

        tile, overlap = check.tile_of(self.tile, self.overlap)
        settle(
            tile=tile, overlap=overlap, wavelengths=band_of(self.wavelengths),
            exponent=check.real("exponent", self.exponent),
            alias=check.choice("alias", self.alias, ALIAS),
            blend=check.choice("blend", self.blend, BLEND),
            soft_from=check.real("soft_from", self.soft_from),
            shutter=check.real("shutter", self.shutter, low=0.0, high=LARGEST),
            jitter=check.flag("jitter", self.jitter),
        )  # fmt: skip
        edges = None if self.ring_edges is None else edges_of(self.ring_edges)
        settle(ring_edges=edges)
        if self.ring_gains is not None:
            gains = check.table("ring_gains", self.ring_gains, ndim=1)
            rings = 0 if edges is None else len(edges) - 1
            if len(gains) != rings or not rings:
                raise ValueError(
                    "ring_gains must be one number for each ring of ring_edges "
                    f"({rings or 'none'}), got {len(gains)}"
                )
            settle(ring_gains=gains)
        if self.envelope is not None:
            amplitude_of(tile, self.envelope)
            settle(envelope=check.table("envelope", self.envelope))
        if self.rate is not None:
            odd_rate(tile, self.rate)
            settle(rate=check.table("rate", self.rate))
        if not self.is_own:
            return
        shortest, longest = self.wavelengths
        if not 2.0 <= shortest < longest <= LARGEST:
            raise ValueError(
                f"wavelengths must be 2 <= shortest < longest, got ({shortest:g}, {longest:g})"
            )
        if self.jitter:
            raise ValueError("jitter must be False beside envelope or rate, got True")
        if self.ring_edges is not None:
            raise ValueError("ring_edges must be None beside envelope or rate, which have all")

    @property
    def sides(self) -> tuple[int, int]:
        """Rows and columns of a tile."""
        return check.tile_of(self.tile, self.overlap)[0]

    @property
    def is_own(self) -> bool:
        """Whether a spectrum or a temporal law of the caller's own is given."""
        return self.envelope is not None or self.rate is not None
