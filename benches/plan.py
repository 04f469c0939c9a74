"""What the plan saves, and how well it foresees times and bytes: ``python benches/plan.py``.

``--savings`` prints what each thing left out saves, as a ratio of least times, runs interleaved;
``--estimates`` the estimate against the time and the bytes of 23 scenes of different kinds;
``--tolerance`` what a tolerance saves, and whether more of it ever takes more time;
``--constants`` measures the cost model of `flurries.frame.costs` again. Without an option: the
first three.
"""

from __future__ import annotations

import argparse
import os
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from typing import Any

# Threads of BLAS that wait would count as work.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import flurries as fl
from flurries.camera import Camera
from flurries.effects.layout import Tiling, operations, torus_for
from flurries.frame import calibration, costs, planes, standing
from flurries.frame.effect import renderer_of
from flurries.frame.needs import Needs, Step, needs_of
from flurries.spectral.operations import tile_work

SIZE = 1024
RNG = np.random.default_rng(5)
PICTURE = RNG.integers(0, 255, (SIZE, SIZE, 3)).astype(np.uint8)
LIGHT = RNG.gamma(1.0, 0.3, (SIZE, SIZE, 3)).astype(np.float32)


def least(calls: dict[str, Callable[[], Any]], runs: int) -> dict[str, float]:
    """Return the least milliseconds of each call, runs interleaved, after one to warm up.

    Of the processor on one thread: on a machine that others use as well, the wall's are not ours.
    """
    fl.set_threads(1)
    times = {name: float("inf") for name in calls}
    for turn in range(runs + 1):
        for name, call in calls.items():
            start = time.process_time()
            call()
            if turn:
                times[name] = min(times[name], 1e3 * (time.process_time() - start))
    return times


# Savings -----------------------------------------------------------------------------------------


class Everything:
    """An effect whose needs are not asked: all its steps run, whatever they show."""

    def __init__(self, effect: Any) -> None:
        self.effect = effect
        self.seed = effect.seed

    def needs(self, frame: fl.Frame) -> Needs:
        """Return all steps."""
        names = ("texture", "flakes", "gas") + (("veil",) if frame.deep else ())
        return Needs(tuple(map(Step, names)), reads=frozenset({"depth"}))

    def render(self, frame: fl.Frame) -> fl.Layer:
        """Return the layer with nothing saved."""
        assert frame.run is not None
        run = replace(frame.run, kept=None, visible=None)
        return renderer_of(self.effect).render(replace(frame, run=run))


def savings() -> dict[str, tuple[fl.Scene, fl.Scene]]:
    """Return pairs of scenes: as planned, and with everything made."""

    def pair(effect: Any, **more: Any) -> tuple[fl.Scene, fl.Scene]:
        values = {"background": PICTURE, **more}
        effects = effect if isinstance(effect, list) else [effect]
        return (
            fl.Scene(effects=effects, **values),
            fl.Scene(effects=[Everything(one) for one in effects], **values),
        )

    still = {"fall": 0.0, "wind": (0.0, 0.0, 0.0), "sway": (0.0, 0.0)}
    matte = np.zeros((SIZE, SIZE), np.float32)
    matte[300:] = 1.0
    spotted = np.ones((SIZE, SIZE), np.float32)
    spotted[::512, ::512] = 0.0
    spotted[0, 0] = spotted[-1, -1] = 0.0
    return {
        "six effects, amount 0": pair([fl.TentSnow(amount=0.0)] * 6),
        "below half a step": pair(fl.TentSnow(amount=3e-5)),
        "no texture": pair(fl.TentSnow(texture=0.0, flakes=2000)),
        "no flakes": pair(fl.TentSnow(flakes=0)),
        # All of it, under the matte, is what the layers apart are made of.
        "behind a matte, 70 %": (
            fl.Scene(background=PICTURE, effects=[fl.TentSnow()], foreground=matte),
            fl.Scene(background=PICTURE, effects=[fl.TentSnow()]),
        ),
        "tiles behind a matte": pair(fl.TentSnow(flakes=0), foreground=spotted),
        "a wall nearer than the texture": pair(fl.TentSnow(flakes=0, haze=0.0), depth=2.0),
        "nothing moves": pair(fl.TentSnow(**still)),
        "no flakes of any opacity": pair(fl.TentSnow(flake_opacity=0.0)),
        "no veil before a depth": pair(fl.TentSnow(haze=0.0, flakes=0), depth=40.0),
        "waves too fast everywhere": pair(
            fl.TentSnow(flakes=0, fall=4e5, wind=(1.3e5, 0.0, 0.0), alias="cut", tile=63, overlap=9)
        ),
        "gas that stands still": pair(fl.Mist(count=300)),
        "gas of one color": (
            fl.Scene(background=PICTURE, effects=[fl.Mist(wind=(0.3, 0.0, 0.0), count=300)]),
            fl.Scene(
                background=PICTURE,
                effects=[fl.Mist(wind=(0.3, 0.0, 0.0), count=300)],
                sun=fl.Sun((0.3, 1.0, 0.2)),
            ),
        ),
    }


