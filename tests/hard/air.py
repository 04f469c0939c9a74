"""Hard cases of camera, time, flakes and compositing."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

import flurries as fl
from flurries.effects import TentSnow
from hard.case import Case, worst

C, P = fl.camera, fl.particles
EYE = fl.Camera(600.0)
SHAPE = (120, 160)

# The camera ---------------------------------------------------------------------------------------


def drift_at_centre(z: float) -> Any:
    """The drift of a tile whose middle is the principal point, for a flight straight ahead."""

    def measure(dtype: Any) -> float:
        camera = fl.Camera(600.0, center=(32.0, 32.0))
        return worst(C.tile_drift(SHAPE, np.array([0.0, 0.0, z]), camera, near_depth=10.0)[0, 0])

    return measure


def drift_limit(z: float) -> Any:
    """How far a drift with forward motion z is from that of the sideways part alone, px."""

    def measure(dtype: Any) -> float:
        side = np.array([0.25, -0.5, z])
        got = C.tile_drift(SHAPE, side, EYE, near_depth=10.0)
        return worst(got - np.array([-15.0, 30.0]))

    return measure


def behind_the_eye(dtype: Any) -> float:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, -2.0], [0.0, 0.0, -0.0]], dtype)
    found, _ = C.project(points, EYE, SHAPE)
    return float(np.isnan(found).all(axis=1).sum())


def rotation(angle: float) -> Any:
    """Largest error of a rotation matrix about (2, -1, 2)/3, against mpmath."""

    def measure(dtype: Any) -> float:
        vector = tuple(angle * part / 3.0 for part in (2.0, -1.0, 2.0))
        got = fl.Camera(1.0, rotation=vector).matrix()
        with mpmath.workdps(40):
            x, y, z = (mpmath.mpf(v) for v in vector)
            cross = mpmath.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            exact = mpmath.expm(cross, method="taylor")
            return max(abs(float(mpmath.mpf(float(got[i, j])) - exact[i, j]))
                       for i in range(3) for j in range(3))  # fmt: skip

    return measure


def closed_path(dtype: Any) -> float:
    """Pixels that differ after a way of 10^6 frames that ends where it began."""
    path = fl.CameraPath(EYE, position=fl.Keys([(0, (0, 0, 0)), (5e5, (3e4, 1e3, 7.0)),
                                                (1e6, (0, 0, 0))]))  # fmt: skip
    snow = TentSnow(fall=0.0, wind=(0.0, 0.0, 0.0), flakes=200, sway=(0.0, 0.0), shutter=0.0)
    scene = fl.Scene(size=(160, 120), camera=path, effects=[snow])
    return float(np.count_nonzero(scene.render(1e6) != scene.render(0)))


# Time ---------------------------------------------------------------------------------------------


def running_sum(dtype: Any) -> float:
    """The integral of sqrt(2)/10 over 10^6 frames, kept as 10^5 keys: the error."""
    value = math.sqrt(2.0) / 10.0
    keys = fl.Keys([(10.0 * i, value) for i in range(100_001)])
    return float(Fraction(keys.integral(1e6)) - Fraction(value) * 10**6)


# Flakes -------------------------------------------------------------------------------------------


def at_the_edge(box: float) -> Any:
    """Flakes outside [-B/2, B/2) that are sent to the edge itself, an ulp up or down, far away."""

    def measure(dtype: Any) -> float:
        start = P.positions(100, box, seed=1, velocity=(0.0, 0.0, 0.0), time=0.0)
        outside = 0
        for i, place in enumerate(start):
            for boxes in (0.0, 1.0, 1e6):
                way = boxes * box + 0.5 * box - place
                for move in (np.nextafter(way, -np.inf), way, np.nextafter(way, np.inf)):
                    got = P.positions(i + 1, box, seed=1, velocity=move, time=1.0)[i]
                    outside += np.count_nonzero((got < -0.5 * box) | (got >= 0.5 * box))
        return float(outside)

    return measure


def streak_jump(ratio: float) -> Any:
    """Relative jump of a streak's brightest pixel across a switch of formulas at a length."""

    def measure(dtype: Any) -> float:
        peaks = []
        for length in (ratio * (1 - 1e-9), ratio * (1 + 1e-9)):
            # In units of sigma_e, the root of 3^2 + 1/12 px.
            speed = (math.sqrt(9.0 + 1.0 / 12.0) * length / 100.0, 0.0, 0.0)
            got = P.splat((64, 64), [[0.0, 0.0, 10.0]], 0.09, fl.Camera(1000.0), opacity=0.5,
                          velocity=speed, shutter=1.0, dtype=dtype)  # fmt: skip
            peaks.append(got.astype(np.float64))
        return worst(peaks[1] - peaks[0]) / float(peaks[0].max())

    return measure


def drawn_at(depth: float) -> Any:
    def measure(dtype: Any) -> float:
        got = P.splat((64, 64), [[0.0, 0.0, depth]], 1e-3, fl.Camera(100.0), opacity=0.5,
                      near=0.5, dtype=dtype)  # fmt: skip
        return float(got.max() > 0.0)

    return measure


def crossing(dtype: Any) -> float:
    """Peak of a flake that comes from depth 0.9 to 0.1, near plane 0.5, over that of half of it."""
    got = P.splat((64, 64), [[0.0, 0.0, 0.5]], 0.21, fl.Camera(100.0), opacity=0.5,
                  velocity=(0.0, 0.0, -0.8), shutter=1.0, near=0.5, dtype=dtype)  # fmt: skip
    # It rests in the picture, 10 px of sigma at depth 0.7, for half the exposure.
    variance = 100.0 + 1.0 / 12.0
    share = 100.0 / variance * (1.0 + 4.8e-4 / variance)
    return float(got.max()) / (0.5 * 0.5 * share * math.exp(-0.25 / variance))


