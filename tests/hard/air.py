"""Hard cases of camera, time, flakes and compositing."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import mpmath
import numpy as np

import flurries as fl
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


def backwards(dtype: Any) -> float:
    ahead, back = (C.tile_drift(SHAPE, (0.0, 0.0, z), EYE, near_depth=10.0) for z in (1.5, -1.5))
    return worst(ahead + back)


def behind_the_eye(dtype: Any) -> float:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, -2.0], [0.0, 0.0, -0.0]], dtype)
    found, _ = C.project(points, EYE, SHAPE)
    return float(np.isnan(found).all(axis=1).sum())


def disparity(depth: float) -> Any:
    """Left less right image of a point, times depth over f b."""

    def measure(dtype: Any) -> float:
        point = np.array([[0.5, -0.25, depth]], dtype)
        left, right = (
            C.project(point, fl.Camera(600.0, offset=(x, 0.0, 0.0)), SHAPE)[0][0]
            for x in (-0.03125, 0.03125)
        )
        return float((left[0] - right[0]) * float(dtype(depth)) / (600.0 * 0.0625))

    return measure


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
    snow = fl.TentSnow(fall=0.0, wind=(0.0, 0.0, 0.0), flakes=200, sway=(0.0, 0.0), shutter=0.0)
    scene = fl.Scene((160, 120), camera=path, effects=[snow])
    return float(np.count_nonzero(scene.render(1e6) != scene.render(0)))


def extension(t: float) -> Any:
    def measure(dtype: Any) -> float:
        places = np.array([[0, 0, 0], [1, 2, 3], [2, 4, 6], [4, 8, 12]], dtype)
        return float(fl.CameraPath(EYE, position=places).place(t, fps=30.0)[2])

    return measure


# Time ---------------------------------------------------------------------------------------------


def running_sum(dtype: Any) -> float:
    """The integral of sqrt(2)/10 over 10^6 frames, kept as 10^5 keys: the error."""
    value = math.sqrt(2.0) / 10.0
    keys = fl.Keys([(10.0 * i, value) for i in range(100_001)])
    return float(Fraction(keys.integral(1e6)) - Fraction(value) * 10**6)


def keyed(t: float) -> Any:
    """The integral of a ramp 0..1 over 100 frames: t^2/200, then t - 50; 0 before."""

    def measure(dtype: Any) -> float:
        return float(fl.Keys([(0, 0.0), (100, 1.0)]).integral(t))

    return measure


# Flakes -------------------------------------------------------------------------------------------


def outside_the_box(box: float, time: float) -> Any:
    """Flakes outside [-B/2, B/2) around the centre."""

    def measure(dtype: Any) -> float:
        got = P.positions(2000, box, seed=1, velocity=(0.1 * box, 1.0 * box, -0.5 * box), time=time)
        half = 0.5 * box
        return float(np.count_nonzero((got < -half) | (got >= half)))

    return measure


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


def whole_boxes(time: float) -> Any:
    """How far flakes are from where they were after whole numbers of boxes, in boxes."""

    def measure(dtype: Any) -> float:
        about: Any = {"seed": 3, "velocity": (8.0, -16.0, 24.0)}
        before, after = (P.positions(500, 8.0, time=t, **about) for t in (0.0, time))
        off = (after - before) / 8.0
        return worst(off - np.round(off))

    return measure


def energy(sigma: float, length: float = 0.0, place: float = 0.3) -> Any:
    """The sum of a faint flake's alpha over 2 pi opacity sigma^2; the picture holds all of it."""

    def measure(dtype: Any) -> float:
        side = int(2 * (8 * max(sigma, 1.0) + length) + 32)
        camera, depth = fl.Camera(1000.0), 10.0
        radius = 3.0 * sigma * depth / 1000.0
        point = np.array([[place * depth / 1000.0, 0.4 * place * depth / 1000.0, depth]])
        speed = (length * depth / 1000.0, 0.0, 0.0)
        got = P.splat((side, side), point, radius, camera, opacity=1e-3, velocity=speed,
                      shutter=1.0, dtype=dtype)  # fmt: skip
        return float(np.sum(got, dtype=np.float64) / (2e-3 * math.pi * sigma**2))

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


def long_streak(length: float) -> Any:
    """Light in the picture of a streak much longer than it, over its share of the exposure."""

    def measure(dtype: Any) -> float:
        got = P.splat((64, 200), [[0.0, 0.0, 10.0]], 0.06, fl.Camera(1000.0), opacity=1.0,
                      velocity=(length / 100.0, 0.0, 0.0), shutter=1.0, dtype=dtype)  # fmt: skip
        wanted = 2.0 * math.pi * 2.0**2 * 200.0 / length
        return float(np.sum(got, dtype=np.float64) / wanted)

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


def behind_a_wall(offset: float) -> Any:
    def measure(dtype: Any) -> float:
        wall = np.full((16, 16), 5.0 + offset, dtype)
        got = P.splat((16, 16), [[0.0, 0.0, 5.0]], 0.1, fl.Camera(100.0), opacity=0.5, depth=wall,
                      dtype=dtype)  # fmt: skip
        return float(got.max() > 0.0)

    return measure


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


def opaque(dtype: Any) -> float:
    picture = np.array([[[1e30, -5.0, 0.0]]], dtype)
    got = fl.composite.snow(picture, np.ones((1, 1), dtype), intensity=0.25)
    return worst(got - 0.25)


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


