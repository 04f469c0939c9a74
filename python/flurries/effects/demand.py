"""What snow and rain need for a frame: which of their steps show anything, and what these cost."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from flurries.effects.peopled import FADE_IN
from flurries.effects.tiling import count, texture_cost
from flurries.frame.needs import PARTS, Cost, LeftOut, Needs, Step, skipped
from flurries.motion.keys import Keys, value_at
from flurries.motion.wind import Wind
from flurries.spectral.contrast import TABLE_BYTES

if TYPE_CHECKING:
    from flurries.effects.falling import Falling
    from flurries.frame.layer import Frame

# Fields that only the flakes, or only the mixing, depend on.
_NOT_TEXTURE = frozenset({"color", "haze", "flakes", "flake_size", "flake_opacity", "sway"})
# Pixels that are drawn together.
RUN = 32

_NOT_FLAKES = frozenset({"color", "haze", "texture", "mean", "spread", "power"})


def needs_of_falling(effect: Falling, frame: Frame) -> Needs:
    """Return the needs of snow or rain."""
    name, t = effect.NAME, frame.t
    amount = value_at(effect.amount, t)
    kind = effect.population(t)
    if amount == 0.0:
        return Needs((), (LeftOut(name, "its amount is 0"),), most=0.0)
    texture = amount * value_at(effect.texture, t)
    haze = amount * value_at(effect.haze, t)
    opacity = 0.0 if kind.empty else kind.opacity
    deep = frame.deep or frame.depth is not None
    steps, left_out = [], []
    if texture > 0.0:
        still = _stands_still(effect, frame, _NOT_TEXTURE)
        steps.append(Step("texture", lambda: _texture(effect, frame), once=still))
    else:
        left_out.append(LeftOut(f"{name}: texture", "its opacity is 0"))
    if opacity > 0.0:
        still = _stands_still(effect, frame, _NOT_FLAKES) and 0.0 in kind.sway
        steps.append(Step("flakes", lambda: _flakes(effect, frame, amount), once=still))
    else:
        why = "there are none" if kind.empty else "their opacity is 0"
        left_out.append(LeftOut(f"{name}: {kind.name}", why))
    if haze == 0.0:
        left_out.append(LeftOut(f"{name}: veil", "its opacity is 0"))
    elif deep:
        pixels = _pixels(frame)
        steps.append(Step("veil", lambda: Cost({"veil pixel": pixels}, "", 4 * pixels, 8 * pixels)))
    faint = _faint(effect, frame, amount, opacity)
    bounds = {"texture": texture, "flakes": faint, "veil": haze}
    savings = tuple(skipped(step, bounds[step.name]) for step in steps)
    clear = (1.0 - texture) * (1.0 - haze) * (1.0 - faint)
    if clear == 1.0:
        return Needs((), (LeftOut(name, "nothing of it has any opacity"),), most=0.0)
    planes = max(len(steps), 1)
    steps.append(Step("join", lambda: _joined(frame, planes)))
    reads = PARTS if effect.color == "ambient" else PARTS - {"ambient"}
    one_pass = steps[0].name == "texture" and not (steps[0].once or deep)
    return Needs(
        tuple(steps),
        tuple(left_out),
        reads,
        most=1.0 - clear,
        in_one_pass=one_pass,
        by_rows=True,
        savings=savings,
    )


def _pixels(frame: Frame) -> int:
    top, bottom, left, right = frame.window
    return (bottom - top) * (right - left)


def _joined(frame: Frame, planes: int) -> Cost:
    pixels = _pixels(frame)
    return Cost({"joined pixel": planes * pixels}, f"{planes} planes", 4 * pixels)


def _stands_still(effect: Falling, frame: Frame, apart: frozenset[str]) -> bool:
    """Whether nothing moves and nothing but the fields that stand apart is keyed."""
    if not frame.settled or isinstance(effect.wind, Wind):
        return False
    mine = [getattr(effect, f.name) for f in fields(effect) if f.name not in apart]
    if any(isinstance(value, Keys) for value in mine):
        return False
    return value_at(effect.fall, 0.0) == 0.0 and not np.any(value_at(effect.wind, 0.0))


def _faint(effect: Falling, frame: Frame, amount: float, opacity: float) -> float:
    """Return a bound on the flakes' opacity: the sum of all of theirs, since few are shown."""
    if opacity == 0.0:
        return 0.0
    if amount >= 0.1:
        return 1.0
    # Of rank r from 0 to 1 a flake shows by (amount - 0.9 r) / 0.1: the first, and the integral.
    shown = amount / 0.1 + effect.count(frame) * amount**2 / 0.18
    return min(shown * opacity, 1.0)