def many_layers(dtype: Any) -> float:
    """Opacity of 10^5 wide flakes of 1e-5 on one another, at the middle: 1 - (1 - a)^n."""
    n = 100_000
    points = np.zeros((n, 3))
    points[:, 2] = 1.0
    got = P.splat((3, 3), points, 30.0, fl.Camera(1000.0, center=(1.5, 1.5)), opacity=1e-5,
                  dtype=dtype)  # fmt: skip
    return float(got[1, 1])


# Compositing --------------------------------------------------------------------------------------


def transparent(value: float) -> Any:
    """Values that change under alpha 0."""

    def measure(dtype: Any) -> float:
        changed = 0
        # One by one, and as many as vectors hold.
        for shape in ((2, 2, 3), (2, 67, 3)):
            picture = np.full(shape, value, dtype)
            got = fl.composite.snow(picture, np.zeros(shape[:2], dtype))
            changed += np.count_nonzero(got.view(np.uint8) != picture.view(np.uint8))
        return float(changed)

    return measure


def rounding(dtype: Any) -> float:
    """uint8 results that differ from exact rationals, rounded half up, of 256 x 257 pairs."""
    alpha = (np.arange(257) / 256).astype(dtype)
    picture = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 257, axis=1)
    cover = np.broadcast_to(alpha, (256, 257)).copy()
    got = fl.composite.snow(picture, cover, intensity=1.0)
    # The same one by one: rows of two pixels fill no vector.
    pairs = fl.composite.snow(picture.reshape(-1, 2), cover.reshape(-1, 2), intensity=1.0)
    wrong = int(np.count_nonzero(pairs.reshape(256, 257) != got))
    for value in range(256):
        for step in range(257):
            exact = Fraction(step, 256) * 255 + (1 - Fraction(step, 256)) * value
            if exact - Fraction(int(got[value, step])) not in _HALVES:
                wrong += abs(exact - int(got[value, step])) > Fraction(1, 2)
    return float(wrong)


_HALVES = (Fraction(1, 2), Fraction(-1, 2))


WALL = "exact"
CASES = [
    *[
        Case(f"a tile on the focus of expansion, forward {z:g}", drift_at_centre(z), 0.0, 0.0, WALL,
             "no division by the forward speed")
        for z in (1.0, -1.0, 1e-310, 1e99)
    ],
    *[
        Case(f"sideways flight, forward {z:g}: distance from the limit, px", drift_limit(z), 0.0,
             1e-13, "4 eps of 30 px", "no division by the forward speed")
        for z in (0.0, 1e-310, -1e-310, 1e-17)
    ],
    Case("points at and behind the eye have no image", behind_the_eye, 3.0, 0.0, "a count",
         "depth 0 and less"),
    *[
        Case(f"a rotation by {a:.8g} rad", rotation(a), 0.0, 1e-15, "4 eps", "a series below 1e-8")
        for a in (0.0, 9.999999e-9, 1.0000001e-8, 1e-5, math.pi, 1e-300)
    ],
    Case("pixels that differ after a closed path of 10^6 frames", closed_path, 0.0, 0.0, WALL,
         "a frame is a function of the place, not of the way"),
    Case("the integral of sqrt(2)/10 over 10^6 frames, error", running_sum, 0.0, 3e-11,
         "half an ulp of 1.4e5, and 10^5 areas rounded alike; a plain sum is 1.5e-7 off",
         "compensated sums"),
    *[
        Case(f"flakes sent to the wall of a box of {b:g} m, +- an ulp: outside", at_the_edge(b),
             0.0, 0.0, "a count", "a fold, since rounding can leave the box by an ulp")
        for b in (0.1, 3.0, 7.3)
    ],
    *[
        Case(f"jump at a streak of {r:g} sigma_e", streak_jump(r), 0.0, (4e-6, 1e-9),
             "series against error functions, both right to this; the lengths differ by 2e-9",
             "the switch from series to error functions, 0.45 in float64 and 2 in float32")
        for r in (0.01, 0.1, 0.45, 2.0)
    ],
    Case("a flake at the near plane is drawn", drawn_at(0.5), 1.0, 0.0, WALL, "the equal case"),
    Case("a flake that crosses the near plane: its share of the exposure", crossing, 1.0,
         (1e-6, 1e-13), "float32 opacity", "the motion is cut before the division"),
    Case("an ulp nearer it is not", drawn_at(math.nextafter(0.5, 0.0)), 0.0, 0.0, WALL,
         "the near plane"),
    Case("at depth 0 it is not", drawn_at(0.0), 0.0, 0.0, WALL, "the near plane"),
    Case("behind the eye it is not", drawn_at(-1.0), 0.0, 0.0, WALL, "the near plane"),
    Case("10^5 layers of 1e-5", many_layers, -math.expm1(1e5 * math.log1p(-1e-5)), 1e-6,
         "float64 transmittance; the amplitude's factor for the rim is below 1e-9 here",
         "transmittance in float64"),
    *[
        Case(f"bytes that change under alpha 0, background {v:g}", transparent(v), 0.0, 0.0, WALL,
             "b + a (s - b) would lose bits of b")
        for v in (0.1, 1e30, 1e-40, -0.0)
    ],
    Case("uint8 that is not the nearest, of 65,792", rounding, 0.0, 0.0, "a count",
         "rounding, not cutting"),
]  # fmt: skip
