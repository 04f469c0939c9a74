"""From real falling snow to a scene: what falls in a clip, how fast, how large, in which light."""

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from flurries._contract import Array, Float64, real
from flurries.camera import Camera
from flurries.camera.lens import expect_camera
from flurries.camera.path import CameraPath
from flurries.effects import Snow
from flurries.io import linear_to_srgb, open_background, srgb_to_linear
from flurries.io.files import path_text
from flurries.io.sources import VideoSource
from flurries.light.shot import Light
from flurries.matching.candidate import ALIKE, COUNT, LEVEL, leaning, nearer, peaks, shown
from flurries.matching.direction import WINDOW, direction, spectra
from flurries.matching.fit import FAR, NEAR, OPACITY, Lens, fit, sizes_of
from flurries.matching.streaks import Way
from flurries.matching.watched import LONG, LUMA, WIDE, Watched, light_of, smaller, tinted, watch
from flurries.particles.sizes import SNOW
from flurries.scene import Scene
from flurries.scene.scene import DEFAULT_FOCAL

# A film needs so many frames.
LEAST = 8
# It cannot be told where nothing changes; where the motion is less clear, or less sure in radians;
# where it is level; where waves or peaks are so unlike; from such errors of light, of density on.
_QUIET, _CLEAR, _TURN, _LEVEL, _MISFIT, _UNLIKE = 1e-4, 3.0, 0.15, 0.15, 1.5, 1.6
_DOUBT, _FEW = 0.12, 0.5
# Errors of a still are so many times as large, and its light is right by a share: by seven of the
# loop's frames.
_STILL, _STILL_LIGHT = 1.5, 0.08
# What waves tell, before peaks do, of number, of size, and of size where number goes with its cube;
# where they fit as well as the last says. What exposure is right by at best, and so many streaks
# tell it.
_BEFORE, _CUBES, _FITS, _EXPOSED, _STREAKS = (0.5, 0.12), 0.4, 0.5, 0.06, 20
# What number, size and light are right by besides: clips 100 to 129 of `docs/make_match.py`.
_SURE = 0.15, 0.07, 0.025
# In metres: a mean size below which it is as fast for its size as drops are, and the depth that
# half of the flakes' cover is before.
_DROPS, _MEDIAN = 0.0015, 0.5 * (NEAR + FAR)


class Unmatched(ValueError):
    """What falls in a clip cannot be told: a sentence says what is missing."""


@dataclass(frozen=True)
class Match:
    """What falls in a clip, as :func:`flurries.match` finds it; `print` it for a table."""

    snow: Snow  # In "ambient" light.
    light: Light  # Of what falls.
    camera: Camera  # That metres hold for.
    fps: float  # Frames a second that speeds hold for.
    direction: float  # In the middle of the picture, radians from +x to +y.
    speed: float  # At the median depth, half-way to the farthest, px a frame.
    # Standard deviations: of "direction" in radians, of "density", "size", "shutter", "speed" and
    # "light" as shares of their values.
    errors: dict[str, float]
    plate: Array = field(repr=False)  # (H, W, 3) without snow, display values; wide ones smaller.
    _frame: Array = field(repr=False)

    def scene(self, background: Any = None, **more: Any) -> Scene:
        """Return a scene over a background, else the plate with the clip's light and camera."""
        own: dict[str, Any] = {"fps": self.fps, "effects": [self.snow]}
        if background is None:
            background = np.rint(255.0 * self.plate).astype(np.uint8)
            own |= {"camera": self.camera, "light": self.light, "lens": None}
        return Scene(background, **{**own, **more})

    def report(self) -> Array:
        """Return a frame of the clip beside one of the matched scene, (H, 2 W, 3) uint8."""
        real = np.rint(255.0 * np.clip(self._frame, 0.0, 1.0)).astype(np.uint8)
        return np.hstack([real, self.scene().render(0)])

    def __str__(self) -> str:
        assert isinstance(self.snow.wind, tuple) and isinstance(self.snow.flake_size, tuple)
        angle, turn = np.degrees([self.direction, self.errors["direction"]])
        (x, _, z), size = self.snow.wind, self.snow.flake_size[1]
        share = {name: f"+- {100.0 * error:.0f} %" for name, error in self.errors.items()}
        light = float(np.mean(linear_to_srgb(np.array(self.light.snow))))
        return f"""\
direction  {angle:.1f} degrees from right to below +- {turn:.1f}
speed      {self.speed:.3g} px a frame at {_MEDIAN:.3g} m {share["speed"]}
wind       {x:.2f} m/s to the right, {z:.2f} away
density    {self.snow.density:.3g} flakes per m3 {share["density"]}
size       {1e3 * size:.2g} mm {share["size"]}
exposure   {self.snow.shutter:.2f} frames {share["shutter"]}
light      {light:.3g} of white, display values {share["light"]}
strength   {self.snow.strength()}"""


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
    clip = _opened("frames", frames)
    fps = real("fps", fps if fps is not None else (clip.fps or 30.0), above=0.0)
    whole = None if clean is None else _opened("clean", clean)
    if whole and whole.size != clip.size:
        raise ValueError(f"clean must be {clip.size} as frames are, got {whole.size}")
    plate = whole and whole.read(0)
    if isinstance(camera, CameraPath):
        camera = camera.camera
    elif camera is not None:
        expect_camera(camera)
    _refuse(
        clip.number < LEAST and (clip.number > 1 or plate is None),
        f"frames has {clip.number}: a film needs {LEAST}, and one picture needs clean, its plate",
    )
    numbers = range(min(clip.number, LONG))
    with ThreadPoolExecutor(1) as aside:
        used = aside.submit(leaning, clip.film) if clip.film else None
        seen = watch(map(clip.read, progress(numbers) if progress else numbers), plate)
    height, width = seen.mean.shape[:2]
    _refuse(
        min(height, width) < WINDOW,
        f"frames are too small: {WINDOW} px are needed, got {width} x {height}",
    )
    lens = Camera(DEFAULT_FOCAL * width) if camera is None else camera.magnified(1.0 / clip.scale)
    return _matched(seen, lens, fps, used.result() / clip.scale**2 if used else 0.0)


