"""Falling snow: flakes near the camera, a spectral texture for all that lies behind them.

One set of physical parameters moves both. The texture's longest wave stands for the depth
`near_depth`; a wave of wavelength L stands for ``near_depth * longest / L`` and moves as a flake at
that depth does. The flakes fill the air up to `near_depth`, where the texture takes over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flurries import particles
from flurries._contract import Array, Float64, choice, flag, integer, real, seed_of, vector
from flurries._core import uniform
from flurries.camera import tile_drift, tile_shift
from flurries.composite import join
from flurries.effects.layer import Frame, Layer
from flurries.effects.presets import SNOW
from flurries.spectral.frame import Request, alpha_of, request
from flurries.spectral.tables import ALIAS, band_of
from flurries.spectral.tiles import BLEND
from flurries.timeline import Keys, Number, Vector, as_number, as_vector, value_at
from flurries.trace import stage

# Streams of counter-based numbers; the flakes' places and sway have their own in the kernel.
SIZES = 101

# Over this share of the flakes the last one fades in while `amount` rises, so that none pops.
FADE_IN = 0.1

# The share of a box in which flakes are shown in full; beyond they fade to its walls.
SHOWN = 0.85

# What the most flakes in view need behind a centred lens; a small scene must not ask for more work.
MOST_IN_BOX = 420_000_000

# Flakes larger than this on a picture 1024 px wide fade out: out-of-focus puffs look like dirt.
LARGEST_SIGMA = (3.5, 6.0)


@dataclass(frozen=True, kw_only=True)
class Snow:
    """Falling snow.

    Numbers marked "keyed" may vary over time: give :class:`flurries.Keys`. Lengths are metres when
    the camera's places are; the looks were tuned for metres.

    Parameters
    ----------
    amount : float
        How much of it all, 0 to 1; scales flakes, texture and haze. Keyed.
    fall : float
        Fall speed in still air, metres per second. Keyed.
    wind : (x, y, z)
        Air velocity, metres per second, x right, y down, z away from the camera. Keyed. Waves
        exactly across the motion stand still, which shows when the wind is 0 or in a simple ratio
        to the fall (1:3, 1:4): take a ratio beside it, or `jitter`.
    colour : float or (r, g, b)
        Display values, 0 to 1. Keyed.
    haze : float
        Opacity of an even veil, 0 to 1. Keyed.
    shutter : float
        Exposure in frames, 0 to 1 for a usual camera, centred on the frame. Keyed.
    texture : float
        Largest opacity of the texture, 0 to 1; 0 leaves it out. Keyed.
    mean, spread, power : float
        The texture's map to opacity, see :func:`flurries.spectral.opacity`. Keyed.
    exponent : float
        Slope of the texture's spectrum: less makes dots, more makes cotton.
    wavelengths : (shortest, longest), optional
        The texture's band in pixels. If not given, (3, 24) on a picture 1024 px wide, in proportion
        on others, not under 2 px.
    near_depth : float
        Depth in metres that the longest wave stands for, and up to which flakes are drawn.
    tile, overlap : int, optional
        The texture's tiles in pixels. If not given, 8/3 of the longest wave, and an overlap of a
        sixth, or of a half when the camera moves forward.
    blend : {"power", "linear"}
        See :func:`flurries.spectral.blend_tiles`.
    alias : {"soft", "cut", "keep"}
        What becomes of waves too fast for the frame rate, see
        :func:`flurries.spectral.temporal_filter`.
    jitter : bool
        Spread the directions of the texture's waves, so that none stands still.
    flakes : int
        Flakes in view between the camera and `near_depth`; 0 draws none.
    flake_size : (smallest, largest)
        Diameters in metres.
    flake_opacity : float
        Of a flake's middle, 0 to 1. Keyed.
    sway : (amplitude, rate)
        Metres, and radians per second: each flake swings on its own.
    seed : int, optional
        Of this effect; the scene's if not given.

    Raises
    ------
    ValueError, TypeError
        For an argument outside its range; the message names it.

    Notes
    -----
    Langer 2004, sections 5 to 7. The paper's own look is the preset "paper".

    Examples
    --------
    >>> import flurries as fl
    >>> snow = fl.Snow.preset("heavy", wind=(1.0, 0.0, 0.0))
    >>> snow.flakes > fl.Snow.preset("light").flakes
    True
    """

    amount: Number = 1.0
    fall: Number = 1.4
    wind: Vector = (0.36, 0.0, 0.0)
    colour: Any = 0.98
    haze: Number = 0.04
    shutter: Number = 0.5
    texture: Number = 0.8
    mean: Number = 0.05
    spread: Number = 2.0
    power: Number = 2.0
    exponent: float = 0.75
    wavelengths: tuple[float, float] | None = None
    near_depth: float = 12.0
    tile: int | None = None
    overlap: int | None = None
    blend: str = "power"
    alias: str = "soft"
    jitter: bool = False
    flakes: int = 8000
    flake_size: tuple[float, float] = (0.008, 0.024)
    flake_opacity: Number = 0.9
    sway: tuple[float, float] = (0.02, 4.0)
    seed: int | None = None

    def __post_init__(self) -> None:
        def settle(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        for name in ("amount", "haze", "texture", "flake_opacity"):
            settle(name, as_number(name, getattr(self, name), low=0.0, high=1.0))
        for name in ("fall", "mean"):
            settle(name, as_number(name, getattr(self, name)))
        for name in ("spread", "power"):
            settle(name, as_number(name, getattr(self, name), above=0.0))
        settle("shutter", as_number("shutter", self.shutter, low=0.0))
        settle("wind", as_vector("wind", self.wind, 3))
        settle("colour", _colour(self.colour))
        settle("exponent", real("exponent", self.exponent))
        settle("near_depth", real("near_depth", self.near_depth, above=0.0))
        if self.wavelengths is not None:
            low, high = band_of(self.wavelengths)
            if not 2.0 <= low < high:
                raise ValueError(f"wavelengths must be 2 <= shortest < longest, got {(low, high)}")
            settle("wavelengths", (low, high))
        if self.tile is not None:
            settle("tile", integer("tile", self.tile, low=5, high=2**15))
        if self.overlap is not None:
            settle("overlap", integer("overlap", self.overlap, low=0, high=2**15))
            if self.tile is not None and self.overlap >= self.tile:
                raise ValueError(
                    f"overlap must be less than the tile ({self.tile} px), got {self.overlap}"
                )
        choice("blend", self.blend, BLEND)
        choice("alias", self.alias, ALIAS)
        flag("jitter", self.jitter)
        settle("flakes", integer("flakes", self.flakes, low=0, high=100_000_000))
        sizes = vector("flake_size", self.flake_size, 2).tolist()
        if not 0.0 < sizes[0] <= sizes[1]:
            raise ValueError(f"flake_size must be 0 < smallest <= largest, got {tuple(sizes)}")
        settle("flake_size", tuple(sizes))
        settle("sway", tuple(vector("sway", self.sway, 2).tolist()))
        if self.seed is not None:
            settle("seed", seed_of(self.seed))

    @classmethod
    def preset(cls, name: str, **changes: Any) -> Snow:
        """Return a look by name: "light", "moderate", "heavy", "blizzard", or "paper".

        Further arguments replace single values of it.
        """
        values: dict[str, Any] = dict(SNOW[choice("preset", name, tuple(SNOW))])
        unknown = set(changes) - {f.name for f in fields(cls)}
        if unknown:
            raise TypeError(f"Snow has no field {sorted(unknown)[0]!r}")
        return cls(**{**values, **changes})

    def render(self, frame: Frame) -> Layer:
        """Return this effect's layer of a frame."""
        amount = value_at(self.amount, frame.t)
        planes = []
        if amount * value_at(self.texture, frame.t) > 0.0:
            with stage("texture"):
                planes.append(self._texture(frame, amount))
        if self.flakes and amount * value_at(self.flake_opacity, frame.t) > 0.0:
            with stage("flakes"):
                planes.append(frame.crop(self._flakes(frame, amount)))
        if not planes:
            top, bottom, left, right = frame.window
            planes.append(np.zeros((bottom - top, right - left), np.float32))
        alpha = join(planes, haze=amount * value_at(self.haze, frame.t))
        colour = value_at(self.colour, frame.t)
        return Layer("snow", alpha, (colour,) * 3 if isinstance(colour, float) else colour)

    def displacement(self, frame: Frame) -> Float64:
        """Return camera minus air since frame 0 in house axes, (3,) metres."""
        return frame.displacement(fall=self.fall, wind=self.wind)

    def velocity(self, frame: Frame) -> Float64:
        """Return camera minus flake per frame in house axes, (3,) metres."""
        return frame.velocity(fall=self.fall, wind=self.wind)

    def band(self, shape: tuple[int, int]) -> tuple[float, float]:
        """Return the texture's wavelengths in pixels on a picture of that shape."""
        if self.wavelengths is not None:
            return self.wavelengths
        scale = shape[1] / 1024.0
        longest = max(24.0 * scale, 4.0)
        return max(3.0 * scale, 2.0), longest

    def tiling(self, shape: tuple[int, int], forward: bool) -> tuple[int, int]:
        """Return tile and overlap in pixels."""
        longest = self.band(shape)[1]
        tile = self.tile or 8 * math.ceil(longest / 3.0 - 1e-9)
        if self.overlap is not None:
            return tile, min(self.overlap, tile - 1)
        # The flow differs from tile to tile when the camera goes forward: mix more of them.
        return tile, tile // 2 if forward else tile // 6

    def texture_request(self, frame: Frame) -> Request:
        """Return the field that the texture of a frame is made of."""
        shape, camera = frame.shape, frame.camera
        tile, overlap = self.tiling(shape, self._spreads(frame))
        place = frame.travel(fall=self.fall, wind=self.wind)
        # A velocity has no eye: take away what tile_drift adds for one.
        rate = frame.to_camera(self.velocity(frame)) - camera.offset
        shift: Any = camera.center_shift
        shift_rate: Any = None
        if frame.path.turns:
            # An eye beside the axis is carried round it; its place in the air stays that of the
            # camera plus the offset, so that two eyes keep their disparities.
            rate = rate + np.cross(frame.spin(), camera.offset)
            shift, shift_rate = (
                tile_shift(shape, angle, camera, tile=tile, overlap=overlap)
                for angle in (frame.turned(), frame.spin())
            )
            shift = shift + camera.center_shift
        drift, velocity = (
            tile_drift(
                shape, vector, camera, near_depth=self.near_depth, tile=tile, overlap=overlap
            )
            for vector in (place, rate)
        )
        return request(
            shape,
            drift=drift,
            shift=shift,
            velocity=velocity,
            shift_rate=shift_rate,
            seed=frame.seed,
            tile=tile,
            overlap=overlap,
            wavelengths=self.band(shape),
            exponent=self.exponent,
            alias=self.alias,
            shutter=value_at(self.shutter, frame.t),
            jitter=self.jitter,
            blend=self.blend,
            window=frame.window,
        )

    def _spreads(self, frame: Frame) -> bool:
        """Whether the air ever comes nearer or recedes: its flow then differs between tiles."""
        if frame.path.turns:
            return True
        axis = frame.camera.matrix()[:, 2]
        winds = self.wind.keys if isinstance(self.wind, Keys) else [(0.0, self.wind)]
        falls = self.fall.keys if isinstance(self.fall, Keys) else [(0.0, self.fall)]
        return (
            frame.path.goes_along(axis)
            or any(np.dot(axis, wind) != 0.0 for _, wind in winds)
            or any(axis[1] * fall != 0.0 for _, fall in falls)
        )

    def _texture(self, frame: Frame, amount: float) -> Array:
        t = frame.t
        mapped = (
            value_at(self.mean, t),
            value_at(self.spread, t),
            value_at(self.power, t),
            amount * value_at(self.texture, t),
        )
        return alpha_of(self.texture_request(frame), mapped, preserve_mean=True)

    def box(self, frame: Frame) -> Float64:
        """Return the sides in metres of the box of flakes that the view fits into.

        Along the camera's axes; for a camera that turns along those of the house, a cube that holds
        the view however it is turned.
        """
        across, down = self._reach(frame)
        if frame.path.turns:
            return np.full(3, 2.0 * self._ball(frame) / SHOWN)
        # The outer 15 % of the box fade; the view's far corners stay inside of that.
        return np.array([across / SHOWN, down / SHOWN, self.near_depth])

    def _reach(self, frame: Frame) -> tuple[float, float]:
        """Return the view's width and height at the far end, metres, as if the lens were centred.

        The path's camera counts, so that both eyes see the same flakes; and the farther side of a
        lens that is off the middle, since the box is centred on the axis.
        """
        height, width = frame.shape
        cx, cy = frame.path.camera.principal(frame.shape)
        across, down = (2.0 * max(c, n - c) for c, n in ((cx, width), (cy, height)))
        reach = self.near_depth / frame.path.camera.focal
        return across * reach, down * reach

    def _ball(self, frame: Frame) -> float:
        """Return the radius of the ball through the eye and the view's far corners, metres.

        Its centre lies on the axis at the same distance from the eye, or in the middle of the far
        end where the view is wider than deep.
        """
        across, down = self._reach(frame)
        corner = 0.25 * (across**2 + down**2)
        return max(0.5 * (self.near_depth + corner / self.near_depth), math.sqrt(corner))

    def count(self, frame: Frame) -> int:
        """Return how many flakes the box holds, so that the view has `flakes`."""
        height, width = frame.shape
        reach = self.near_depth / frame.path.camera.focal
        # The view is a pyramid: a third of the prism around it.
        view = width * reach * height * reach * self.near_depth / 3.0
        count = round(self.flakes * float(np.prod(self.box(frame))) / view)
        if count > MOST_IN_BOX:
            raise ValueError(
                f"flakes: {self.flakes} in view are {count} in the box around a lens whose center "
                f"is so far off the middle; at most {MOST_IN_BOX} are drawn"
            )
        return count

    def _places(self, frame: Frame, count: int) -> tuple[Float64, Float64]:
        """Return where the flakes are, (n, 3) metres in the eye's axes, and how much they show."""
        box = self.box(frame)
        # The way is known as a whole, so it is the velocity of one unit of time, and the swing's
        # angle of now is its rate.
        swing = (self.sway[0], self.sway[1] * frame.t / frame.fps)
        ahead = np.array([0.0, 0.0, 0.5 * self.near_depth])
        if not frame.path.turns:
            points = particles.positions(
                count,
                box,
                seed=frame.seed,
                velocity=-frame.to_camera(self.displacement(frame)),
                time=1.0,
                center=ahead,
                sway=swing,
            )
            return points, particles.edge_fade(points, box, center=ahead)
        # Flakes stay in axes that do not turn; the box goes round with the view inside.
        turn = frame.camera.matrix()
        middle = turn @ (0.0, 0.0, min(self._ball(frame), self.near_depth))
        points = particles.positions(
            count,
            box,
            seed=frame.seed,
            velocity=-self.displacement(frame),
            time=1.0,
            center=middle,
            sway=swing,
        )
        fade = particles.edge_fade(points, box, center=middle)
        points = frame.to_camera(points)
        # The far end fades as in the box of a camera that does not turn.
        deep = (1e3 * self.near_depth, 1e3 * self.near_depth, self.near_depth)
        return points, fade * particles.edge_fade(points, deep, center=ahead)

    def _flakes(self, frame: Frame, amount: float) -> Array:
        t, camera = frame.t, frame.camera
        count = self.count(frame)
        points, fade = self._places(frame, count)
        sizes = np.empty(count)
        uniform(sizes, frame.seed, SIZES)
        rank = (np.arange(count) + 0.5) / count
        radius = 0.5 * (self.flake_size[0] + sizes * (self.flake_size[1] - self.flake_size[0]))
        weight = np.clip((amount - rank * (1.0 - FADE_IN)) / FADE_IN, 0.0, 1.0) * fade
        low, high = (limit * frame.width_scale for limit in LARGEST_SIGMA)
        sigma = camera.focal * radius / (3.0 * np.maximum(points[:, 2], 1e-6))
        part = np.clip((sigma - low) / (high - low), 0.0, 1.0)
        weight *= 1.0 - part * part * (3.0 - 2.0 * part)
        seen = weight > 0.0
        velocity = -frame.to_camera(self.velocity(frame))
        if frame.path.turns:
            velocity = velocity - np.cross(frame.spin(), points[seen])
        return particles.splat(
            frame.shape,
            points[seen],
            radius[seen],
            camera,
            opacity=weight[seen] * value_at(self.flake_opacity, t),
            velocity=velocity,
            shutter=value_at(self.shutter, t),
        )


def _colour(value: object) -> Any:
    """Return one grey or (r, g, b), plain or keyed, in 0 to 1."""
    if isinstance(value, Keys):
        if value.width not in (None, 3):
            raise ValueError(f"colour must be keyed with numbers or (r, g, b), got {value!r}")
        for _, v in value.keys:
            _colour(v)
        return value
    if isinstance(value, (float, int, np.number, str, bytes)) or value is None:
        return real("colour", value, low=0.0, high=1.0)
    parts = vector("colour", value, 3).tolist()
    return tuple(real("colour", part, low=0.0, high=1.0) for part in parts)
