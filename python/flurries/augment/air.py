"""What is in the air before a picture: flakes or drops, a texture of them, and a veil."""

import math
import threading
from dataclasses import replace
from functools import cached_property
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from flurries import _core, spectral
from flurries._contract import Array, Float64, uniforms
from flurries.augment import calibration
from flurries.augment.calibration import GAINS, Kind
from flurries.augment.distance import Distances
from flurries.augment.sheets import Falling, Layer, sheets_of
from flurries.effects.air import NEAREST, Air, Class, Eye, images_of
from flurries.effects.strength import OPACITY, reach
from flurries.gas.optics import visibility
from flurries.particles.population import FADE

FPS = 30.0

# Planes that only a call reads: fresh memory costs more than what is written into it.
_SCRATCH = threading.local()

# The hard profile has so many times more weather at most before what is near than before the sky.
_DENSEST = 4.0

_LEAST = 1e-12  # Per metre.

# By so much of the near depth, on either side, flakes fade in.
_NEAR_FADE = 0.2

# Amplitude, metres, and radians per second of drawn flakes; drops fall straight.
_SWAY = {"snow": (0.02, 4.0), "rain": (0.0, 0.0)}

_STREAM = 7005

# Points of a fog's field along the longer side; its waves have 16 to 120 of them.
_POINTS = 120
_BAND = (16.0, 120.0)
_UNEVEN = spectral.Texture(wavelengths=_BAND, exponent=1.5, tile=240, overlap=60)

# Quantiles of the normal law, for means over all densities.
_NORMAL = np.array([NormalDist().inv_cdf((k + 0.5) / 33) for k in range(33)])

_STILL = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class View(NamedTuple):
    """One eye's view, of a camera that looks ahead."""

    shape: tuple[int, int]
    focal: float  # Pixels.
    aside: float = 0.0  # The eye's place to the right of the middle of both, metres.
    eyes: float = 0.0  # Distance of each of them from the middle, metres.


def _scratch(name: str, shape: tuple[int, int]) -> Array:
    """Return a plane of this thread, whose content is that of its last use, (H, W) float32."""
    kept: dict[str, Array] = vars(_SCRATCH)
    if name not in kept or kept[name].shape != shape:
        kept[name] = np.empty(shape, np.float32)
    return kept[name]


