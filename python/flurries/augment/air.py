"""What is in the air before a picture: flakes or drops, a texture of them, and a veil."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flurries import _core
from flurries._contract import Array, Float64
from flurries.augment.calibration import extinction
from flurries.augment.distance import Distances
from flurries.augment.flakes import NEAREST, Cloud, Flakes, flakes_at
from flurries.augment.patches import Patches
from flurries.augment.texture import Texture, longest_wave
from flurries.camera.lens import Camera

FPS = 30.0

# Opacities so small that those that overlap add up, to a part in ten thousand.
_THIN = 1e-4

# The largest disparity of the longest wave, in lengths of it.
_DISPARITY = 0.45

# Depths that flakes are sorted into where their motion is asked for: a pixel that several cover
# moves as the densest does.
_SLABS = 24


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
    fixed : float, optional
        The veil's extinction per metre, in place of one for the loss.
    """

    seed: int
    loss: float
    velocity: tuple[float, float]
    exposure: float
    cloud: Cloud | None = None
    texture: Texture | None = None
    patches: Patches | None = None
    fixed: float | None = None

    def alpha(
        self,
        view: View,
        distances: Distances,
        *,
        time: float,
        fps: float = FPS,
        veil: float | None = None,
    ) -> Array:
        """Return the opacity of all of it, (H, W) float32."""
        if self.loss <= 0.0:
            return np.zeros(view.shape, np.float32)
        flakes = self._flakes(view, time)
        thick = self._extinction(flakes, distances) if veil is None else veil
        left = self._veiled(view, distances, thick, time)
        planes = []
        if self.texture is not None:
            planes.append(self._before(self._texture(view, time, fps), self.texture, distances))
        if flakes is not None:
            planes.append(self._drawn(flakes, view, distances))
        if not planes:
            alpha = np.subtract(np.float32(1.0), left)
            return np.ascontiguousarray(np.broadcast_to(alpha, view.shape), np.float32)
        clear = np.subtract(np.float32(1.0), planes[0], out=planes[0])
        for plane in planes[1:]:
            clear *= np.subtract(np.float32(1.0), plane, out=plane)
        clear *= left
        # From 0 to 1 as its factors are, to the last bit: rounding keeps the order.
        return np.asarray(np.subtract(np.float32(1.0), clear, out=clear))

    def apart(self, view: View, distance: float) -> Air:
        """Return the air as two eyes see it: the texture so far that its disparity has a sign.

        A wave that is displaced by half its length could as well be displaced the other way.
        """
        if self.texture is None:
            return self
        near = view.camera.focal * distance / (_DISPARITY * longest_wave(view.shape))
        if near <= self.texture.near:
            return self
        return replace(self, texture=replace(self.texture, near=near))

    def extinction(self, view: View, distances: Distances, time: float) -> float:
        """Return the veil's extinction, per metre, for what a view shows."""
        return self._extinction(self._flakes(view, time), distances)

    def moving(
        self, view: View, distances: Distances, *, time: float, fps: float
    ) -> tuple[Array, Array, Array]:
        """Return what is densest at each pixel of all that is somewhere and moves.

        Flakes of about one depth, or the texture; a veil is nowhere in particular. Fog moves as the
        mean of its patches.

        Returns
        -------
        opacity : (H, W)
        motion : (H, W, 2)
            Pixels per frame.
        where : (H, W)
            Depth, metres.
        """
        flow = np.zeros((*view.shape, 2), np.float32)
        where = np.full(view.shape, np.inf, np.float32)
        most = np.zeros(view.shape, np.float32)
        if self.loss <= 0.0:
            return most, flow, where
        if self.patches is not None:
            flow[...] = self.patches.motion(view.shape, fps)
            return most, flow, where
        step = np.asarray(self.velocity) * view.camera.focal / fps
        if self.texture is not None:
            most = self._before(self._texture(view, time, fps), self.texture, distances)
            where[most > 0.0] = self.texture.typical()
            flow[most > 0.0] = step / self.texture.typical()
        flakes = self._flakes(view, time)
        if flakes is not None and len(flakes.points):
            edges = np.geomspace(NEAREST, 1.001 * float(flakes.points[:, 2].max()), _SLABS + 1)
            slab = np.searchsorted(edges, flakes.points[:, 2], side="right")
            for number in np.unique(slab):
                part = flakes.part(slab == number)
                cover, way, near = self._means(part, view, distances, fps)
                seen = cover > most
                most[seen], flow[seen], where[seen] = cover[seen], way[seen], 1.0 / near[seen]
        return most, flow, where

    def _means(
        self, flakes: Flakes, view: View, distances: Distances, fps: float
    ) -> tuple[Array, Array, Array]:
        """Return the flakes' opacity, and their mean motion and nearness by their opacities."""
        pixels = view.camera.focal / flakes.points[:, 2]
        # Drawn so thin that opacities add up, each flake as dense as its number is large.
        thin = self._drawn(flakes, view, distances, scale=np.full(len(pixels), _THIN))
        means = []
        for values in (*(flakes.rates() * pixels / fps), pixels):
            low, span = float(values.min()), float(np.ptp(values)) or 1.0
            dense = self._drawn(flakes, view, distances, scale=_THIN * (values - low) / span)
            share = np.divide(dense, thin, out=np.zeros_like(dense), where=thin > 0.0)
            means.append((low + span * share).astype(np.float32))
        cover = np.where(thin > 0.0, self._drawn(flakes, view, distances), np.float32(0.0))
        return cover, np.stack(means[:2], axis=-1), means[2] / np.float32(view.camera.focal)

    def _flakes(self, view: View, time: float) -> Flakes | None:
        if self.cloud is None:
            return None
        return flakes_at(
            self.cloud, view.shape, view.camera, seed=self.seed,
            velocity=np.array([*self.velocity, 0.0]), time=time, exposure=self.exposure,
            eyes=view.eyes,
        )  # fmt: skip

    def _extinction(self, flakes: Flakes | None, distances: Distances) -> float:
        if self.fixed is not None:
            return self.fixed
        depth = distances.quantiles
        clear = np.ones(len(depth))
        if self.texture is not None:
            clear *= 1.0 - self.texture.cover() * self.texture.share(depth)
        if flakes is not None:
            clear *= flakes.before(depth)
        density = np.ones(1) if self.patches is None else self.patches.densities()
        return extinction(self.loss, depth, clear[:, None], density)

    def _veiled(self, view: View, distances: Distances, thick: float, time: float) -> Array:
        """Return what the veil leaves, of a shape that broadcasts to the picture's."""
        way = distances.plane * np.float32(-thick)
        if self.patches is not None:
            way = way * self.patches.density(view, self.seed, time)
        return np.asarray(np.exp(way), np.float32)

    def _texture(self, view: View, time: float, fps: float) -> Array:
        assert self.texture is not None
        return self.texture.alpha(
            view.shape, view.camera, seed=self.seed, velocity=np.array([*self.velocity, 0.0]),
            time=time, exposure=self.exposure, fps=fps,
        )  # fmt: skip

    @staticmethod
    def _before(plane: Array, texture: Texture, distances: Distances) -> Array:
        """Return the texture as far as it lies before what is seen."""
        share = texture.share(distances.plane).astype(np.float32)
        if float(share.min()) < 1.0:
            plane *= share
        return plane

    def _drawn(
        self,
        flakes: Flakes,
        view: View,
        distances: Distances,
        scale: Float64 | None = None,
    ) -> Array:
        """Return the alpha of the flakes that nothing stands before, (H, W) float32.

        With a `scale` (n,) of their opacities in float64.
        """
        plane: Array | None = distances.plane
        assert plane is not None
        shown: Array | None = None
        if plane.shape[1] == 1:
            # A depth for each row: of a flake, that of its own.
            shown = flakes.points[:, 2] <= plane[self._rows(flakes, view, len(plane)), 0]
            plane = None
        opacity = flakes.opacity if scale is None else flakes.opacity * scale
        points, radius = flakes.points, flakes.radius
        if shown is not None and not shown.all():
            points, radius, opacity = points[shown], radius[shown], opacity[shown]
        # Everything was made here, so it goes to the kernel without the checks of `particles`.
        result: Array = np.empty(view.shape, np.float32 if scale is None else np.float64)
        x, y = view.camera.principal(view.shape)
        lens = (view.camera.focal, x, y, view.camera.offset, 0.5 * NEAREST)
        velocity = flakes.velocity[None, :]
        _core.particle_splat(result, points, radius, opacity, velocity, self.exposure, lens, plane)
        return result

    @staticmethod
    def _rows(flakes: Flakes, view: View, count: int) -> Array:
        if count == 1:
            return np.zeros(len(flakes.points), np.int64)
        y = flakes.points[:, 1] / flakes.points[:, 2] * view.camera.focal + 0.5 * view.shape[0]
        return np.clip(y, 0.0, count - 1.0).astype(np.int64)