def print_pair(name: str, planned: fl.Scene, whole: fl.Scene, runs: int) -> None:
    """Print the frame of two scenes."""
    print_ratio(name, lambda: planned.render(3), lambda: whole.render(3), runs)


def print_ratio(name: str, planned: Callable[[], Any], whole: Callable[[], Any], runs: int) -> None:
    """Print the times of two calls, and what the first one saves."""
    found = least({"planned": planned, "all": whole}, runs)
    ratio = found["all"] / found["planned"]
    print(f"{name:<34}{found['planned']:>9.3f}{found['all']:>9.3f}{ratio:>8.1f}")


def print_savings(runs: int) -> None:
    """Print what is saved."""
    print(f"{SIZE} x {SIZE}, uint8, one thread, least of {runs} interleaved runs, ms")
    print(f"{'':<34}{'planned':>9}{'all':>9}{'ratio':>8}")
    for name, (planned, whole) in savings().items():
        print_pair(name, planned, whole, runs)
    snow = fl.Scene(background=PICTURE, effects=[fl.TentSnow()])
    print_ratio(
        "two eyes at distance 0",
        lambda: snow.stereo(3, distance=0.0),
        lambda: snow.stereo(3, distance=0.06),
        runs,
    )
    region = np.s_[100:200, 100:200]
    print_ratio(
        "a region of 1 %",
        lambda: snow.render(3, region=region),
        lambda: snow.render(3)[region],
        runs,
    )
    none = fl.Scene(background=PICTURE)
    gone = [fl.TentSnow(amount=0.0)] * 3 + [fl.TentRain(amount=0.0)] * 3
    six = fl.Scene(background=PICTURE, effects=gone)
    found = least({"six": lambda: six.render(3), "none": lambda: none.render(3)}, 20 * runs)
    print(f"six effects of amount 0 against none: {found['six'] / found['none']:.3f}")
    print_torus(runs)


def plane(part: Any, frame: fl.Frame) -> Any:
    """Return the opacity of flakes or of a texture."""
    motion = getattr(part, "field", part).motion
    return part.alpha(frame, 1.0, motion.way(frame))


