"""A valid call of every public function: what the tests of all of them start from.

`test_every_function.py` lists the public functions itself; one without a call here fails there.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
from flurries import (
    accuracy,
    augment,
    cli,
    composite,
    cone,
    gas,
    hybrid,
    io,
    particles,
    spectral,
    stereo,
    trace,
)
from flurries.augment.corrupt import corrupt
from flurries.camera import importers as cameras
from flurries.output import groups, manifest
from flurries.output.write import write
from flurries.scene import toml as scenefile
from flurries.scene.fingerprint import fingerprint

# Modules of other libraries' transforms, which need those, and the one that runs when imported.
ELSEWHERE = ("albumentations", "kornia", "torchvision", "__main__")

# Functions of libraries that need not be here.
MISSING = {
    name for name, library in (
        ("view", "anywidget"), ("viewer.view", "anywidget"), ("output.groups.to_dask", "dask"),
    )
    if importlib.util.find_spec(library) is None
}  # fmt: skip
if "view" in MISSING:
    ELSEWHERE += ("widget",)

# Parts of `CameraPath`, effects, weather and the command: they get what those have checked.
INNER = ("turning", "keys", "demo", "calibration")


@dataclass(frozen=True)
class Call:
    """A valid call.

    Attributes
    ----------
    of : callable
    given : dict
        Every argument by its name, arrays as contiguous float64.
    numbers : tuple of str
        Those that are arrays of numbers: the same values in another dtype give the same answer.
    pictures : tuple of str
        Those that are pictures: integers mean their full scale, floats themselves.
    light : tuple of str
        Pictures whose integers mean display values and whose floats mean light.
    spectra : tuple of str
        Those that are complex; `test_flakes_depth.py` tries their layouts and dtypes.
    empty : tuple of str
        Those that may be empty.
    shapeless : bool
        Whether arrays may have any shape.
    within : float
        How far answers of float32 arrays may be from those of float64, relative to the largest.
    heavy : tuple of str
        Those of which a large number, or none at all, is an order for that much work.
    both : dict
        Arrays that must be alike: whoever changes the one changes the other.
    """

    of: Callable[..., Any]
    given: dict[str, Any]
    numbers: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    empty: tuple[str, ...] = ()
    shapeless: bool = False
    within: float = 1e-5
    light: tuple[str, ...] = ()
    spectra: tuple[str, ...] = ()
    heavy: tuple[str, ...] = ()
    both: dict[str, str] = field(default_factory=dict)


def functions() -> dict[str, Callable[..., Any]]:
    """Return every public function of the package by its name: what some `__all__` holds."""
    found: dict[int, tuple[str, Callable[..., Any]]] = {}
    names = ["flurries"]
    for module in pkgutil.walk_packages(fl.__path__, "flurries."):
        parts = module.name.split(".")
        hidden = any(part.startswith("_") for part in parts)
        if not hidden and parts[-1] not in (*ELSEWHERE, *INNER):
            names.append(module.name)
    for name in names:
        module = importlib.import_module(name)
        for public in getattr(module, "__all__", ()):
            if f"{name}.{public}".removeprefix("flurries.") in MISSING:
                continue
            value = getattr(module, public)
            if inspect.isfunction(value):
                # By the shortest way to it.
                short = f"{name}.{public}".removeprefix("flurries.")
                kept = found.get(id(value))
                if kept is None or len(short) < len(kept[0]):
                    found[id(value)] = (short, value)
    return dict(sorted(found.values()))


def rng() -> np.random.Generator:
    return np.random.default_rng(11)


CAMERA = fl.Camera(40.0)
SHAPE = (24, 32)
POINTS = rng().uniform([-1.0, -0.8, 1.5], [1.0, 0.8, 5.0], (6, 3))
RADII = rng().uniform(0.05, 0.2, 6)
# Eighths: whole in every dtype after `scaled`, so that integers mean the same numbers.
PLANE = rng().integers(0, 2, SHAPE).astype(np.float64)
PICTURE = rng().integers(0, 2, (*SHAPE, 3)).astype(np.float64)
LAYER = np.dstack([0.5 * PICTURE, np.full(SHAPE, 0.5)])
WALL = rng().integers(2, 9, SHAPE).astype(np.float64)
TABLE = spectral.band_amplitude((16, 16), wavelengths=(3.0, 16.0))
PHASE = spectral.random_phase((16, 16), seed=1)
FLAKES = spectral.flake_patterns(
    16, counts=[4, 9], diameters=[[1, 2], [1, 3]], patterns=2, shear=0.382, seed=1
)
FRAME = {"drift": np.array([3.0, 9.0]), "seed": 3, "tile": 16, "overlap": 5,
         "wavelengths": (2.5, 16.0), "shift": np.array([1.0, 0.0]),
         "velocity": np.array([1.0, 2.0]), "shutter": 0.5, "alias": "soft"}  # fmt: skip
STUDY = accuracy.Study(accuracy.AXES["blend"], (accuracy.Point("a", 0.1, 1.0, 1.0, 20),))
POPULATION = hybrid.Population(density=2.0, radius=(0.004, 0.01), depth=(2.0, 30.0))
MATRICES = np.stack([np.eye(4)] * 3)
MATRICES[:, 0, 3] = (0.0, 1.0, 2.0)


def scenes(folder: Path) -> fl.Scene:
    return fl.Scene((32, 24), "#304050", effects=[fl.Snow(flakes=20)])


def calls(folder: Path) -> dict[str, Call]:
    """Return the calls; the files that they read and write are in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    byte = (255 * PICTURE).astype(np.uint8)
    png, exr, film = folder / "picture.png", folder / "layers.exr", folder / "film.mkv"
    views, sets = folder / "views.exr", folder / "pictures"
    io.write_picture(png, byte)
    io.write_layers(exr, {"rgba": LAYER.astype(np.float32), "depth": WALL.astype(np.float32)})
    io.write_views(views, PICTURE.astype(np.float32), PICTURE.astype(np.float32))
    with io.VideoWriter(film, (32, 24), 24) as video:
        video.write(byte)
    (folder / "way.csv").write_text("frame,x,y,z\n0,0,0,0\n1,0,0,1\n")
    (folder / "way.chan").write_text("1 0 0 0 0 0 0\n2 0 0 1 0 0 0\n")
    (folder / "poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n")
    sets.mkdir(exist_ok=True)
    io.write_picture(sets / "one.png", byte)
    scene = scenes(folder)
    scene.save(folder / "scene.toml")
    scene.write(folder / "frames" / "%04d.png", "1-2")
    colmap = folder / "colmap"
    colmap.mkdir(exist_ok=True)
    (colmap / "cameras.txt").write_text("1 PINHOLE 32 24 40 40 16 12\n")
    (colmap / "images.txt").write_text("1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 -1 1 b.png\n\n")
    record = augment.Snowfall(severity=2).record(index=1)
    direction = np.array([0.0, 1.0, 0.0])
    splat = {"shape": SHAPE, "points": POINTS, "radius": RADII, "camera": CAMERA,
             "opacity": np.full(6, 0.5), "velocity": direction, "shutter": 0.5,
             "depth": WALL}  # fmt: skip
    clouds = {"shape": SHAPE, "centers": POINTS, "radius": RADII, "density": np.ones(6),
              "camera": CAMERA, "depth": WALL}  # fmt: skip
    given = {"scene": scene, "frames": "1-9", "group": 2}
    guests = {} if "output.groups.to_dask" in MISSING else {
        "output.groups.to_dask": Call(groups.to_dask, given)
    }  # fmt: skip
    if "view" not in MISSING:
        guests["view"] = Call(fl.view, {"scene": scene})
    return guests | {
        # arrays in, arrays out
        "spectral.tent_rate": Call(
            spectral.tent_rate, {"shape": (16, 16), "velocity": np.array([1.0, 2.0])},
            numbers=("velocity",)),
        "spectral.velocity_from_paper": Call(
            spectral.velocity_from_paper, {"C": 1.0, "theta": 0.5, "period": 64.0}),
        "spectral.band_amplitude": Call(
            spectral.band_amplitude, {"shape": (16, 16), "wavelengths": (3.0, 16.0)}),
        "spectral.random_phase": Call(spectral.random_phase, {"shape": (16, 16), "seed": 1}),
        "spectral.advance_phase": Call(
            spectral.advance_phase,
            {"phase": PHASE, "drift": np.array([1.0, 2.0]), "shift": np.array([3.0, 1.0])},
            numbers=("phase", "drift", "shift"), within=1e-6),
        "spectral.temporal_filter": Call(
            spectral.temporal_filter, {"amplitude": TABLE, "velocity": np.array([9.0, 9.0])},
            numbers=("amplitude", "velocity")),
        "spectral.inverse_transform": Call(
            spectral.inverse_transform, {"amplitude": TABLE, "phase": PHASE},
            numbers=("amplitude", "phase")),
        "spectral.tile_starts": Call(
            spectral.tile_starts, {"length": 100, "tile": 32, "overlap": 5}),
        "spectral.blend_tiles": Call(
            spectral.blend_tiles,
            {"tiles": rng().integers(0, 2, (2, 2, 16, 16)).astype(float), "shape": (27, 20),
             "overlap": 5}, numbers=("tiles",)),
        "spectral.field": Call(
            spectral.field, {"shape": SHAPE, **FRAME}, numbers=("drift", "shift", "velocity")),
        "spectral.alpha": Call(
            spectral.alpha, {"shape": SHAPE, **FRAME}, numbers=("drift", "shift", "velocity")),
        "spectral.flake_patterns": Call(
            spectral.flake_patterns,
            {"tile": 16, "counts": np.array([4.0, 9.0]), "diameters": np.ones((2, 2)),
             "shear": 0.382, "seed": 1}, numbers=("counts", "diameters")),
        "spectral.optical_depth": Call(
            spectral.optical_depth,
            {"shape": SHAPE, "patterns": FLAKES, "drift": np.array([[3.0, 9.0], [1.0, 5.0]]),
             "velocity": np.array([[1.0, 2.0], [0.0, 1.0]]), "shutter": 0.5,
             "gain": np.array([1.0, 2.0]), "shear": 0.382, "seed": 3, "overlap": 5},
            numbers=("drift", "velocity", "gain"), spectra=("patterns",)),
        "spectral.opacity": Call(spectral.opacity, {"field": PLANE}, numbers=("field",)),
        "spectral.volume": Call(
            spectral.volume, {"frames": 4, "size": 16, "velocity": np.array([1.0, 2.0]), "seed": 1,
                              "wavelengths": (3.0, 16.0)}, numbers=("velocity",)),
        "spectral.loop": Call(
            spectral.loop, {"frames": 4, "shape": (16, 16), "velocity": np.array([1.0, 2.0]),
                            "seed": 1, "time": np.array([0.0, 2.0]), "wavelengths": (3.0, 16.0)},
            numbers=("velocity", "time")),
        "spectral.export_loop": Call(
            spectral.export_loop, {"pattern": folder / "loop" / "%02d.png", "frames": 2,
                                   "shape": (16, 16), "velocity": np.array([1.0, 2.0]), "seed": 1,
                                   "wavelengths": (3.0, 16.0), "overwrite": True},
            numbers=("velocity",), heavy=("frames",)),
        "camera.project": Call(
            fl.camera.project, {"points": POINTS, "camera": CAMERA, "shape": SHAPE},
            numbers=("points",), empty=("points",)),
        "camera.image_velocity": Call(
            fl.camera.image_velocity,
            {"points_px": 10.0 * POINTS[:, :2], "depth": POINTS[:, 2], "velocity": direction,
             "camera": CAMERA, "shape": SHAPE, "rotation": 0.1 * direction},
            numbers=("points_px", "depth", "velocity", "rotation")),
        "camera.tile_drift": Call(
            fl.camera.tile_drift, {"shape": SHAPE, "displacement": direction, "camera": CAMERA,
                                   "near_depth": 5.0, "tile": 16, "overlap": 5},
            numbers=("displacement",)),
        "camera.tile_shift": Call(
            fl.camera.tile_shift, {"shape": SHAPE, "rotation": direction, "camera": CAMERA,
                                   "tile": 16, "overlap": 5}, numbers=("rotation",)),
        "camera.tile_zoom": Call(
            fl.camera.tile_zoom, {"shape": SHAPE, "growth": 0.1, "camera": CAMERA, "tile": 16,
                                  "overlap": 5}),
        "particles.positions": Call(
            particles.positions, {"count": 5, "box": np.array([8.0, 6.0, 10.0]), "seed": 7,
                                  "velocity": direction, "time": 2.0,
                                  "center": np.array([0.0, 0.0, 5.0]), "sway": (0.1, 2.0)},
            numbers=("box", "velocity", "center")),
        "particles.sway_offsets": Call(
            particles.sway_offsets, {"count": 5, "seed": 7, "time": 1.0, "sway": (0.1, 2.0)}),
        "particles.edge_fade": Call(
            particles.edge_fade, {"points": POINTS, "box": np.array([4.0, 4.0, 12.0]),
                                  "center": direction}, numbers=("points", "box", "center"),
            empty=("points",)),
        "particles.splat": Call(
            particles.splat, splat, numbers=("points", "radius", "opacity", "velocity", "depth")),
        "particles.ids": Call(
            particles.ids, splat, numbers=("points", "radius", "opacity", "velocity", "depth"),
            within=0.0),
        "hybrid.statistics": Call(
            hybrid.statistics, {"population": POPULATION, "focal": 40.0,
                                "edges": np.array([2.0, 4.0, 8.0])}, numbers=("edges",)),
        "hybrid.match": Call(hybrid.match, {"population": POPULATION, "focal": 40.0}),
        "hybrid.render": Call(
            hybrid.render, {"shape": SHAPE, "match": hybrid.match(POPULATION, 40.0),
                            "camera": CAMERA, "seed": 1, "displacement": direction,
                            "velocity": 0.1 * direction, "depth": WALL},
            numbers=("displacement", "velocity", "depth")),
        "hybrid.simulate": Call(
            hybrid.simulate, {"shape": SHAPE, "population": POPULATION, "camera": CAMERA, "seed": 1,
                              "displacement": direction, "velocity": 0.1 * direction,
                              "depth": WALL}, numbers=("displacement", "velocity", "depth")),
        "gas.splat": Call(
            gas.splat, {**clouds, "color": rng().integers(0, 2, (6, 3)).astype(float)},
            numbers=("centers", "radius", "density", "color", "depth")),
        "gas.alpha": Call(
            gas.alpha, clouds, numbers=("centers", "radius", "density", "depth")),
        "gas.light": Call(
            gas.light, {"centers": POINTS, "radius": RADII, "density": np.ones(6),
                        "direction": direction},
            numbers=("centers", "radius", "density", "direction")),
        "gas.phase": Call(gas.phase, {"cosine": np.array([-1.0, 0.0, 1.0])}, numbers=("cosine",),
                          empty=("cosine",), shapeless=True),
        "gas.particles_of": Call(
            gas.particles_of, {"volume": rng().integers(0, 2, (3, 4, 5)).astype(float),
                               "spacing": 0.5, "center": direction},
            numbers=("volume", "center")),
        "gas.footprint_table": Call(gas.footprint_table, {"size": 9, "intervals": 20}),
        "gas.projection_error": Call(
            gas.projection_error, {"centers": POINTS, "radius": RADII},
            numbers=("centers", "radius"), within=1e-3),
        "gas.parallax_error": Call(
            gas.parallax_error, {"centers": POINTS, "radius": RADII, "eye_distance": 0.1},
            numbers=("centers", "radius"), within=1e-3),
        "gas.extinction": Call(
            gas.extinction, {"count": 10.0, "volume": 50.0, "radius": 0.5, "density": 1.0}),
        "gas.visibility": Call(gas.visibility, {"beta": 0.1}),
        "gas.count_for_visibility": Call(
            gas.count_for_visibility, {"distance": 50.0, "volume": 50.0, "radius": 0.5,
                                       "density": 1.0}),
        "gas.density_for_visibility": Call(
            gas.density_for_visibility, {"distance": 200.0, "count": 10.0, "volume": 50.0,
                                         "radius": 0.5}),
        "cone.rain_tile": Call(cone.rain_tile, {"size": 32, "seed": 1}, heavy=("drops",)),
        "cone.snow_tile": Call(cone.snow_tile, {"size": 32, "seed": 1}, heavy=("flakes",)),
        "cone.sleet_tile": Call(cone.sleet_tile, {"size": 32, "seed": 1}),
        "cone.tile_of": Call(
            cone.tile_of, {"picture": PLANE, "size": 16}, pictures=("picture",)),
        "cone.frame": Call(cone.frame, {"axis": direction}, numbers=("axis",)),
        "cone.rays": Call(
            cone.rays, {"shape": SHAPE, "camera": CAMERA, "axis": direction}, numbers=("axis",)),
        "cone.layer": Call(
            cone.layer, {"shape": SHAPE, "camera": CAMERA, "tile": rng().integers(
                0, 2, (32, 32)).astype(float), "axis": direction, "phase": 0.25},
            numbers=("tile", "axis")),
        "cone.layers": Call(
            cone.layers, {"shape": SHAPE, "camera": CAMERA, "tile": rng().integers(
                0, 2, (32, 32)).astype(float), "axis": direction, "phase": 0.25},
            numbers=("tile", "axis")),
        "cone.path": Call(
            cone.path, {"times": np.array([0.0, 1.0]), "drop": np.array([0.0, 5.0, 0.0]),
                        "camera": np.array([0.0, 0.0, 8.0])}, numbers=("times", "drop", "camera")),
        "cone.elongation": Call(cone.elongation, {"speed": np.array([1.0, 2.0])},
                                numbers=("speed",), empty=("speed",)),
        "cone.scroll": Call(
            cone.scroll, {"speed": np.array([1.0, 2.0]), "dt": np.array([1.0, 1.0]),
                          "stretch": np.array([1.0, 2.0])}, numbers=("speed", "dt", "stretch")),
        "cone.travel": Call(
            cone.travel, {"drop": direction, "camera": direction}, numbers=("drop", "camera")),
        "composite.snow": Call(
            composite.snow, {"background": PICTURE, "alpha": PLANE}, numbers=("alpha",),
            pictures=("background",)),
        "composite.over": Call(
            composite.over, {"background": PICTURE, "layer": LAYER}, numbers=("layer",),
            pictures=("background",)),
        "composite.join": Call(
            composite.join, {"layers": [PLANE], "haze": 0.25, "matte": PLANE}, numbers=("matte",)),
        "stereo.eyes": Call(stereo.eyes, {"camera": CAMERA, "distance": 0.1}),
        "stereo.anaglyph": Call(
            stereo.anaglyph, {"left": PICTURE, "right": PICTURE[::-1].copy()},
            pictures=("left", "right"), both={"left": "right", "right": "left"},
            light=("left", "right")),
        "stereo.side_by_side": Call(
            stereo.side_by_side, {"left": PICTURE, "right": PICTURE[::-1].copy()},
            pictures=("left", "right"), both={"left": "right", "right": "left"},
            light=("left", "right")),
        "stereo.over_under": Call(
            stereo.over_under, {"left": PICTURE, "right": PICTURE[::-1].copy()},
            pictures=("left", "right"), both={"left": "right", "right": "left"},
            light=("left", "right")),
        # cameras, files
        "camera.importers.from_matrices": Call(
            cameras.from_matrices, {"matrices": MATRICES, "camera": CAMERA},
            numbers=("matrices",)),
        "camera.importers.load": Call(
            cameras.load, {"path": folder / "way.csv", "shape": SHAPE, "camera": CAMERA}),
        "camera.importers.read_chan": Call(
            cameras.read_chan, {"path": folder / "way.chan", "shape": SHAPE, "camera": CAMERA}),
        "camera.importers.read_kitti": Call(
            cameras.read_kitti, {"path": folder / "poses.txt", "camera": CAMERA}),
        "camera.importers.read_colmap": Call(
            cameras.read_colmap, {"folder": colmap, "shape": SHAPE}),
        "io.Budget": Call(io.Budget, {"pixels": 1000, "bytes": 9000}),
        "io.fit": Call(io.fit, {"pixels": PICTURE, "size": (20, 20), "encoding": "display"},
                       pictures=("pixels",)),
        "io.fit_nearest": Call(
            io.fit_nearest, {"plane": WALL, "size": (20, 20)}, numbers=("plane",), within=0.0),
        "io.linear_to_srgb": Call(io.linear_to_srgb, {"values": PLANE}, numbers=("values",),
                                  empty=("values",), shapeless=True),
        "io.srgb_to_linear": Call(io.srgb_to_linear, {"values": PLANE}, numbers=("values",),
                                  empty=("values",), shapeless=True),
        "io.frame_range": Call(io.frame_range, {"text": "1-10x2"}),
        "io.open_background": Call(io.open_background, {"spec": png}),
        "io.open_depth": Call(io.open_depth, {"spec": exr}),
        "io.read_depth": Call(io.read_depth, {"path": exr}),
        "io.read_header": Call(io.read_header, {"path": png}),
        "io.read_layers": Call(io.read_layers, {"path": exr}),
        "io.read_mask": Call(io.read_mask, {"path": png}),
        "io.read_picture": Call(io.read_picture, {"path": png}),
        "io.read_video": Call(io.read_video, {"path": film}),
        "io.read_views": Call(io.read_views, {"path": views}),
        "io.remove_leftovers": Call(io.remove_leftovers, {"folder": folder}),
        "io.replacing": Call(io.replacing, {"path": folder / "new.txt"}),
        "io.write_picture": Call(
            io.write_picture, {"path": folder / "out.exr", "pixels": PICTURE}),
        "io.write_layers": Call(
            io.write_layers, {"path": folder / "out2.exr", "layers": {"rgba": LAYER}}),
        "io.write_views": Call(
            io.write_views, {"path": folder / "out3.exr", "left": PICTURE, "right": PICTURE}),
        "io.write_layer_views": Call(
            io.write_layer_views, {"path": folder / "out4.exr", "views": {
                "left": {"rgba": LAYER}, "right": {"rgba": LAYER}}}),
        "output.manifest.check": Call(manifest.check, {"folder": folder / "frames"}),
        "output.manifest.read": Call(manifest.read, {"folder": folder / "frames"}),
        # scenes
        "output.write.write": Call(
            write, {"scene": scene, "pattern": folder / "one" / "%04d.png",
                              "frames": "1", "overwrite": True}),
        "scene.toml.load": Call(
            scenefile.load, {"path": folder / "scene.toml"}),
        "scene.toml.save": Call(
            scenefile.save, {"scene": scene, "path": folder / "saved.toml"}),
        "scene.fingerprint.fingerprint": Call(fingerprint, {"scene": scene}),
        "trace.count": Call(trace.count, {"name": "flakes", "number": 3}),
        "trace.stage": Call(trace.stage, {"name": "texture"}),
        "trace.tracing": Call(trace.tracing, {}),
        "set_threads": Call(fl.set_threads, {"n": 2}),
        "set_reproducible": Call(fl.set_reproducible, {"on": False}),
        "reproducible": Call(fl.reproducible, {}),
        "threads": Call(fl.threads, {}),
        # data sets
        "augment.contrast_loss": Call(augment.contrast_loss, {"amount": 0.5}),
        "augment.occlusion": Call(
            augment.occlusion, {"alpha": PLANE, "boxes": np.array([[1.0, 2.0, 8.0, 9.0]])},
            numbers=("alpha", "boxes"), empty=("boxes",)),
        "augment.replay": Call(augment.replay, {"record": record}),
        "augment.corrupt.corrupt": Call(
            corrupt, {"folder": sets, "out": folder / "set", "severity": 1, "workers": 1,
                      "weather": "snow", "seed": 1}, heavy=("dask", "workers")),
        # studies, clusters
        "accuracy.study": Call(accuracy.study, {"names": ()}, heavy=("names",)),
        "accuracy.write": Call(
            accuracy.write, {"studies": [STUDY], "folder": folder / "study",
                             "page": folder / "study.md"}),
        "output.groups.grouped": Call(groups.grouped, {"scene": scene, "frames": "1-9"}),
        # the command line
        "cli.main": Call(cli.main, {"arguments": ["--help-of-nothing"]}),
    }  # fmt: skip


