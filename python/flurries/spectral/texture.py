"""What a field of waves is made of, whatever moves it: its band, filter, tiles, or own spectrum."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np

from flurries import _contract as check
from flurries._contract import LARGEST, OVERLAP, SMALLEST, TILE, ArrayLike, Float64
from flurries.spectral import tables
from flurries.spectral.tiles import Blend

# Of the largest rate: how far a table of rates may be from odd, which is rounding.
_ROUNDING = 1e-9


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

    wavelengths: tuple[float, float] = tables.BANDS["paper"]
    exponent: float = 1.0
    alias: tables.Aliasing = "keep"
    soft_from: float = tables.SOFT_FROM
    shutter: float = 0.0
    jitter: bool = False
    tile: int | tuple[int, int] = TILE
    overlap: int = OVERLAP
    blend: Blend = "power"
    ring_edges: ArrayLike | None = None
    ring_gains: ArrayLike | None = None
    envelope: ArrayLike | None = None
    rate: ArrayLike | None = None

    def __post_init__(self) -> None:
        tile, overlap = check.tile_of(self.tile, self.overlap)
        settled: dict[str, Any] = {
            "tile": tile, "overlap": overlap, "wavelengths": tables.band_of(self.wavelengths),
            "exponent": check.real("exponent", self.exponent),
            "alias": check.choice("alias", self.alias, tables.Aliasing),
            "blend": check.choice("blend", self.blend, Blend),
            "soft_from": check.real("soft_from", self.soft_from),
            "shutter": check.real("shutter", self.shutter, low=0.0, high=LARGEST),
            "jitter": check.flag("jitter", self.jitter),
        }  # fmt: skip
        for name, ndim in (("ring_edges", 1), ("ring_gains", 1), ("envelope", 2), ("rate", 2)):
            if (given := getattr(self, name)) is not None:
                # The caller's may change.
                settled[name] = check.sealed(check.table(name, given, ndim=ndim).copy())
        vars(self).update(settled)
        rings = [np.empty(0) if one is None else one for one in (self.ring_edges, self.ring_gains)]
        vars(self).update(edges=rings[0], gains=rings[1])
        self._check_rings()
        if self.is_own:
            self._check_own()

    def _check_rings(self) -> None:
        edges, gains = self.ring_edges, self.ring_gains
        if edges is not None and (np.size(edges) < 2 or not (np.diff(edges) > 0).all()):
            came = str(edges) if np.size(edges) < 10 else f"{np.size(edges)} that do not increase"
            raise ValueError(f"ring_edges must be at least two increasing wavelengths, got {came}")
        rings = 0 if edges is None else np.size(edges) - 1
        if gains is not None and (np.size(gains) != rings or not rings):
            raise ValueError(
                "ring_gains must be one number for each ring of ring_edges "
                f"({rings or 'none'}), got {np.size(gains)}"
            )

    def _check_own(self) -> None:
        shortest, longest = self.wavelengths
        if not 2.0 <= shortest < longest <= LARGEST:
            band = f"({shortest:g}, {longest:g})"
            raise ValueError(f"wavelengths must be 2 <= shortest < longest, got {band}")
        if self.jitter:
            raise ValueError("jitter must be False beside envelope or rate, got True")
        if self.ring_edges is not None:
            raise ValueError("ring_edges must be None beside envelope or rate, which have all")
        _ = self._own_rate, self.envelope is None or self._own_amplitude  # They refuse.

    @cached_property
    def sides(self) -> tuple[int, int]:
        """Rows and columns of a tile."""
        return check.tile_of(self.tile, self.overlap)[0]

    @property
    def is_own(self) -> bool:
        """Whether a spectrum or a temporal law of the caller's own is given."""
        return self.envelope is not None or self.rate is not None

    @cached_property
    def _own_amplitude(self) -> Float64:
        """Amplitudes of a tile's waves, even in k, 0 at dc, whose squares sum to 1."""
        if self.envelope is None:
            return tables.band_amplitude(
                self.sides, wavelengths=self.wavelengths, exponent=self.exponent
            )
        given = self._of_tile("envelope")
        if (given < 0.0).any():
            raise ValueError(f"envelope must be 0 or more, got {given.min():g}")
        # A real field has its waves in pairs: what is given for one half stands for both.
        even = given + _mirrored(given)
        even[0, 0] = 0.0
        largest = even.max()
        if largest <= 0.0:
            raise ValueError("envelope must have a wave besides that of frequency 0, got none")
        even /= largest
        return np.asarray(even / np.sqrt((even**2).sum()))

    @cached_property
    def _own_rate(self) -> Float64:
        """Cycles per frame of a tile's waves, of which pairs of a real field turn alike."""
        if self.rate is None:
            return np.zeros(self.sides)
        given = self._of_tile("rate")
        rest = given + _mirrored(given)
        # A wave of half a cycle per pixel is its own mirror along that axis, which keeps no sign.
        for axis, side in enumerate(self.sides):
            if side % 2 == 0:
                np.moveaxis(rest, axis, 0)[side // 2] = 0.0
        worst = np.unravel_index(np.abs(rest).argmax(), rest.shape)
        if np.abs(rest[worst]) > _ROUNDING * max(np.abs(given).max(), 1.0):
            row, col = (int(i) for i in worst)
            raise ValueError(
                "rate must be odd, rate[-row, -col] = -rate[row, col], since the field is real; "
                f"got {given[row, col]:g} at [{row}, {col}] and {given[-row, -col]:g} at its mirror"
            )
        return np.asarray(0.5 * (given - _mirrored(given)))

    def _of_tile(self, name: str) -> Float64:
        array = check.bounded(name, getattr(self, name))
        if array.shape != self.sides:
            raise ValueError(f"{name} must have a tile's shape, {self.sides}, got {array.shape}")
        return array


def _mirrored(waves: Float64) -> Float64:
    return np.roll(waves[::-1, ::-1], 1, axis=(0, 1))


# Rows of tiles that no picture has: their hashes draw speeds, and no phases.
_SPEEDS = ((-1, 0), (-1, 1))


def cloud(
    tile: int | tuple[int, int], velocity: ArrayLike, *, seed: int, frequency: float = 0.125,
    frequency_bandwidth: float = 0.5, orientation: float = 0.0,
    orientation_bandwidth: float | None = None, speed_bandwidth: float = 0.0,
    loop: int | None = None,
) -> Texture:  # fmt: skip
    """Texture of a Motion Cloud: waves around one frequency, orientation and velocity.

    Bandwidths are standard deviations of the power of the film. The envelope has the power
    ``exp(-o^2 / (2 b^2)) / f^2`` at o octaves from `frequency`, times ``exp(-a^2 / (2 b^2))`` at an
    angle a from `orientation`, a up to a right angle; the rate is ``-(fx vx + fy vy) +
    speed_bandwidth f n``, n one normal number for each wave.

    Parameters
    ----------
    tile : int or (rows, cols)
        Size of the texture in pixels; :func:`movie` and :func:`field` of this shape have no seam.
    velocity : (vx, vy)
        Pixels per frame of all waves.
    seed : int
        Draws the speeds.
    frequency, frequency_bandwidth : float
        Cycles per pixel, above 0 and at most 1/2, and octaves around it, above 0.
    orientation : float
        Direction in which the waves rise and fall, radians from +x towards +y; bars stand across.
    orientation_bandwidth : float, optional
        Radians around it, above 0; if not given all directions are alike.
    speed_bandwidth : float
        Pixels per frame by which waves are faster or slower along their own direction.
    loop : int, optional
        Frames after which the film shall repeat: rates are rounded to ``n / loop``.

    Notes
    -----
    After J. Leon and others, "Motion Clouds", J. Neurophysiology 107 (2012), whose bandwidths are
    of amplitudes: B_V and B_theta are ``sqrt(2)`` times these, and B_sf is ``frequency *
    (2 ** (sqrt(2) * frequency_bandwidth) - 1)``. There each wave has many rates and comes and goes;
    here it has one, so that frames are pure and each has the same contrast.
    """
    sides, _ = check.tile_of(tile, 0)
    vx, vy = check.vector("velocity", velocity, 2)
    number = check.seed_of(seed)
    middle = check.real("frequency", frequency, above=0.0, high=0.5)
    octaves = check.real("frequency_bandwidth", frequency_bandwidth, low=1e-3, high=1e3)
    boiling = check.real("speed_bandwidth", speed_bandwidth, low=0.0, high=1e6)
    fy, fx = np.meshgrid(*map(np.fft.fftfreq, sides), indexing="ij")
    radius = np.hypot(fx, fy)
    radius[0, 0] = SMALLEST
    envelope = np.exp(-0.25 * (np.log2(radius / middle) / octaves) ** 2) / radius
    angle = check.real("orientation", orientation)
    if orientation_bandwidth is not None:
        width = check.real("orientation_bandwidth", orientation_bandwidth, low=1e-3, high=1e3)
        # A wave and its opposite are one: the angle counts up to a right one.
        off = np.arctan(np.tan(np.arctan2(fy, fx) - angle))
        envelope *= np.exp(-0.25 * (off / width) ** 2)
    if not envelope.any():
        raise ValueError(
            f"frequency_bandwidth must reach a wave of the tile {sides}, got {octaves:g} octaves "
            f"around {middle:g} cycles a pixel"
        )
    size, turn = (tables.random_phase(sides, seed=number, tile=place) for place in _SPEEDS)
    # Normal numbers that are odd in k, as rates of a real field are (Box and Muller).
    normal = np.sqrt(-2.0 * np.log(np.maximum(2.0 * np.abs(size), SMALLEST)))
    normal *= np.sin(2.0 * np.pi * turn)
    rate = boiling * radius * normal - (fx * vx + fy * vy)
    if loop is not None:
        frames = check.integer("loop", loop, low=1, high=2**31 - 1)
        rate = np.rint(rate * frames) / frames
    return Texture(tile=sides, overlap=0, envelope=envelope, rate=rate)


def reads_texture(kind: type) -> None:
    """Let a kernel's request have what its `texture` has."""
    # Without a Python function: where the interpreter ends while one runs inside a kernel's call,
    # its thread is unwound through Rust, which ends the process.
    names = ("tile", "overlap", "blend", "wavelengths", "exponent", "jitter", "alias", "soft_from")
    own = {name: name for name in (*names, "shutter")}
    for name, of in {**own, "ring_edges": "edges", "ring_gains": "gains"}.items():
        setattr(kind, name, property(attrgetter(f"texture.{of}")))
