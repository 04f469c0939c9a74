"""A scene that begins again after N frames: flakes in two rounds, at t and at t - N."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries._contract import Float64
from flurries.camera.lens import quaternions_of, rotation_matrix, rotation_vector
from flurries.camera.path import CameraPath
from flurries.effects.cone import ConeRain, ConeSnow, beyond
from flurries.effects.falling import Rain, Snow
from flurries.effects.mist import Mist
from flurries.effects.motion import product
from flurries.effects.tent import TentRain, TentSnow
from flurries.frame.layer import Layer
from flurries.frame.needs import Needs, needs_of, renderer_of
from flurries.frame.program import effect_seed
from flurries.frame.view import Frame, Lap
from flurries.motion.keys import Keys
from flurries.motion.wind import FIELDS, Wind

if TYPE_CHECKING:
    from flurries.scene.rendering import Rendering

Axes = tuple[bool, bool, bool]

_NOTHING = 1e-9  # Metres and radians that are no difference.


def looped_scene(scene: Rendering, lap: Lap) -> tuple[Rendering, tuple[str, ...]]:
    """Return what runs of a scene that repeats, and in words what does not end as it began."""
    # Effects that draw one by one stand twice, a round apart.
    path, fps = scene._path, scene.fps
    bent: list[str] = []

    def close(name: str, thing: Any, *only: str) -> Any:
        if not is_dataclass(thing) or isinstance(thing, type):
            return thing
        changes = {}
        for key in only or [f.name for f in fields(thing) if f.init]:
            value = getattr(thing, key, None)
            made, back = closed(value, lap)
            if made is not value:
                changes[key] = made
            if back is not None:
                does = f"does not end as it begins: from frame {back:g} on it goes back"
                bent.append(f"{name}: {key} {does}")
        return replace(thing, **changes) if changes else thing

    shown: list[Any] = []
    names = [
        f"effects[{index}] ({getattr(effect, 'NAME', type(effect).__name__)})"
        for index, effect in enumerate(scene.effects)
    ]
    for index, (name, effect) in enumerate(zip(names, scene.effects, strict=True)):
        own, one = getattr(effect, "seed", None), close(name, effect)
        seed = effect_seed(scene.seed, index) if own is None else own
        # What is drawn of some stays at its place, but for a sway.
        sways = type(one) in _DRAWN and hasattr(one, "sway")
        if not (path.still and sways and one.parts.motion.still):
            shown += looped(one, lap, seed)
            continue
        if one.sway[0] != 0.0:
            turns = max(round(one.sway[1] * lap.frames / (math.tau * fps)), 1)
            rate = math.tau * fps * turns / lap.frames
            bent.append(f"{name}: it sways by {rate:.3g} radians a second, not {one.sway[1]:.3g}")
            one = replace(one, sway=(one.sway[0], rate))
        shown.append(replace(one, seed=seed))
    lamps = tuple(close(f"lights[{index}]", lamp) for index, lamp in enumerate(scene.lights))
    light, lens = close("light", scene.light), close("lens", scene.lens)
    if path.focal is not None and not isinstance(path.focal, Keys):
        path = replace(path, focal=Keys(list(enumerate(path.focal.tolist()))))
    path = close("camera", path, "velocity", "focal")
    banks = [effect for effect in scene.effects if isinstance(effect, Mist)]
    placed = any(bank.center is not None for bank in banks)
    placed |= not all(lamp.carried for lamp in scene.lights)
    stays = (placed, placed or any(bank.top is not None for bank in banks), placed)
    tilts = any(isinstance(effect, (ConeRain, ConeSnow)) for effect in scene.effects)
    path, of_camera = looped_path(path, lap.first, lap.frames, fps, stays=stays, tilts=tilts)
    bent += of_camera
    if scene._backdrop.count is not None:
        bent.append(
            f"background: it is shown from frame {lap.first} to {lap.end - 1} and begins again"
        )
    for name, effect in zip(names, scene.effects, strict=True):
        if words := _bending(effect, path, fps, lap):
            bent.append(f"{name}: {words}")
    parts = {"effects": tuple(shown), "lights": lamps, "light": light, "lens": lens}
    return scene._derive(_path=path, **parts), tuple(bent)


def _bending(effect: Any, path: CameraPath, fps: float, lap: Lap) -> str:
    if isinstance(effect, (ConeRain, ConeSnow)):
        rest, passed = beyond(effect.parts.texture, path, fps, lap)
        if abs(rest) < 1e-6:
            return ""
        return f"{abs(passed):.3g} tiles of its cone pass, {abs(passed - rest):.0f} in the loop"
    if isinstance(effect, (TentSnow, TentRain)) or (isinstance(effect, Mist) and effect.structure):
        return (
            "each wave of its texture turns by the nearest whole number of cycles, by up to "
            f"{0.5 / lap.frames:.2g} cycles a frame more or less"
        )
    return ""


def looped_path(
    path: CameraPath, first: int, frames: int, fps: float, *, stays: Axes, tilts: bool
) -> tuple[CameraPath, list[str]]:
    """Return a path whose rates repeat those of one round, and what was changed, in words."""
    # Focal length and velocity, where keyed, end as they begin. Along the axes of `stays` the path
    # must end where it began, since something stands in the world; `tilts`: it must look the way
    # that it looked, even if it turns at one rate.
    end, bent = first + frames, []
    gone = path.place(end, fps=fps) - path.place(first, fps=fps)
    back = np.where(stays, gone, 0.0)
    far = float(np.linalg.norm(back))
    moves = path.position is not None or isinstance(path.velocity, Keys)
    if far > _NOTHING:
        moves = True
        bent.append(
            f"camera: it ends {far:.3g} from where it began, where lamps or mist stand; its "
            f"velocity is changed by {far * fps / frames:.3g} a second"
        )
    turn, turning = np.zeros(3), path._turning
    steady = turning is None or bool((turning.rates == turning.rates[0]).all())
    if path.turns and turning is not None and (tilts or not steady):
        turn = rotation_vector(turning.at(first).T @ turning.at(end))
        angle = math.degrees(float(np.linalg.norm(turn)))
        if angle > _NOTHING:
            bent.append(
                f"camera: it ends {angle:.3g} degrees from where it looked; its turning is changed "
                f"by {angle * fps / frames:.3g} degrees a second"
            )
    turned = path.turns and (float(np.abs(turn).max()) > _NOTHING or not steady)
    if not (moves or turned):
        return path, bent
    # Every frame of a round, and its keys, so that straight pieces stay straight.
    times = np.arange(float(frames) + 1.0) + first
    for keyed in (path.position, path.orientation):
        if isinstance(keyed, Keys):
            times = np.union1d(times, [t for t, _ in keyed.keys if first < t < end])

    def place(t: float, rounds: int) -> Float64:
        part = (t - first) / frames
        return np.asarray(path.place(t, fps=fps) - part * back + rounds * (gone - back))

    def quaternion(t: float, _: int) -> Float64:
        less = rotation_matrix(-(t - first) / frames * turn)
        return np.asarray(quaternions_of((path.rig(t) @ less)[None])[0])

    def rounds(value: Callable[[float, int], Float64]) -> Keys:
        moments = [(float(t), n) for n in (-1, 0, 1) for t in times[:-1]]
        return Keys([(t + n * frames, tuple(value(t, n).tolist())) for t, n in moments])

    made = path
    if moves:
        made = replace(made, velocity=None, position=rounds(place))
    if turned:
        made = replace(made, orientation=rounds(quaternion))
    return replace(made, extend="on"), bent


_SAME = 1e-9  # Values that differ by less than this, of the larger one, are one.
_BACK = 0.25  # A number that does not end where it began goes back over this share of the film.

# Of effects that have both: the fields without which nothing is drawn one by one, and those without
# which nothing else is left.
_DRAWN: dict[type[Any], tuple[dict[str, Any], dict[str, Any]]] = {
    Snow: ({"density": 0.0}, {"haze": 0.0}),
    Rain: ({"density": 0.0}, {"haze": 0.0}),
    TentSnow: ({"flakes": 0, "flake_density": None}, {"texture": 0.0, "haze": 0.0}),
    TentRain: ({"drops": 0, "drop_density": None}, {"texture": 0.0, "haze": 0.0}),
    ConeSnow: ({"flakes": 0}, {"gain": 0.0, "haze": 0.0}),
}


@dataclass(frozen=True, eq=False)
class Earlier:
    """An effect as it was some frames ago, in the light and before the depth of now."""

    effect: Any
    frames: int
    seed: int
    NAME: str  # For people.

    def needs(self, frame: Frame) -> Needs:
        return needs_of(self.effect, self.then(frame))

    def render(self, frame: Frame) -> Layer | tuple[Layer, ...]:
        made: Layer | tuple[Layer, ...] = renderer_of(self.effect).render(self.then(frame))
        return made

    def then(self, frame: Frame) -> Frame:
        then = frame.later(-self.frames)
        turns = frame.path.turns or frame.path.zooms
        return then.derive(
            depth=frame.depth, ambient=frame.ambient, plate=frame.plate, lap=None,
            nearer=frame.nearer, shared=None if turns else frame.shared,
        )  # fmt: skip


def looped(effect: Any, lap: Lap, seed: int) -> tuple[Any, ...]:
    """Return effects that show one over and over, back to front; `seed` is its own."""
    if type(effect) not in _DRAWN:
        return (effect,)
    without, alone = _DRAWN[type(effect)]
    effect = replace(effect, seed=seed)
    if not any(getattr(effect, name) for name in without):
        return (effect,)
    begin, first, end = float(lap.first - lap.frames), float(lap.first), float(lap.end)
    now, then = (
        replace(effect, amount=product(effect.amount, Keys(share)), **alone)
        for share in ([(first, 1.0), (end, 0.0)], [(begin, 0.0), (first, 1.0)])
    )
    rounds = now, Earlier(then, lap.frames, seed, effect.NAME)
    rest = any(getattr(effect, name) != nothing for name, nothing in alone.items())
    return (replace(effect, **without), *rounds) if rest else rounds


def closed(value: Any, lap: Lap) -> tuple[Any, float | None]:
    """Return a keyed value for two rounds, and the frame from which it goes back to the first."""
    if isinstance(value, Wind):
        mean, back = closed(value.mean, lap)
        rest = {name: getattr(value, name) for name in FIELDS if name != "mean"}
        return (value if mean is value.mean else Wind(mean, **rest)), back
    if not isinstance(value, Keys):
        return value, None
    first, end = float(lap.first), float(lap.end)
    inside = [(t, v) for t, v in value.keys if first < t < end]
    begins, back = value.value(first), None
    if not _same(begins, value.value(end)):
        back = end - _BACK * lap.frames
        inside = [(t, v) for t, v in inside if t < back] + [(back, value.value(back))]
    elif all(_same(begins, v) for _, v in inside):
        return begins, None
    ring = [(first, begins), *inside]
    return Keys([(t + n * lap.frames, v) for n in (-2, -1, 0, 1) for t, v in ring]), back


def _same(one: Any, other: Any) -> bool:
    return bool(np.allclose(one, other, rtol=_SAME, atol=0.0))
