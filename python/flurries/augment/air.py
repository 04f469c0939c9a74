"""What is in the air before a picture: flakes or drops, a texture of them, and a veil."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.augment.calibration import extinction
from flurries.augment.distance import Distances
from flurries.augment.falling import Falling, before
from flurries.augment.flakes import NEAREST, Flakes, flakes_at
from flurries.augment.patches import Patches
from flurries.augment.sheets import Part, part_of
from flurries.augment.texture import Texture, base_of, texture_of, tile_of
from flurries.camera.lens import Camera
from flurries.spectral.flake_frames import Request

FPS = 30.0

# Planes that only a call reads: fresh memory costs more than what is written into it.
_SCRATCH = threading.local()

# The largest disparity of the texture, and what it moves by in a frame of a film, in tiles: what
# leaves a tile does not come into the next one.
_DISPARITY = 0.25
_FASTEST = 0.2

# Before what is near there are more flakes per cubic metre, up to so many times.
_DENSEST = 4.0


@dataclass(frozen=True)
class View:
    """One eye's view.

    Attributes
    ----------
    shape : (H, W)
    camera : Camera
        Its offset is that of the eye.
    eyes : float
        Distance of the farthest eye from the middle, metres.
    """

    shape: tuple[int, int]
    camera: Camera
    eyes: float = 0.0

    @cached_property
    def lens(self) -> tuple[float, float, float, tuple[float, float, float], float]:
        """The camera as kernels read it: focal length and middle, px, place, and nearest depth."""
        x, y = self.camera.principal(self.shape)
        return self.camera.focal, x, y, self.camera.offset, 0.5 * NEAREST


@dataclass(frozen=True)
class Air:
    """The weather of a record.

    Attributes
    ----------
    loss : float
        Share of the picture's contrast that all of it takes.
    velocity : (x, y) metres per second
        Of what falls, or of the fog's patches.
    exposure : float
        Seconds.
    falling : Falling, optional
    patches : Patches, optional
    fixed : float, optional
        The veil's extinction per metre, in place of one for the loss.
    """

    seed: int
    loss: float
    velocity: tuple[float, float]
    exposure: float
    falling: Falling | None = None
    patches: Patches | None = None
    fixed: float | None = None

    def alpha(
        self,
        view: View,
        distances: Distances,
        *,
        time: float,
        fps: float | None = None,
        veil: float | None = None,
        passing: bool = False,
    ) -> Array:
        """Return the opacity of all of it, (H, W) float32; of a film's frame with its rate.

        If it is `passing`, the next call of this thread writes into it again.
        """
        if self.loss <= 0.0:
            return np.zeros(view.shape, np.float32)
        here = Here(self, view, distances, time, fps)
        haze, plane = here.veil(here.extinction if veil is None else veil)
        if here.texture is None and here.flakes is None:
            if plane is None:
                return np.full(view.shape, haze, np.float32)
            return plane if passing else plane.copy()
        out = scratch("alpha", view.shape) if passing else np.empty(view.shape, np.float32)
        here.join(out, haze, plane)
        return out

    @property
    def way(self) -> float:
        """Metres that what falls moves by while the shutter is open."""
        return float(np.hypot(*self.velocity)) * self.exposure


def scratch(name: str, shape: tuple[int, int]) -> Array:
    """Return a plane of this thread, whose content is that of its last use, (H, W) float32."""
    kept: dict[str, Array] = vars(_SCRATCH)
    found = kept.get(name)
    if found is None or found.shape != shape:
        found = kept[name] = np.empty(shape, np.float32)
    return found


class Here:
    """The air of one moment before one picture: what is drawn, what is a texture, what a veil.

    Attributes
    ----------
    flakes : Flakes or None
    texture : Texture or None
    part : Part or None
        Of kept sheets, which the texture of a picture by itself is.
    open : bool
        Whether nothing stands in what falls.
    """

    def __init__(
        self, air: Air, view: View, distances: Distances, time: float, fps: float | None = None
    ) -> None:
        self.air, self.view, self.distances, self.time = air, view, distances, time
        self.fps = fps
        self.flakes: Flakes | None = None
        self.texture: Texture | None = None
        self.part: Part | None = None
        self.open = air.falling is not None and distances.beyond(air.falling.far)
        if air.falling is not None and air.loss > 0.0:
            self._fall(air.falling)

    def _fall(self, falling: Falling) -> None:
        air, view = self.air, self.view
        denser = self._denser(falling)
        falling = before(falling, max(view.shape), denser)
        focal = view.camera.focal
        fastest = 0.0 if self.fps is None else float(np.hypot(*air.velocity)) / self.fps
        least = 0.0
        if fastest or view.eyes:
            far = max(2.0 * view.eyes / _DISPARITY, fastest / _FASTEST)
            least = focal / tile_of(view.shape) * far
        way = air.way
        base = base_of(falling, way, view.shape, focal, least)
        streaks = falling.streaks(way)
        self.texture = texture_of(base, streaks)
        if self.texture is not None and self.fps is None and not view.eyes:
            self.part = part_of(self.texture, view.shape, air.velocity, air.seed)
        self.flakes = flakes_at(
            falling.cloud(streaks, base.reach), view.shape, view.camera, seed=air.seed,
            velocity=np.array([*air.velocity, 0.0]), time=self.time, exposure=air.exposure,
            eyes=view.eyes,
        )  # fmt: skip

    def _denser(self, falling: Falling) -> float:
        """Return the factor of the flakes' density before a picture that ends nearer."""
        if self.open:
            return 1.0
        deep = falling.far - falling.near
        before = np.clip((self.distances.quantiles - falling.near) / deep, 0.0, 1.0)
        return 1.0 / max(float(before.mean()), 1.0 / _DENSEST)

    @cached_property
    def extinction(self) -> float:
        """Of the veil, per metre."""
        air = self.air
        if air.fixed is not None:
            return air.fixed
        if air.falling is not None and air.falling.veil == 0.0:
            return 0.0
        depth, texture, flakes = self.distances.quantiles, self.texture, self.flakes
        if self.open and air.patches is None:
            # What all of it leaves.
            left = 1.0 if texture is None else texture.left
            left *= 1.0 if flakes is None else math.exp(-float(np.add.reduce(flakes.cover)))
            return max(math.log(left / (1.0 - air.loss)) / float(depth[0]), 0.0)
        clear = np.ones(len(depth))
        if texture is not None:
            whole = self.distances.beyond(texture.far)
            clear *= texture.left if whole else texture.before(depth)
        if flakes is not None:
            clear *= flakes.before(depth)
        density = np.ones(1) if air.patches is None else air.patches.densities()
        return extinction(air.loss, depth, clear[:, None], density)

    def veil(self, thick: float) -> tuple[float, Array | None]:
        """Return the veil's opacity, as a number where it is even, else 0 and a plane."""
        plane, patches = self.distances.plane, self.air.patches
        even = patches is None or patches.strength == 0.0
        if even and plane.size == 1:
            return float(-np.expm1(-thick * plane[0, 0])), None
        found = scratch("veil", self.view.shape)
        field = None
        if patches is not None and not even:
            field = patches.field(self.view.shape, self.air.seed, self.time)
        _core.veil(found, plane, thick, field)
        return 0.0, found

    def join(self, out: Array, haze: float = 0.0, veil: Array | None = None) -> None:
        """Write the opacity of all that falls, and of a veil."""
        drawn = None if self.flakes is None else self.drawn(self.flakes)
        times = 1 if self.flakes is None else self.flakes.times
        if self.texture is None or self.part is not None:
            own = None if drawn is None else (drawn, times.bit_length() - 1)
            _core.sheet_fall(out, self._sheets(), own, veil, haze)
            return
        planes = [self._textured(self.texture)]
        if drawn is not None:
            planes.append(self.dense(drawn, times))
        _core.join(out, planes if veil is None else [*planes, veil], haze)

    def _sheets(self) -> list[Any]:
        if self.part is None or self.texture is None:
            return []
        if self.distances.beyond(self.texture.far):
            return [self.part.read()]
        count = len(self.texture.patterns.slabs)
        return [self.part.read(k, self.mask(self.texture, k)) for k in range(count)]

    def layer(self, texture: Texture, index: int) -> Array:
        """Return the opacity of one of the texture's layers, (H, W) float32."""
        mask = None if self.distances.beyond(texture.far) else self.mask(texture, index)
        plane = np.empty(self.view.shape, np.float32)
        if self.part is not None:
            _core.sheet_fall(plane, [self.part.read(index, mask)])
            return plane
        own = texture.layers(self.request(texture))[index]
        return texture.drawn(own, opacity=True, mask=mask, out=plane, add=False)

    def _textured(self, texture: Texture) -> Array:
        out = scratch("texture", self.view.shape)
        request = self.request(texture)
        if self.distances.beyond(texture.far):
            return texture.drawn(request, opacity=True, out=out, add=False)
        layers = texture.layers(request)
        for index, layer in enumerate(layers):
            mask = self.mask(texture, index)
            last = index == len(layers) - 1
            texture.drawn(layer, opacity=last, mask=mask, out=out, add=index > 0)
        beyond = self.distances.plane >= texture.far
        if beyond.any():
            whole = scratch("whole", self.view.shape)
            texture.drawn(request, opacity=True, out=whole, add=False)
            np.copyto(out, whole, where=beyond)
        return out

    def request(self, texture: Texture) -> Request:
        """Return the request for the texture at this moment."""
        air, camera = self.air, self.view.camera
        speed = np.asarray(air.velocity)
        return texture.request(
            self.view.shape, camera.focal, seed=air.seed,
            moved=speed * self.time - np.array(camera.offset[:2]), streak=speed * air.exposure,
        )  # fmt: skip

    def mask(self, texture: Texture, index: int) -> Array:
        """Return the share of a layer that lies before the picture's depth, (H, W) float32."""
        part = texture.patterns.slabs[index].before(np.asarray(self.distances.plane, np.float64))
        return np.ascontiguousarray(np.broadcast_to(part, self.view.shape), np.float32)

    def drawn(self, flakes: Flakes, scale: Float64 | None = None) -> Array:
        """Return the alpha of the flakes that nothing stands before, each once, (H, W) float32.

        With a `scale` (n,) of their opacities in float64.
        """
        view = self.view
        plane: Array | None = self.distances.plane
        assert plane is not None
        shown: Array | None = None
        if self.open:
            plane = None
        elif plane.shape[1] == 1:
            # A depth for each row: of a flake, that of its own.
            rows = self._rows(flakes, len(plane)) if len(plane) > 1 else 0
            shown = flakes.points[:, 2] <= plane[rows, 0]
            plane = None
        opacity = flakes.opacity if scale is None else flakes.opacity * scale
        points, radius = flakes.points, flakes.radius
        if shown is not None and not shown.all():
            points, radius, opacity = points[shown], radius[shown], opacity[shown]
        # Everything was made here, so it goes to the kernel without the checks of `particles`.
        thin = scale is not None
        result: Array = np.empty(view.shape) if thin else scratch("drawn", view.shape)
        given = points, radius, opacity, flakes.velocity[None, :], self.air.exposure
        _core.particle_splat(result, given, view.lens, plane)
        return result

    @staticmethod
    def dense(plane: Array, times: int) -> Array:
        """Return the joint opacity of so many layers alike, a power of two, in their place."""
        if times > 1:
            np.subtract(np.float32(1.0), plane, out=plane)
            while times > 1:
                np.multiply(plane, plane, out=plane)
                times //= 2
            np.subtract(np.float32(1.0), plane, out=plane)
        return plane

    def _rows(self, flakes: Flakes, count: int) -> Array:
        height, focal = self.view.shape[0], self.view.camera.focal
        y = flakes.points[:, 1] / flakes.points[:, 2] * focal + 0.5 * height
        return np.clip(y, 0.0, count - 1.0).astype(np.int64)
