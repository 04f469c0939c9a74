"""From real falling snow to a scene: what falls in a clip, how fast, how large, in which light."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from flurries._contract import Array, real
from flurries.camera import Camera
from flurries.camera.lens import expect_camera
from flurries.camera.path import CameraPath
from flurries.effects import Snow
from flurries.io import linear_to_srgb, open_background, srgb_to_linear
from flurries.light.shot import Light
from flurries.matching.direction import direction
from flurries.matching.fan import Lens
from flurries.matching.fit import Fit, fit
from flurries.matching.light import light_of, light_over, tinted
from flurries.matching.spectra import LAGS, WINDOW, density, spectra
from flurries.matching.watched import LONG, Watched, watch
from flurries.particles.sizes import SNOW
from flurries.scene import Scene
from flurries.scene.scene import DEFAULT_FOCAL

# Depths between which snow is taken to be, metres, and the opacity of its flakes: those of `Snow`.
_NEAR, _FAR, _OPACITY = 0.4, 60.0, 0.9

# A film needs so many frames.
LEAST = 8

# It cannot be told where nothing changes; from this error of the light on, or this light; where
# the motion is less clear, or less sure in radians; from a misfit on; and where motion is level.
_QUIET, _DOUBT, _WHITE = 1e-4, 0.045, 1.04
_CLEAR, _TURN, _MISFIT, _LEVEL = 3.0, 0.15, 1.1, 0.15

# What is faint is lost before it is seen, and flakes look smaller: by the closed loop's median.
_LARGER = 1.1

# What number, size and exposure are right by at best: the closed loop's.
_SURE = np.array([0.13, 0.08, 0.09])


class Unmatched(ValueError):
    """What falls in a clip cannot be told: a sentence says what is missing."""


@dataclass(frozen=True)
class Match:
    """What falls in a clip, as :func:`flurries.match` finds it; `print` it for a table.

    Attributes
    ----------
    snow : Snow
        What falls as in the clip, in "ambient" light.
    light : flurries.scene.Light
        The light of what falls in the clip.
    camera : Camera
        The camera that metres hold for.
    fps : float
        Frames per second that speeds hold for.
    direction : float
        Of the motion in the middle of the picture, radians from +x to +y.
    speed : float
        Of flakes at the median depth, half-way to the farthest, px per frame.
    errors : dict
        Standard deviations: of "direction" in radians, of "density", "size", "shutter", "speed" and
        "light" as shares of their values.
    plate : ndarray
        (H, W, 3) the clip without snow, display values; large pictures are made smaller.
    """

    snow: Snow
    light: Light
    camera: Camera
    fps: float
    direction: float
    speed: float
    errors: dict[str, float]
    plate: Array = field(repr=False)
    _frame: Array = field(repr=False)
    _fit: Fit = field(repr=False)

    def scene(self, background: Any = None, **more: Any) -> Scene:
        """Return a scene of the weather.

        Parameters
        ----------
        background : optional
            As of :class:`flurries.Scene`, which then has its own light and camera. If not given,
            the clip's plate with the clip's.
        **more
            Further arguments of :class:`flurries.Scene`.

        Returns
        -------
        Scene
        """
        own: dict[str, Any] = {"fps": self.fps, "effects": [self.snow]}
        if background is None:
            background = np.rint(255.0 * self.plate).astype(np.uint8)
            own |= {"camera": self.camera, "light": self.light, "lens": None}
        return Scene(background, **{**own, **more})

    def report(self) -> Array:
        """Return a frame of the clip beside one of the matched scene, (H, 2 W, 3) uint8."""
        found = self.scene().render(0)
        real = np.rint(255.0 * np.clip(self._frame, 0.0, 1.0)).astype(np.uint8)
        return np.hstack([real, found])

    def __str__(self) -> str:
        assert isinstance(self.snow.wind, tuple) and isinstance(self.snow.flake_size, tuple)
        error, (x, _, z), (_, size, _) = self.errors, self.snow.wind, self.snow.flake_size
        share = {name: f"+- {100.0 * one:.0f} %" for name, one in error.items()}
        strength, middle = self.snow.strength(), 0.5 * (_NEAR + _FAR)
        light = float(np.mean(linear_to_srgb(np.array(self.light.snow))))
        rows = {
            "direction": f"{math.degrees(self.direction):.1f} degrees from right to below "
            f"+- {math.degrees(error['direction']):.1f}",
            "speed": f"{self.speed:.3g} px a frame at {middle:.3g} m {share['speed']}",
            "wind": f"{x:.2f} m/s to the right, {z:.2f} away",
            "density": f"{self.snow.density:.3g} flakes per m3 {share['density']}",
            "size": f"{1e3 * size:.2g} mm {share['size']}",
            "exposure": f"{self.snow.shutter:.2f} frames {share['shutter']}",
            "light": f"{light:.3g} of white, display values {share['light']}",
            "strength": str(strength),
        }
        return "\n".join(f"{name:<10} {text}" for name, text in rows.items())


def match(
    frames: Any, clean: Any = None, camera: Camera | CameraPath | None = None,
    fps: float | None = None, *, progress: Callable[[Iterable[Any]], Iterable[Any]] | None = None,
) -> Match:  # fmt: skip
    """Find what falls in a clip: snow, its wind, number, sizes, exposure and light.

    The background stands still, or moves as a whole since the camera turns. Metres follow from
    the law by which flakes of a size fall, and from the focal length; snow is taken to reach from
    0.4 to 60 m, with flakes of opacity 0.9, and the air to rise or sink nowhere.

    Parameters
    ----------
    frames : path or sequence of ndarray
        A film or a numbered sequence, or pictures (H, W, 3) of it in order: display values. At
        least 8; of more than 96 the first are looked at.
    clean : path or ndarray, optional
        The plate without snow: the mean opacity makes number and sizes surer, and one picture is
        then enough.
    camera : Camera or CameraPath, optional
        If not given, one that sees 45 degrees across, as a scene's.
    fps : float, optional
        Frames per second; the film's own rate, else 30.
    progress : callable, optional
        Called with the iterable of frames; returns one that shows how far it is, such as `tqdm`.

    Returns
    -------
    Match
        With `snow`, `light`, `errors`, and `scene(background)`.

    Raises
    ------
    ValueError
        When it cannot tell: the sentence says what is missing.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene("#304050", size=(256, 144), effects=[fl.Snow()], fps=30)
    >>> found = fl.match([scene.render(t) for t in range(16)])  # doctest: +SKIP
    """
    read, count, rate = _opened(frames)
    fps = real("fps", fps if fps is not None else (rate or 30.0), above=0.0)
    numbers: Iterable[int] = range(min(count, LONG))
    pictures = map(read, numbers if progress is None else progress(numbers))
    plate = None if clean is None else _picture(clean)
    if count == 1 and plate is None:
        raise Unmatched("frames has one picture: a still needs clean, its plate without snow")
    if 1 < count < LEAST:
        raise Unmatched(f"frames has {count} pictures: a film needs {LEAST}, a still one and clean")
    seen = watch(pictures, plate)
    height, width = seen.mean.shape[:2]
    if min(height, width) < WINDOW:
        raise Unmatched(f"frames are too small: {WINDOW} px are needed, got {width} x {height}")
    lens_of = _lens(camera, width * seen.scale)
    return _matched(seen, lens_of, fps)


def _opened(frames: Any) -> tuple[Callable[[int], Array], int, float | None]:
    if isinstance(frames, (str, os.PathLike)):
        source = open_background(frames)
        return lambda n: source.frame(n).pixels, source.count or 1, source.fps
    pictures = [frames] if np.ndim(frames) == 3 and not isinstance(frames, list) else list(frames)
    for picture in pictures:
        if np.ndim(picture) != 3 or np.shape(picture)[2] < 3:
            raise ValueError(f"frames must be pictures (H, W, 3), got shape {np.shape(picture)}")
    if not pictures:
        raise ValueError("frames must hold pictures, got none")
    return lambda n: np.asarray(pictures[n]), len(pictures), None


def _picture(clean: Any) -> Array:
    if isinstance(clean, (str, os.PathLike)):
        return np.asarray(open_background(clean).frame(0).pixels)
    return np.asarray(clean)


def _lens(camera: Any, width: int) -> Camera:
    if camera is None:
        return Camera(DEFAULT_FOCAL * width)
    if isinstance(camera, CameraPath):
        return camera.camera
    return expect_camera(camera)


def _matched(seen: Watched, camera: Camera, fps: float) -> Match:
    still = len(seen.frames) == 1
    luma, mean = seen.frames.mean(axis=3), seen.mean.mean(axis=2)
    if float(luma.std()) < _QUIET:
        raise Unmatched("no snow: nothing changes in frames")
    light, doubt = light_of(luma, mean)
    if seen.veil is not None:
        behind = mean if still else mean - seen.veil.mean(axis=2)
        if still:
            light, doubt = light_over(seen.veil.mean(axis=2), behind)
    deviations, counts = density(luma, mean, light)
    cover = None
    if seen.veil is not None:
        # How opaque the air is on average, by places that differ from the light.
        before = light - behind
        cover = float((seen.veil.mean(axis=2) * before).sum() / (before**2).sum())
        if not 0.002 < cover < 0.98:
            raise Unmatched("no snow: frames are no nearer to flakes' light than clean is")
        if still:
            deviations = (deviations - np.float32(cover) * counts) / np.float32(1.0 - cover)
    found = spectra(deviations, counts, 1 if still else LAGS)
    focal = camera.focal / seen.scale
    way = direction(found, focal)
    if not still and (way.share < _CLEAR or way.error > _TURN):
        moves = float(np.abs(seen.shifts).max()) > 0.5
        raise Unmatched(
            "no snow: what changes in frames has no direction that all of it shares"
            + ("; the camera moves, and may do so in other ways than it turns" if moves else "")
        )
    if not still and (doubt > _DOUBT * light or light > _WHITE):
        raise Unmatched(
            f"the light of flakes is not told from their number: it is {light:.2f} of white, give "
            f"or take {doubt:.2f}; a plate with dark and bright places is needed"
        )
    light = min(light, 1.0)
    if abs(math.sin(way.angle)) < _LEVEL or math.sin(way.angle) < 0.0:
        raise Unmatched(
            f"what moves goes {math.degrees(way.angle):.0f} degrees from right to below, which is "
            "no fall: the camera must stand upright, and the wind be below some 5 m/s"
        )
    many = 1_000_000 if still else len(seen.frames)
    lens = Lens(focal, fps, _NEAR, _FAR, _OPACITY, SNOW, WINDOW, many)
    got = fit(found, way, lens, veil=None if cover is None else -math.log1p(-cover))
    if got.misfit > _MISFIT and not still:
        raise Unmatched(
            f"what changes in frames is not like falling snow (misfit {got.misfit:.2f}): "
            "compression has eaten faint flakes, the background moves, or the camera travels"
        )
    air = got.air
    fall = SNOW.fall(air.sizes)
    speed = math.hypot(air.wind[0], fall)
    colors = np.clip(tinted(seen.frames, seen.mean, light), 0.0, None)
    low, size, high = (
        _LARGER * one for one in (air.sizes.smallest, air.sizes.mean, air.sizes.largest)
    )
    snow = Snow(
        density=air.density, flake_size=(low, size, high),
        wind=(air.wind[0], 0.0, way.approach * speed), shutter=min(air.shutter, 1.0), near=_NEAR,
        far=_FAR, opacity=_OPACITY,
    )  # fmt: skip
    known = dict(zip(("density", "size", "shutter"), np.hypot(got.errors, _SURE), strict=True))
    turn = abs(math.cos(way.angle) / math.sin(way.angle)) * way.error
    area = 0.25 * math.pi * _OPACITY * air.sizes.moment(2.0)
    veil = -math.expm1(-air.density * area * (_FAR - _NEAR))
    plate = seen.mean if still else (seen.mean - veil * colors) / (1.0 - veil)
    frame = seen.frames[len(seen.frames) // 2] + seen.mean
    return Match(
        snow=snow, light=Light(snow=tuple(srgb_to_linear(colors).tolist())),
        camera=camera.magnified(1.0 / seen.scale), fps=fps,
        direction=math.atan2(fall, air.wind[0]),
        speed=camera.focal * speed / fps / (0.5 * (_NEAR + _FAR)),
        errors={
            **{name: float(one) for name, one in known.items()}, "direction": way.error,
            "light": doubt / light, "speed": turn + 0.03,
        },
        plate=np.clip(plate, 0.0, 1.0), _frame=frame, _fit=got,
    )  # fmt: skip