def print_torus(runs: int) -> None:
    """Print tiles against one torus, for the film sizes and tiles that people have."""
    print(f"\n{'texture':<42}{'tiles':>9}{'torus':>9}{'ratio':>8}  the plan takes")
    for shape, tile, overlap, band in (
        ((1024, 1024), 64, 10, (3.0, 24.0)),
        ((1080, 1920), 120, 20, (5.6, 45.0)),
        ((1024, 1024), 240, 40, (2.0, 12.0)),
        ((1024, 1024), 600, 100, (2.0, 12.0)),
        ((1024, 1024), 128, 112, (8.0, 32.0)),
        ((512, 512), 100, 88, (8.0, 32.0)),
    ):
        given = {"drift": (3.0, 9.0), "seed": 1, "wavelengths": band}
        found = least(
            {
                "tiles": lambda s=shape, t=tile, o=overlap, g=given: fl.spectral.alpha(
                    s, tile=t, overlap=o, **g
                ),
                "torus": lambda s=shape, g=given: fl.spectral.alpha(s, tile=s, overlap=0, **g),
            },
            max(runs // 3, 3),
        )
        torus, _ = torus_for(shape, Tiling((tile, tile), overlap), band, 0.0)
        name = f"{shape[1]} x {shape[0]}, tiles {tile} - {overlap}, band {band[0]:g}-{band[1]:g}"
        ratio = found["tiles"] / found["torus"]
        taken = "tiles" if torus is None else "torus"
        print(f"{name:<42}{found['tiles']:>9.2f}{found['torus']:>9.2f}{ratio:>8.2f}  {taken}")


# A tolerance ---------------------------------------------------------------------------------


def tolerant() -> dict[str, fl.Scene]:
    """Return scenes that have something to save."""
    matte = np.full((SIZE, SIZE), 254.0 / 255.0, np.float32)
    matte[:300] = 0.0
    forward = {"wind": (0.3, 0.0, 0.0)}
    return {
        "8 bit in linear light": fl.Scene(None, PICTURE, effects=[fl.TentSnow()], space="linear"),
        "rain fades in": fl.Scene(None, LIGHT, effects=[fl.TentSnow(), fl.TentRain(amount=1e-4)]),
        "faint snow": fl.Scene(None, LIGHT, effects=[fl.TentSnow(amount=1e-4)]),
        "a matte of 254 / 255": fl.Scene(None, PICTURE, effects=[fl.TentSnow()], foreground=matte),
        "thick fog": fl.Scene(
            None, np.minimum(LIGHT, 1.0),
            effects=[fl.Mist(count=4000, density=0.9, lit=False, **forward)],
        ),
        "a thin veil": fl.Scene(
            None, LIGHT, effects=[fl.TentSnow(haze=1e-4, flakes=0)], depth=30.0
        ),
        "nothing to save": fl.Scene(None, PICTURE, effects=[fl.TentSnow()]),
    }  # fmt: skip


def print_tolerance(runs: int) -> None:
    """Print times by tolerance, errors expected and made, and whether times ever rise."""
    steps = (0.0, 1e-5, 1e-3, 1 / 255)
    print(f"\n{'tolerance':<26}" + "".join(f"{step:>9.2g}" for step in steps) + "  expected  real")
    worst = 0.0
    for name, scene in tolerant().items():
        calls = {str(step): (lambda s=scene, e=step: s.render(3, tolerance=e)) for step in steps}
        found = list(least(calls, runs).values())
        exact, near = scene.render(3).astype(np.float64), scene.render(3, tolerance=steps[-1])
        full = 255.0 if near.dtype == np.uint8 else 1.0
        error = np.abs(exact - near).max() / full
        expected = scene.plan(3, tolerance=steps[-1]).error
        times = "".join(f"{time:>9.2f}" for time in found)
        print(f"{name:<26}{times}{expected:>10.2g}{error:>10.2g}")
        rises = [after / min(found[:n]) for n, after in enumerate(found[1:], 1)]
        worst = max(worst, *rises)
    print(f"most that more tolerance took more time: {worst:.3f}")


# Estimates ---------------------------------------------------------------------------------------


def scenes() -> dict[str, fl.Scene]:
    """Return scenes of different kinds."""
    small, wide = PICTURE[:256, :256], np.tile(PICTURE, (2, 2, 1))[:1080, :1920]
    deep = np.full((SIZE, SIZE), 40.0, np.float32)
    deep[500:, :] = 8.0
    matte = np.zeros((SIZE, SIZE), np.float32)
    matte[600:] = 1.0
    forward = fl.CameraPath(Camera(1.2 * SIZE), velocity=(0.0, 0.0, 2.0))

    def scene(picture: Any, *effects: Any, **more: Any) -> fl.Scene:
        return fl.Scene(None, picture, effects=effects, **more)

    preset = fl.TentSnow.preset
    return {
        "empty": scene(PICTURE),
        "empty, float": scene(LIGHT),
        "light": scene(PICTURE, preset("light")),
        "moderate": scene(PICTURE, preset("moderate")),
        "heavy": scene(PICTURE, preset("heavy")),
        "blizzard": scene(PICTURE, preset("blizzard")),
        "paper": scene(PICTURE, preset("paper")),
        "moderate, 256 px": scene(small, preset("moderate")),
        "moderate, 1080p": scene(wide, preset("moderate")),
        "moderate, float": scene(LIGHT, preset("moderate")),
        "moderate, 8 bit in linear light": scene(PICTURE, preset("moderate"), space="linear"),
        "texture alone": scene(PICTURE, fl.TentSnow(flakes=0)),
        "flakes alone": scene(PICTURE, fl.TentSnow(texture=0.0, haze=0.0)),
        "60,000 flakes": scene(PICTURE, fl.TentSnow(texture=0.0, flakes=60_000)),
        "forward": scene(PICTURE, preset("moderate"), camera=forward),
        "behind a matte": scene(PICTURE, preset("moderate"), foreground=matte),
        "before a depth": scene(PICTURE, preset("moderate"), depth=deep),
        "snow and snow": scene(PICTURE, preset("light"), preset("heavy")),
        "drizzle": scene(PICTURE, fl.TentRain.preset("drizzle", jitter=True)),
        "half the amount": scene(PICTURE, fl.TentSnow(amount=0.5)),
        "fog": scene(PICTURE, fl.Mist.preset("fog", wind=(0.3, 0.0, 0.0))),
        "lit clouds": scene(
            PICTURE, fl.Mist.preset("clouds", wind=(0.3, 0.0, 0.0)), sun=fl.Sun((0.3, 1.0, 0.2))
        ),
        "rain on a cone": scene(PICTURE, fl.ConeRain()),
    }


def peak(scene: fl.Scene) -> int:
    """Return the most bytes that Python's and NumPy's memory grows by for a frame."""
    planes.MOST = 0  # Else what an earlier frame gave back is not counted.
    scene.render(2)
    planes._free.clear()
    standing._KEPT.clear()
    tracemalloc.start()
    scene.render(3)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def print_estimates(runs: int) -> None:
    """Print estimates beside what was measured."""
    every = scenes()
    fl.set_threads(1)
    # Calibrated in the same run, between the scenes: the machine is as busy for both.
    samples = calibration.samples()
    calls = {kind: call for kind, (call, _) in samples.items()}
    calls.update({name: (lambda s=scene: s.render(3)) for name, scene in every.items()})
    found = least(calls, runs)
    factors = {kind: found[kind] / model for kind, (_, model) in samples.items()}
    calibration.measure = lambda: factors
    calibration.scales(again=True)
    print("this machine against the model:", {k: round(v, 2) for k, v in factors.items()})
    print(f"\n{'scene':<34}{'ms':>9}{'planned':>9}{'ratio':>7}{'MiB':>9}{'planned':>9}{'ratio':>7}")
    worst_time = worst_bytes = 1.0
    for name, scene in every.items():
        plan, most = scene.plan(3), peak(scene)
        time_ratio, bytes_ratio = plan.milliseconds / found[name], plan.bytes / most
        worst_time = max(worst_time, time_ratio, 1.0 / time_ratio)
        worst_bytes = max(worst_bytes, bytes_ratio, 1.0 / bytes_ratio)
        print(
            f"{name:<34}{found[name]:>9.2f}{plan.milliseconds:>9.2f}{time_ratio:>7.2f}"
            f"{most / 2**20:>9.2f}{plan.bytes / 2**20:>9.2f}{bytes_ratio:>7.2f}"
        )
    print(f"worst factor: {worst_time:.2f} in time, {worst_bytes:.2f} in bytes")


# Constants ---------------------------------------------------------------------------------------


# What scenes ask of the texture.
MOVING: dict[str, Any] = {
    "drift": (3.0, 9.0), "velocity": (2.0, 6.0), "alias": "soft", "shutter": 0.5, "seed": 1,
    "preserve_mean": True, "mean": 0.05, "spread": 2.0,
}  # fmt: skip


def print_constants(runs: int) -> None:
    """Print the cost model, measured again on one thread."""
    fl.set_threads(1)
    found: dict[str, float] = {}
    layouts = [
        ((512, 512), 64, 10, (3.0, 24.0)),
        ((512, 512), 64, 32, (3.0, 24.0)),
        ((512, 512), 32, 5, (2.0, 8.0)),
        ((512, 512), 40, 5, (2.0, 20.0)),
        ((768, 768), 128, 20, (6.0, 48.0)),
        ((768, 768), 256, 40, (3.0, 24.0)),
        ((512, 512), 512, 0, (4.0, 32.0)),
        ((512, 512), 512, 0, (8.0, 32.0)),
        ((512, 512), 200, 30, (3.0, 24.0)),
        ((512, 512), 16, 2, (2.0, 6.0)),
        ((512, 512), 128, 0, (2.0, 32.0)),
        ((512, 512), 256, 0, (8.0, 32.0)),
        ((640, 640), 640, 0, (5.0, 32.0)),
    ]
    names = ["tile bin", "tile multiply-add", "tile fft", "large tile multiply-add",
             "large tile fft", "tile pixel", "texture pixel"]  # fmt: skip
    calls: dict[str, Callable[[], Any]] = {}
    rows = []
    for shape, tile, overlap, band in layouts:
        work = operations(shape, (0, shape[0], 0, shape[1]), Tiling((tile, tile), overlap), band)
        rows.append([work.get(name, 0.0) for name in names])
        assert work["planned bin"] == 0.0
        calls[str(len(calls))] = lambda s=shape, t=tile, o=overlap, b=band: fl.spectral.alpha(
            s, tile=t, overlap=o, wavelengths=b, **MOVING
        )
    times = 1e6 * np.array(list(least(calls, runs).values()))
    from scipy.optimize import nnls

    # Each layout counts alike.
    weights = 1.0 / times
    # Arithmetic and stores cost something, which bins and pixels that go with them would hide.
    floor = {"tile multiply-add": 0.01, "tile pixel": 0.1}
    least_each = np.array([floor.get(name, 0.0) for name in names])
    table = np.array(rows) * weights[:, None]
    above, _ = nnls(table, times * weights - table @ least_each)
    solved = least_each + above
    found.update(zip(names, solved, strict=True))
    fit = np.array(rows) @ solved / times
    # The band's waves listed anew.
    big = ((512, 512), (2.0, 12.0))
    work = tile_work(*big)
    whole = (
        1e6
        * least(
            {
                "": lambda: fl.spectral.alpha(
                    big[0], tile=512, overlap=0, wavelengths=big[1], **MOVING
                )
            },
            runs,
        )[""]
    )
    rest = sum(
        found[name] * number
        for name, number in operations(big[0], (0, 512, 0, 512), Tiling(big[0], 0), big[1]).items()
        if name in found
    )
    found["planned bin"] = max(whole - rest, 0.0) / work.planned
    # Directions spread at random.
    given = {"tile": 32, "overlap": 5, "wavelengths": (2.0, 12.0), **MOVING}
    work = operations((512, 512), (0, 512, 0, 512), Tiling((32, 32), 5), (2.0, 12.0))
    each = least(
        {
            "plain": lambda: fl.spectral.alpha((512, 512), **given),
            "jitter": lambda: fl.spectral.alpha((512, 512), jitter=True, **given),
        },
        runs,
    )
    found["jittered bin"] = 1e6 * (each["jitter"] - each["plain"]) / work["tile bin"]
    weather, _ = calibration.samples()["kernel"]
    found["weather"] = 1e6 * least({"weather": weather}, runs)["weather"]
    found.update(flakes(runs))
    found.update(mixing(runs))
    found.update(others(runs))
    print("texture fit, planned / measured:", np.round(fit, 2).tolist())
    for name, (kind, value) in costs.NANOSECONDS.items():
        new = found.get(name)
        print(f'    "{name}": ("{kind}", {value:.4g}),' + ("" if new is None else f"  # {new:.4g}"))


def flakes(runs: int) -> dict[str, float]:
    """Return nanoseconds for flakes placed and drawn, and for runs of their pixels."""
    from scipy.optimize import nnls

    result: dict[str, float] = {}
    for name, shutter in (("disc run", 0.0), ("streak run", 0.5)):
        rows, calls = [], {}
        for number, size, fall in (
            (2000, 0.02, 1.0),
            (8000, 0.02, 1.0),
            (8000, 0.004, 1.0),
            (8000, 0.03, 1.0),
            (8000, 0.02, 12.0),
            (6000, 0.05, 1.0),
        ):
            effect = fl.TentSnow(texture=0.0, haze=0.0, flakes=number, flake_size=(size, size),
                             shutter=shutter, fall=fall)  # fmt: skip
            scene = fl.Scene((SIZE, SIZE), effects=[effect])
            frame = scene.program.views(3.0)[0][1]
            drawn, pieces = effect.parts.flakes.footprints(frame)
            rows.append([effect.parts.flakes.count(frame), drawn, pieces])
            calls[f"{number} {size} {fall}"] = lambda e=effect, f=frame: plane(e.parts.flakes, f)
            # Placed and drawn are in proportion: one is timed where all are too large to be shown.
            none = replace(effect, flake_size=(90.0, 90.0))
            calls["places"] = lambda e=none, f=frame: plane(e.parts.flakes, f)
        found = least(calls, runs)
        masked = SIZE * SIZE * costs.NANOSECONDS["mask pixel"][1]
        each = max(1e6 * found.pop("places") - masked, 0.0) / rows[-1][0]
        table, times = np.array(rows), 1e6 * np.array(list(found.values()))
        known = SIZE * SIZE * costs.NANOSECONDS["mask pixel"][1] + each * table[:, 0]
        weights = 1.0 / times
        solved, _ = nnls(table[:, 1:] * weights[:, None], (times - known) * weights)
        fit = (known + table[:, 1:] @ solved) / times
        print(f"{name} fit, planned / measured:", np.round(fit, 2).tolist())
        result["flake placed"] = each
        result.update(zip((name.split()[0], name), solved, strict=True))
    # From arrays of places, as for a wind over depth.
    effect = fl.TentSnow(texture=0.0, haze=0.0)
    listed = replace(effect, wind=fl.Wind(effect.wind, profile=[(0.0, 1.0)]))
    frame = fl.Scene((SIZE, SIZE), effects=[effect]).program.views(3.0)[0][1]
    found = least(
        {
            "listed": lambda: plane(listed.parts.flakes, frame),
            "alike": lambda: plane(effect.parts.flakes, frame),
        },
        runs,
    )
    more = 1e6 * (found["listed"] - found["alike"])
    result["flake listed"] = max(more, 0.0) / effect.parts.flakes.count(frame)
    return result


def others(runs: int) -> dict[str, float]:
    """Return nanoseconds of gas for each pixel that it covers, and of a cone for each pixel."""
    fog, bank = (fl.Mist.preset(name, wind=(0.3, 0.0, 0.0)) for name in ("fog", "bank"))
    asks = {}
    for name, effect, sun in (
        ("gas pixel", fog, None),
        ("lit gas pixel", fog, fl.Sun((0.3, 1.0, 0.2))),
        ("slice pixel", bank, None),
        ("lit slice pixel", bank, fl.Sun((0.3, 1.0, 0.2))),
        ("cone pixel", fl.ConeRain(), None),
    ):
        scene = fl.Scene((SIZE, SIZE), effects=[effect], sun=sun)
        asks[name] = scene.program.views(3.0)[0]
    calls = {name: (lambda e=e, f=f: renderer_of(e).render(f)) for name, (e, f) in asks.items()}
    found = least(calls, max(runs // 3, 3))
    return {
        name: 1e6 * found[name] / needs_of(effect, frame).steps[0].cost().work[name]
        for name, (effect, frame) in asks.items()
    }


def mixing(runs: int) -> dict[str, float]:
    """Return nanoseconds of what is done for each pixel of a plane or a picture."""
    from flurries import _core
    from flurries.effects.veil import haze_before
    from flurries.frame.mixing import Mix

    planes = [RNG.random((SIZE, SIZE), np.float32) for _ in range(2)]
    depth = planes[0] * 50
    layer = fl.Layer("a", planes[0])
    colored = replace(layer, rgb=0.8 * planes[0][..., None] * np.ones(3, np.float32))
    word = PICTURE.astype(np.uint16) * 257
    values = np.linspace(0.5, 1.5, 1 << 16)
    roots = np.empty_like(values)
    snow = fl.TentSnow(flakes=0)
    wall = fl.Scene((SIZE, SIZE), depth=30.0, effects=[snow])
    air = fl.Scene((SIZE, SIZE), effects=[snow])
    open_air = air.program.views(3.0)[0][1]
    before = wall.program.views(3.0)[0][1]
    none = np.empty((0, 3))
    there = Mix(True, "display")
    bright = there.decode(PICTURE)

    def empty_splat() -> None:
        fl.particles.splat((SIZE, SIZE), none, 1.0, Camera(1.0), opacity=1.0)

    calls: dict[str, Callable[[], Any]] = {
        "mask pixel": empty_splat,
        "one": lambda: fl.composite.join(planes[:1]),
        "joined pixel": lambda: fl.composite.join(planes),
        "array pixel": lambda: planes[0] * planes[1],
        "array number": lambda: np.sqrt(values, out=roots),
        "plane": lambda: snow.render(open_air),
        "one pass": lambda: snow.over(open_air, PICTURE, list),
        "deep": lambda: plane(snow.parts.texture, before),
        "flat": lambda: plane(snow.parts.texture, open_air),
        "copied byte": PICTURE.copy,
        "veil pixel": lambda: haze_before(depth, 0.1, 100.0),
        "8 bit pixel": lambda: Mix(False, "display").over(PICTURE, layer),
        "16 bit pixel": lambda: Mix(False, "display").over(word, layer),
        "colored pixel": lambda: Mix(False, "display").over(PICTURE, colored),
        "32 bit pixel": lambda: Mix(True, "linear").over(LIGHT, layer),
        "to": lambda: there.decode(PICTURE),
        "from": lambda: there.encode(bright, PICTURE),
        "table": lambda: replace(there, table=True).encode(bright, PICTURE),
    }
    times = {name: 1e6 * value for name, value in least(calls, runs).items()}
    pixels = float(SIZE * SIZE)
    result = {name: value / pixels for name, value in times.items() if name in costs.NANOSECONDS}
    result["array number"] = times["array number"] / values.size
    both = times["one pass"] - times["plane"] + times["joined pixel"]
    result["fused pixel"] = max(both - times["8 bit pixel"], 0.0) / pixels
    result["limited pixel"] = (times["deep"] - times["flat"]) / pixels
    result["joined pixel"] = times["joined pixel"] / 2.0 / pixels
    result["copied byte"] = times["copied byte"] / PICTURE.nbytes
    result["encoded value"] = times["from"] / PICTURE.size
    result["decoded value"] = times["to"] / PICTURE.size
    result["looked up value"] = times["table"] / PICTURE.size
    assert _core is not None
    small = fl.Scene((8, 8), effects=[])
    one = fl.Scene((8, 8), effects=[fl.TentSnow(texture=0.0, flakes=0, haze=0.5)])
    each = least({"frame": lambda: small.render(1), "layer": lambda: one.render(1)}, 20 * runs)
    result["frame"] = 1e6 * each["frame"]
    result["layer"] = 1e6 * (each["layer"] - each["frame"])
    return result


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--savings", action="store_true")
    parser.add_argument("--estimates", action="store_true")
    parser.add_argument("--tolerance", action="store_true")
    parser.add_argument("--constants", action="store_true")
    parser.add_argument("--runs", type=int, default=15)
    options = parser.parse_args()
    if options.constants:
        print_constants(options.runs)
        return
    every = not (options.savings or options.estimates or options.tolerance)
    if options.savings or every:
        print_savings(options.runs)
    if options.tolerance or every:
        print_tolerance(options.runs)
    if options.estimates or every:
        print_estimates(options.runs)


if __name__ == "__main__":
    main()