class _Given(NamedTuple):
    """What is looked at: pictures made smaller until they are at most `WIDE`."""

    read: Callable[[int], Array]  # Of a number from 0: (h, w, 3) float32, of white.
    number: int
    fps: float | None  # A film's rate.
    film: str | None  # Its path.
    size: tuple[int, ...]  # (height, width) before.
    scale: int


def _opened(name: str, given: Any) -> _Given:
    if isinstance(given, (str, os.PathLike)):
        path = path_text(name, given)
        source = open_background(path)
        scale = -(-source.size[0] // WIDE)
        film = path if isinstance(source, VideoSource) else None

        def read(n: int) -> Array:
            if isinstance(source, VideoSource):
                return smaller(source.smaller(n, scale), 1)
            return smaller(source.frame(n).pixels, scale)

        return _Given(read, source.count or 1, source.fps, film, source.size[::-1], scale)
    pictures = [given] if getattr(given, "ndim", 0) == 3 else [np.asarray(one) for one in given]
    came = {one.shape for one in pictures}
    if len(came) != 1 or len(pictures[0].shape) != 3 or pictures[0].shape[2] < 3:
        raise ValueError(f"{name} must have pictures (H, W, 3) of one size, got {came or 'none'}")
    size = pictures[0].shape[:2]
    scale = -(-size[1] // WIDE)
    return _Given(lambda n: smaller(pictures[n], scale), len(pictures), None, None, size, scale)


def _refuse(when: bool, why: str) -> None:
    if when:
        raise Unmatched(why)


def _matched(seen: Watched, camera: Camera, fps: float, used: float) -> Match:
    film = len(seen.frames) > 1
    luma, mean = seen.frames @ LUMA, seen.mean @ LUMA
    _refuse(float(luma.std()) < _QUIET, "no snow: nothing changes in frames")
    light, doubt = light_of(luma, mean) if film else (1.0, 0.0)
    cover = None
    if seen.clean is not None:
        behind = seen.clean @ LUMA
        if not film:
            # Its veil, a (L - B), is nothing where the plate B is as bright as the light L.
            slope, height = np.polyfit(behind.ravel(), (mean - behind).ravel(), 1).tolist()
            light = -height / slope if slope < 0.0 else 2.0
            doubt = _STILL_LIGHT * light
        # How opaque the air is on average, by places that differ from the light.
        cover = float(((mean - behind) * (light - behind)).sum() / ((light - behind) ** 2).sum())
        _refuse(not 0.002 < cover < 0.98, "no snow: frames are no nearer to white than clean is")
    found = spectra(luma, mean, light)
    way = direction(found, camera.focal)
    turns = "; the camera does more than turn" if np.abs(seen.shifts).max() > 0.5 else ""
    _refuse(
        film and (way.share < _CLEAR or way.error > _TURN),
        f"no snow: what changes in frames has no direction that all of it shares{turns}",
    )
    level = f"{math.degrees(way.angle):.0f} degrees from right to below: the camera must be upright"
    _refuse(math.sin(way.angle) < _LEVEL, f"no fall: what moves goes {level}")
    lens = Lens(camera.focal, fps, len(seen.frames), (mean.shape[1], mean.shape[0]))
    got = fit(found, way, lens, None if cover is None else -math.log1p(-cover))
    wind, fall = got.air.wind, SNOW.fall(got.air.sizes)
    speed, size = math.hypot(wind, fall), got.air.sizes.mean
    _refuse(size < _DROPS, "what falls is as fast for its size as rain is")
    snow = _snow(
        Snow(near=NEAR, far=FAR, opacity=OPACITY, shutter=min(got.air.shutter, 1.0),
             wind=(wind, 0.0, way.approach * speed)),
        math.log(got.density), math.log(size),
    )  # fmt: skip
    known, wider = np.array([*got.errors[:2], doubt]), 1.0 if film else _STILL
    if film:
        first = snow, light, doubt, got.misfit
        ray = Way(math.cos(way.angle), math.sin(way.angle), way.approach / camera.focal)
        snow, light, known, unlike = _closer(seen, luma, *first, used, camera, fps, ray)
        few = "compression has eaten faint flakes, the background moves, or the camera travels"
        odd = unlike > _UNLIKE or got.misfit > _MISFIT
        _refuse(odd, f"what changes is not like falling snow: {few}")
        few = f"number: {light:.2f} of white +- {known[2]:.2f}; a plate must have dark and bright"
        _refuse(known[2] > _DOUBT * light, f"the light of flakes is not told from their {few}")
    density, size, bright = (wider * np.hypot(known, _SURE)).tolist()
    if not film:
        light = min(light, 1.0)
        density, bright = math.hypot(density, 2.0 * doubt / light), doubt
    few = "too few flakes are seen: their number is right by"
    _refuse(density > _FEW * (1.0 if film else 2.0), f"{few} {density:.0%} only")
    turn, colors = way.error / abs(math.tan(way.angle)), tinted(seen.frames, seen.mean, light)
    return Match(
        snow=snow, light=Light(snow=tuple(srgb_to_linear(colors).tolist())), camera=camera,
        fps=fps, direction=math.atan2(fall, wind), speed=camera.focal * speed / fps / _MEDIAN,
        errors={
            "direction": way.error, "density": density, "size": size, "light": bright / light,
            "shutter": wider * math.hypot(got.errors[2], _EXPOSED), "speed": turn + 0.03,
        },
        plate=_plate(seen, snow, colors), _frame=seen.frames[len(seen.frames) // 2] + seen.mean,
    )  # fmt: skip


def _snow(like: Snow, number: float, size: float) -> Snow:
    """Return snow of another density and mean size, of which logarithms are given."""
    sizes = sizes_of(math.exp(size))
    wide = sizes.smallest, sizes.mean, sizes.largest
    return replace(like, density=math.exp(number), flake_size=wide)


def _plate(seen: Watched, snow: Any, colors: Float64 | float) -> Array:
    """Return the plate, which if not given is the mean without a veil, (h, w, 3) float32."""
    if seen.clean is not None:
        return np.clip(seen.clean, 0.0, 1.0)
    area = 0.25 * math.pi * OPACITY * sizes_of(snow.flake_size[1]).moment(2.0)
    veil = -math.expm1(-snow.density * area * (FAR - NEAR))
    return np.asarray(np.clip((seen.mean - veil * colors) / (1.0 - veil), 0.0, 1.0), np.float32)


def _closer(
    seen: Watched, luma: Array, snow: Any, light: float, doubt: float, misfit: float, used: float,
    camera: Camera, fps: float, way: Way,
) -> tuple[Snow, float, Float64, float]:  # fmt: skip
    """Return snow and light that show the clip's peaks, (3,) errors, and how unlike they are."""
    mean = seen.mean @ LUMA
    count, level = min(COUNT, len(luma)), LEVEL if used else None
    unsure = max(1.0, misfit / _FITS) ** 2
    spread = np.diag(np.square([*_BEFORE, doubt / unsure]))
    spread[:2, :2] += _CUBES**2 * np.outer((-3.0, 1.0), (-3.0, 1.0))
    known = np.asarray(np.linalg.inv(unsure**2 * spread), float)
    start = at = np.array([math.log(snow.density), math.log(snow.flake_size[1]), light])

    def tried(seed: int) -> tuple[Float64, Float64, float, float, float]:
        """Return where a candidate leads, its covariance, how unlike, its bytes, and exposure."""
        air = _snow(snow, *at[:2])
        plate = _plate(seen, air, at[2]) @ LUMA
        ours, took = shown(air, camera, fps, plate, at[2], level, seed, count, way)
        those = found.result()
        by, error, unlike = nearer(those, ours, float(at[2]), start - at, known)
        told = min(len(those.streaks), len(ours.streaks)) > _STREAKS
        longer = those.streaks.mean() / ours.streaks.mean() if told else 1.0
        shutter = float(np.clip(snow.shutter * longer, 0.01, 1.0))
        return np.minimum(at + by, (np.inf, np.inf, 1.0)), error, unlike, took, shutter

    with ThreadPoolExecutor(1) as aside:
        # What a codec takes its first frame from is not before it, and it keeps more.
        found = aside.submit(peaks, luma[1:], mean, count - 1, way)
        at, *_, took, shutter = tried(0)
    snow = replace(snow, shutter=shutter)
    if level is not None and not ALIKE[0] < took / used < ALIKE[1]:
        # A step of 6 is half the bytes.
        level = min(max(level + 6.0 * math.log2(max(took / used, 0.01)), 0.0), 45.0)
    # What two more lead to, drawn at once, is less by chance.
    with ThreadPoolExecutor(2) as both:
        ends = zip(*both.map(tried, (1, 2)), strict=True)
    at, error, unlike, _, shutter = (np.mean(part, axis=0) for part in ends)
    # A number is judged by the share that it is off by: so this one's mean square is least.
    at[0] -= 1.5 * (error[0, 0] + _SURE[0] ** 2)
    snow = replace(snow, shutter=float(shutter))
    return _snow(snow, *at[:2]), float(at[2]), np.sqrt(np.diag(error)), float(unlike)