def _texture(effect: Falling, frame: Frame) -> Cost:
    tiling, why = effect.layout(frame)
    torus = tiling.tile == frame.shape and tiling.overlap == 0
    left_out = [LeftOut("tiles" if torus else "one torus instead of tiles", why)]
    visible = None if frame.run is None else frame.run.visible
    hidden, passes = 0, 1
    if visible is not None:
        seen = visible.tiles(*tiling)
        hidden = int(seen.size - seen.sum())
    hidden = min(hidden, int(np.prod(count(frame.shape, frame.window, tiling))))
    if hidden:
        left_out.append(LeftOut(f"{hidden} tiles", "they are behind what stands in front"))
    if effect.depth_mode == "pixel" and frame.deep:
        octaves = math.log2(effect.far_depth(frame.shape) / effect.near_depth)
        passes = max(math.ceil(octaves - 1e-9), 1)
    band = effect.band(frame.shape)
    cost = texture_cost(
        frame.shape,
        frame.window,
        tiling,
        band,
        hidden=hidden,
        passes=passes,
        jitter=effect.jitter,
    )
    cost = replace(cost, left_out=tuple(left_out))
    if not frame.deep:
        return cost
    pixels = _pixels(frame)
    work: dict[str, Any] = {**cost.work, "limited pixel": passes * pixels}
    scratch = cost.scratch + (24 if passes > 1 else 4) * pixels
    return replace(cost, work=work, scratch=max(scratch, TABLE_BYTES))


def _flakes(effect: Falling, frame: Frame, amount: float) -> Cost:
    kind = effect.population(frame.t)
    placed = effect.count(frame)
    drawn, runs = footprints(effect, frame)
    height, width = frame.shape
    # The last flakes in are fading.
    part = min(amount / (1.0 - FADE_IN), 1.0)
    share = min(_pixels(frame) / (height * width), 1.0)
    name = "streak" if value_at(effect.shutter, frame.t) > 0.0 else "disc"
    work = {
        "flake placed": placed * part,
        name: drawn * part * share,
        f"{name} run": runs * part * share,
        "mask pixel": float(height * width),
    }
    size = f"{round(drawn * part * share)} {kind.name}"
    unseen = LeftOut(
        f"{kind.name} out of view", f"some {placed - round(drawn * part * share)} of {placed}"
    )
    plane = 4 * _pixels(frame)
    if effect.alike(frame):
        return Cost(work, size, plane, 0, (unseen,))
    # First, of each placed: place, fade, its columns, how far it reaches, and one more; for a
    # camera that turns its velocity as well, and that across. Then what is left of those in the
    # view, with sizes still of all. The plane comes when these have gone.
    first, then = (
        (129 if frame.path.turns else 73) * placed,
        8 * placed + 90 * round(drawn * part),
    )
    work["flake listed"] = float(placed)
    return Cost(work, size, plane, max(first, then, plane) - plane, (unseen,))


def footprints(effect: Falling, frame: Frame) -> tuple[float, float]:
    """Return how many flakes are drawn, and runs of pixels in their rows, on average."""
    kind = effect.population(frame.t)
    # Depths of equal numbers of flakes: the view is a pyramid.
    depth = kind.reach * ((np.arange(64) + 0.5) / 64.0) ** (1.0 / 3.0)
    radius = 0.5 * np.linspace(*kind.sizes, 8)[:, None]
    focal = frame.camera.focal
    sigma = focal * radius / (3.0 * depth)
    _, high = (limit * frame.width_scale for limit in effect._LARGEST_SIGMA)
    drawn = (sigma < high) & (depth > 0.1)
    wide = 8.0 * np.sqrt(np.maximum(sigma**2 + 1.0 / 12.0, 0.38))
    blur = focal * value_at(effect.shutter, frame.t) / depth
    across, down = (blur * abs(rate) for rate in frame.to_camera(effect.velocity(frame))[:2])
    rows = np.minimum(wide + down, frame.shape[0])
    runs = rows * np.ceil(np.minimum(wide + across, frame.shape[1]) / RUN)
    number = effect.number_in_view(frame)
    return number * float(drawn.mean()), number * float((drawn * runs).mean())