class Here:
    """The air of one moment before one picture: drawn flakes, sheets of others, a veil."""

    def __init__(
        self, kind: Kind, record: dict[str, Any], view: View, distances: Distances, time: float,
        fps: float | None = None,
    ) -> None:  # fmt: skip
        self.kind, self.view, self.distances, self.time = kind, view, distances, time
        self.seed, self.amount = record["weather_seed"], record["amount"] or 0.0
        self.hard = record["profile"] == "hard"
        # Metres per second; of fog's largest patches lengths of the picture. And in seconds.
        self.velocity = record["wind"], record.get("fall", 0.0)
        self.exposure = record.get("exposure", 0.0)
        # The share of the optical depth that is an even veil, and how uneven that of fog is:
        # standard deviation of the extinction against its mean, where none is below 0.
        self.share, self.patches = record.get("veil", 1.0), record.get("patches", 0.0)
        # In place of the amount's, metres.
        self.visible = record.get("visibility")
        self.near, self.far = calibration.depths_of(kind, record["profile"], view.focal)
        if kind == "fog":
            thick = calibration.natural("fog", self.amount)
            seen = reach(self.visible or (visibility(thick) if thick else 0.0))
            end = distances.end if self.visible is None and self.hard else seen
            if distances.farthest > end:
                plane = np.minimum(distances.plane, np.float32(end))
                self.distances = replace(distances, plane=plane)
        self.moving = fps is not None or view.eyes > 0.0
        # Whether nothing is known to stand in what falls: an even picture says so.
        plane = distances.plane
        self.open = kind != "fog" and plane.size == 1 and float(plane[0, 0]) >= self.far

    @cached_property
    def extinction(self) -> float:
        """Of all the weather, per metre."""
        if self.visible is not None:
            return visibility(self.visible)
        if not self.hard or self.amount == 0.0:
            return calibration.natural(self.kind, self.amount)
        loss = calibration.hard_loss(self.kind, self.amount)
        open_air = -math.log1p(-loss) / (self.far - self.near)
        if self.open:
            return open_air
        ways = self._way(self.distances.quantiles)
        if self.patches:
            # Equally likely densities.
            ways = np.outer(ways, np.maximum(1.0 + self.patches * _NORMAL, 0.0)).ravel()
        found = _core.extinction(ways, loss)
        return found if self.kind == "fog" else min(found, _DENSEST * open_air)

    def _way(self, depth: Any) -> Any:
        """Return the way through the weather before some depths, metres."""
        fog = self.kind == "fog"
        return depth if fog else np.minimum(np.maximum(depth, self.near), self.far) - self.near

    def drift(self, fps: float) -> Float64:
        """Return the motion of fog's patches, (2,) pixels per frame: the mean of their waves."""
        mean = math.sqrt(_BAND[0] / _BAND[1])
        return np.asarray(self.velocity) * (mean * max(self.view.shape) / fps)

    def veil(self, thick: float) -> tuple[float, Array | None]:
        """Return the veil's opacity, as a number where it is even, else 0 and a plane."""
        if thick == 0.0:
            return 0.0, None
        way, shape, field = self._way(self.distances.plane), self.view.shape, None
        if not self.patches and way.size == 1:
            return float(-np.expm1(-thick * way.flat[0])), None
        if self.patches:
            # A slow spectral field of variance 1, the same at every size.
            cell = max(shape) / _POINTS
            size = (math.ceil(shape[0] / cell) + 2, math.ceil(shape[1] / cell) + 2)
            drift = np.asarray(self.velocity) * self.time * _POINTS
            made = spectral.field(size, drift=drift, seed=self.seed, texture=_UNEVEN)
            field = made, cell, self.patches
        found = _scratch("veil", shape)
        _core.veil(found, way, thick, field)
        return 0.0, found

    def alpha(self, *, passing: bool = False) -> tuple[Array, Any]:
        """Return the opacity of it all, (H, W), and its veil's: `passing` until the next call."""
        shape = self.view.shape
        haze, plane = self.veil(self.share * self.extinction)
        hidden = haze if plane is None else plane
        if self.thickness == 0.0:
            if plane is None:
                return np.full(shape, haze, np.float32), hidden
            own = plane if passing else plane.copy()
            return own, own
        out = _scratch("alpha", shape) if passing else np.empty(shape, np.float32)
        self.write(out, haze, plane)
        return out, hidden

    @property
    def depth(self) -> Array | None:
        """The picture's depth where flakes may be behind it, (H, W) float32."""
        return None if self.open else self.distances.full(self.view.shape)

    @property
    def thickness(self) -> float:
        """Optical depth of flakes per metre; too little to have a flake anywhere is none."""
        thick = (1.0 - self.share) * self.extinction
        return thick if thick > _LEAST else 0.0

    @cached_property
    def falling(self) -> Falling:
        return Falling(
            self.kind, 0 if self.hard else max(round(10.0 * self.amount), 1),
            # The same before every lens of the hard profile, so that it has the same sheets.
            round(self.far / self.near, 12),
            GAINS[self.kind] if self.hard else 1.0, self.thickness * self.near,
            self.view.focal / self.near, self.velocity, self.exposure,
        )  # fmt: skip

    @cached_property
    def sheets(self) -> tuple[float, list[Layer]]:
        """The depth up to which flakes are drawn, of the nearest, and layers of the others."""
        return sheets_of(self.falling, max(self.view.shape), self.moving)

    @cached_property
    def layers(self) -> list[Any]:
        """The sheets where this picture reads them, for `_core.sheet_read`."""
        layers, near, found = self.sheets[1] if self.thickness > 0.0 else [], self.near, []
        x, y = self.velocity[0] * self.time - self.view.aside, self.velocity[1] * self.time
        u = iter(uniforms(self.seed, _STREAM, 2 * len(layers)).tolist())
        for sheet, first, last, lean, gain in layers:
            pace, (wide, high) = self.view.focal / (near * math.sqrt(first * last)), sheet.period
            shift = math.floor(wide * next(u)) + x * pace, math.floor(high * next(u)) + y * pace
            found.append((sheet.made, shift, lean, gain, near * first, near * last))
        return found

    def write(self, out: Array, haze: float = 0.0, veil: Array | None = None) -> None:
        """Write the opacity of all that falls, and of a veil."""
        depth, drawn, request = self.depth, None, self.request()
        if request is not None:
            plane = _scratch("drawn", self.view.shape)
            _core.particle_draw(plane, _core.fall(request), request.window, depth, None)
            drawn = plane, self.falling.gain
        _core.sheet_read(out, (0, 0), self.layers, depth, True, drawn, veil, haze)

    def request(self, steps: tuple[float, ...] = ()) -> Air | None:
        """Return the flakes that are drawn, with places at steps of seconds; None without any."""
        if self.thickness == 0.0 or self.sheets[0] <= 1.0:
            return None
        law = calibration.sizes_of(*self.falling[:2])
        near, (x, y), half = self.near, self.velocity, 0.5 * self.exposure
        reached = near * self.sheets[0]
        times = [self.time + s for s in (0.0, -half, half, *steps)]
        end = reached if reached > 0.9 * self.far else reached * (1.0 + FADE)
        fade = near * (1.0 - _NEAR_FADE), near * (1.0 + _NEAR_FADE)
        sway, swing = _SWAY[self.kind]
        one = Class(
            number=0, density=self.falling.density / near,
            sizes=(law.smallest, law.largest), slope=law.slope, shown=(*fade, reached, end),
            by_size=False, heights=(-end, end), amounts=[1.0], ranks=(0.0, 1.0),
            at=[(-x * t, -y * t, 0.0) for t in times],
            swung=[swing * t / (2.0 * math.pi) for t in times],
            waves=None, depths=(0.0, end), profile=[],
        )  # fmt: skip
        view, (height, width) = self.view, self.view.shape
        eye = Eye(_STILL, (view.focal,) * 2, (width / 2, height / 2), (view.aside, 0.0, 0.0))
        return Air(
            seed=self.seed, opacity=OPACITY, images=images_of(OPACITY), classes=[one],
            eyes=[eye] * len(times), sway=[sway] * len(times), waves=None, clumps=None,
            shape=view.shape, window=(0, height, 0, width), room=0.0, near=NEAREST, closeup=None,
        )  # fmt: skip