def methods() -> dict[str, Call]:
    """Return calls of what takes arrays and is no function: classes, and weather as transforms."""
    box = np.array([[1.0, 2.0, 20.0, 21.0]])
    flow = np.zeros((*SHAPE, 2))
    weathers = {
        "Snowfall": augment.Snowfall(severity=2, seed=1),
        "Rainfall": augment.Rainfall(severity=2, seed=1),
        "Fog": augment.Fog(severity=2, seed=1),
    }
    found = {
        "Scene": Call(_scene, {"background": PICTURE, "depth": WALL, "foreground": PLANE},
                      numbers=("depth",), pictures=("background", "foreground"),
                      light=("background", "foreground")),
        "DepthMap": Call(_depth_map, {"source": PLANE}, pictures=("source",)),
        "CameraPath": Call(
            _path, {"position": POINTS[:3], "orientation": 0.1 * POINTS[:3]},
            numbers=("position", "orientation")),
        "cone.Texture": Call(
            _texture, {"tile": rng().integers(0, 2, (32, 32)).astype(float)}, numbers=("tile",)),
    }  # fmt: skip
    for name, weather in weathers.items():
        found[f"augment.{name}()"] = Call(
            weather.__call__, {"image": PICTURE, "index": 3, "depth": WALL, "return_layer": True},
            numbers=("depth",), pictures=("image",))  # fmt: skip
        found[f"augment.{name}.apply"] = Call(
            weather.apply, {"image": PICTURE, "index": 3, "depth": WALL, "boxes": box},
            numbers=("depth", "boxes"), pictures=("image",), empty=("boxes",),
            within=1e-3)  # fmt: skip
        found[f"augment.{name}.apply(flow)"] = Call(
            weather.apply, {"image": PICTURE, "index": 3, "flow": flow, "motion": True},
            numbers=("flow",), within=1e-3)  # fmt: skip
        found[f"augment.{name}.clip"] = Call(
            weather.clip, {"frames": np.stack([PICTURE] * 2), "index": 3}, pictures=("frames",)
        )
        found[f"augment.{name}.batch"] = Call(
            weather.batch, {"images": np.stack([PICTURE] * 2), "index": 3}, pictures=("images",)
        )
        found[f"augment.{name}.pair"] = Call(
            weather.pair, {"left": PICTURE, "right": PICTURE[::-1].copy(), "index": 3,
                           "distance": 0.1}, pictures=("left", "right"))  # fmt: skip
        found[f"augment.{name}.record"] = Call(weather.record, {"image": PICTURE})
    return found


def _scene(background: Any, depth: Any, foreground: Any) -> Any:
    scene = fl.Scene(None, background, effects=[fl.Snow(flakes=50)], depth=depth,
                     foreground=foreground)  # fmt: skip
    return scene.render(3)


def _depth_map(source: Any) -> Any:
    return fl.Scene((32, 24), depth=fl.DepthMap(source, near=2.0, far=50.0)).depth_at(0)


def _path(position: Any, orientation: Any) -> Any:
    way = fl.CameraPath(CAMERA, position=position, orientation=orientation)
    return way.place(1.5, fps=30.0), way.turn(1.5)


def _texture(tile: Any) -> Any:
    return cone.layers(SHAPE, CAMERA, cone.Texture(tile), axis=(0, 1, 0), phase=0.25)