def lamp(dtype: Any) -> float:
    """A lamp of 1e30 under alpha 1/2: half of it and half the snow, relative."""
    got = fl.composite.snow(np.full((1, 1, 3), 1e30, dtype), np.full((1, 1), 0.5, dtype))
    return float(got[0, 0, 0]) / 5e29


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
    Case("backwards is the reverse of forwards", backwards, 0.0, 0.0, WALL,
         "the sign of Tz is kept"),
    Case("points at and behind the eye have no image", behind_the_eye, 3.0, 0.0, "a count",
         "depth 0 and less"),
    *[
        Case(f"disparity times depth over f b, at {z:g} m", disparity(z), 1.0, tol,
             "eps of 80 px over the disparity", "both eyes see one point")
        for z, tol in ((1e-3, 1e-12), (2.0, 1e-12), (1e6, 1e-7))
    ],
    *[
        Case(f"a rotation by {a:.8g} rad", rotation(a), 0.0, 1e-15, "4 eps", "a series below 1e-8")
        for a in (0.0, 9.999999e-9, 1.0000001e-8, 1e-5, math.pi, 1e-300)
    ],
    Case("pixels that differ after a closed path of 10^6 frames", closed_path, 0.0, 0.0, WALL,
         "a frame is a function of the place, not of the way"),
    *[
        Case(f"a path of 4 places at frame {t:g}: z", extension(t), z, 1e-13, "4 eps",
             "linear on both sides")
        for t, z in ((-2.0, -6.0), (0.5, 1.5), (10.0, 54.0))
    ],
    Case("the integral of sqrt(2)/10 over 10^6 frames, error", running_sum, 0.0, 3e-11,
         "half an ulp of 1.4e5, and 10^5 areas rounded alike; a plain sum is 1.5e-7 off",
         "compensated sums"),
    *[
        Case(f"the integral of a ramp at {t:g}", keyed(t), want, 1e-9 if t > 1e5 else 1e-12,
             "4 eps of the value", "first and last value hold outside")
        for t, want in ((-50.0, 0.0), (50.0, 12.5), (100.0, 50.0), (1e6, 999950.0))
    ],
    *[
        Case(f"flakes outside a box of {b:g} m after {t:g} s", outside_the_box(b, t), 0.0, 0.0,
             "a count", "a fold, since rounding can leave the box by an ulp")
        for b, t in ((1e-100, 1.0), (1e100, 1.0), (7.3, 1e6), (7.3, -1e6), (0.1, 1e-9))
    ],
    *[
        Case(f"flakes sent to the wall of a box of {b:g} m, +- an ulp: outside", at_the_edge(b),
             0.0, 0.0, "a count", "a fold, since rounding can leave the box by an ulp")
        for b in (0.1, 3.0, 7.3)
    ],
    *[
        Case(f"flakes after {t:.0e} whole boxes, in boxes", whole_boxes(t), 0.0, tol,
             "eps of the way in boxes, 3 t", "float64 places")
        for t, tol in ((1.0, 1e-15), (1e6, 1e-9))
    ],
    *[
        Case(f"light of a resting flake, sigma {s:g} px", energy(s), 1.0, 2e-3,
             "the promise of 0.2 % at any place", "sigma_e^2 is at least 0.38")
        for s in (0.01, 0.2, 0.5446, 0.5447, 0.6, 5.0)
    ],
    *[
        Case(f"light of a streak of {n:g} px, sigma 1 px", energy(1.0, n), 1.0, 2e-3,
             "the promise of 0.2 %", "a series for short streaks")
        for n in (1e-12, 2e-6, 1e-3, 0.011, 0.099, 0.101, 1.0, 30.0)
    ],
    *[
        Case(f"jump at a streak of {r:g} sigma_e", streak_jump(r), 0.0, (4e-6, 1e-9),
             "series against error functions, both right to this; the lengths differ by 2e-9",
             "the switch from series to error functions, 0.45 in float64 and 2 in float32")
        for r in (0.01, 0.1, 0.45, 2.0)
    ],
    *[
        Case(f"light of a streak of {n:.0e} px in 200 px", long_streak(n), 1.0, 3e-3,
             "0.2 %, and the ends of the footprint", "error functions in the tails")
        for n in (1e4, 1e6)
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
    Case("a wall nearer by 1e-6 hides a flake", behind_a_wall(-1e-6), 0.0, 0.0, WALL,
         "the depth map"),
    Case("a wall behind does not", behind_a_wall(1e-6), 1.0, 0.0, WALL, "the depth map"),
    *[
        Case(f"bytes that change under alpha 0, background {v:g}", transparent(v), 0.0, 0.0, WALL,
             "b + a (s - b) would lose bits of b")
        for v in (0.1, 1e30, 1e-40, -0.0)
    ],
    Case("alpha 1 over anything is the snow", opaque, 0.0, 0.0, WALL, "(1 - a) b is 0 at 1"),
    Case("uint8 that is not the nearest, of 65,792", rounding, 0.0, 0.0, "a count",
         "rounding, not cutting"),
    Case("half of a lamp of 1e30", lamp, 1.0, (1e-7, 1e-15), "2 eps", "no range is assumed"),
]  # fmt: skip
