"""Calls of what makes scenes, and of what reads and writes files."""

from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl
from flurries import augment, io
from flurries.io.layers.planes import Deep, write_deep
from public import Call
from public.arrays import ASIDE, COVER, DEPTH, LENS, MATRICES, OTHER, PICTURE, POINTS, SHAPE

LEVELS = (255 * PICTURE).astype(np.uint8)
LAYER = np.dstack([0.5 * PICTURE, np.full(SHAPE, 0.5)])
SCENE = fl.Scene("#304050", size=(32, 24), effects=[fl.effects.TentSnow(flakes=20)])
DEEP = Deep(np.array([[1, 0], [2, 0]]), np.full((3, 6), 0.5, np.float32))
PLATE: dict[str, Any] = {"image": PICTURE, "index": 3}


def write_files() -> None:
    io.write_picture("picture.png", LEVELS)
    io.write_layers(
        "layers.exr", {"rgba": LAYER.astype(np.float32), "depth": DEPTH.astype(np.float32)}
    )
    write_deep("deep.exr", DEEP)
    Path("way.csv").write_text("frame,x,y,z\n0,0,0,0\n1,0,0,1\n")
    Path("way.chan").write_text("1 0 0 0 0 0 0\n2 0 0 1 0 0 0\n")
    Path("way.usda").write_text(
        '#usda 1.0\ndef Camera "camera" {\nfloat horizontalAperture = 24\n'
        "float verticalAperture = 18\n}\n"
    )
    Path("poses.txt").write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n")
    for folder in ("pictures", "colmap"):
        Path(folder).mkdir()
    io.write_picture("pictures/one.png", LEVELS)
    Path("scored/natural/fog").mkdir(parents=True)
    Path("scored/benchmark.json").write_text('{"version": 1, "hashes": {}}')
    Path("scored/natural/flurries.jsonl").write_text(
        '{"file": "fog/1/x/a.png", "sha256": "", "weather": "fog", "severity": 1, '
        '"source": "x/a.png", "pixels": "", "inputs": ""}'
    )
    Path("scored/natural/fog/1.csv").write_text("x/a.png,x")
    SCENE.save("scene.toml")
    SCENE.write("frames/%04d.png", "1-2")
    Path("colmap/cameras.txt").write_text("1 PINHOLE 32 24 40 40 16 12\n")
    Path("colmap/images.txt").write_text("1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 -1 1 b.png\n\n")


# Snow takes twenty times as long, and the methods are the same.
FOG = augment.Fog(severity=2, seed=1)
STACK = np.stack([PICTURE] * 2)

CALLS: dict[str, Call] = {
    # What a scene is made of, and one.
    "flakes": Call({"scene": SCENE, "t": 3.0}, then=lambda found: found["place"]),
    "Scene": Call(
        {"background": PICTURE, "depth": DEPTH, "foreground": COVER,
         "effects": [fl.effects.TentSnow(flakes=50)]},
        then=lambda scene: scene.render(3), pictures=("background", "foreground"), light=True,
        floats=("depth",), takes={"foreground": ("bool", "NaN")}, loose=True),
    "open": Call({"path": "scene.toml"}),
    "scene.DepthMap": Call(
        {"source": COVER, "near": 2.0, "far": 50.0}, pictures=("source",),
        then=lambda source: fl.Scene(size=(30, 24), depth=source)._depth_at(0)),
    "scene.Foreground": Call({"source": "picture.png", "depth": 4.0}, loose=True),
    "CameraPath": Call(
        {"camera": LENS, "position": POINTS[:3], "orientation": 0.1 * POINTS[:3]},
        then=lambda way: (way.place(1.5, fps=30.0), way.turn(1.5))),
    "CameraPath(velocity)": Call(
        {"camera": LENS, "velocity": (0.0, 0.0, 1.0)}, of=fl.CameraPath,
        then=lambda way: way.place(1.5, fps=30.0)),
    "Keys": Call({"keys": [(0, 1.0), (9, 2.0)]}),
    "scene.Sun": Call({}),
    "scene.Light": Call({"snow": (0.5, 0.6, 0.7)}),
    "scene.find_light": Call({"scene": SCENE}, then=lambda light: light.at(0.0)),
    "scene.Lamp": Call({"place": (1.0, -2.0, 6.0)}),
    "camera.Lens": Call({"focus": 4.0}, infinite=("focus",), refused={"blades": (2,)}),
    "scene.Output": Call({"bits": "float", "motion": "y-up"}, loose=True),
    "Wind": Call({"mean": (1.0, 0.0, 0.0), "gusts": 0.5}),
    "Snow": Call({}),
    "effects.TentSnow": Call({}),
    "effects.TentRain": Call({}),
    "Rain": Call({}),
    "effects.Body": Call({"place": (0.0, 0.0, 3.0), "size": 0.5}),
    "effects.Where": Call(
        {"source": 0.5}, infinite=("far",), loose=True, refused={"near": (-1.0,)}),
    "Mist": Call({}),
    "effects.ConeSnow": Call({}),
    "effects.ConeRain": Call({}, refused={"spread": (-1.0,)}),
    "effects.register": Call({"kind": "ash", "effect": fl.Mist}, words=("kind",)),
    # Files.
    "spectral.export_loop": Call(
        {"pattern": "loop/%02d.png", "frames": 2, "shape": (16, 16), "velocity": ASIDE[:2],
         "seed": 1, "wavelengths": (3.0, 16.0), "overwrite": True}, heavy=("frames",),
        loose=True, then=lambda _: io.read_picture("loop/01.png").pixels),
    "camera.importers.from_matrices": Call(
        {"matrices": MATRICES, "camera": LENS, "axes": "x right, y down, z forward",
         "focal": np.array([40.0, 41.0, 42.0])}),
    "camera.importers.load": Call({"path": "way.csv", "shape": SHAPE, "camera": LENS}),
    "camera.importers.read_chan": Call({"path": "way.chan", "shape": SHAPE, "camera": LENS}),
    "camera.importers.read_usd": Call({"path": "way.usda", "shape": SHAPE, "camera": LENS}),
    "camera.importers.read_kitti": Call({"path": "poses.txt", "camera": LENS}),
    "camera.importers.read_colmap": Call({"folder": "colmap", "shape": SHAPE}),
    "io.Budget": Call({"pixels": 2**20, "bytes": 2**24}, refused={"pixels": (0,), "bytes": (-1,)}),
    "io.fit": Call(
        {"pixels": PICTURE, "size": (20, 20), "encoding": "display"}, pictures=("pixels",),
        loose=True),
    "io.linear_to_srgb": Call(
        {"values": COVER}, floats=("values",), takes={"values": ("empty", "too deep", "NaN")}),
    "io.srgb_to_linear": Call(
        {"values": COVER}, floats=("values",), takes={"values": ("empty", "too deep", "NaN")}),
    "io.open_background": Call({"spec": "picture.png"}, refused={"damaged": ("skip",)}, loose=True),
    "io.photograph": Call({"name": "rocket", "size": (12, 9)}),
    "io.read_deep": Call({"path": "deep.exr"}),
    "io.read_depth": Call({"path": "layers.exr"}),
    "io.read_layers": Call({"path": "layers.exr"}),
    "io.read_picture": Call({"path": "picture.png"}),
    "io.write_picture": Call(
        {"path": "out.exr", "pixels": PICTURE, "alpha": COVER}, pictures=("pixels", "alpha"),
        light=True, then=lambda _: io.read_picture("out.exr").pixels, loose=True),
    "io.write_picture(png)": Call(
        {"path": "out.png", "pixels": PICTURE, "alpha": COVER}, of=io.write_picture,
        pictures=("pixels", "alpha"),
        light=True, then=lambda _: io.read_picture("out.png").pixels, loose=True),
    "io.write_layers": Call({"path": "out2.exr", "layers": {"rgba": LAYER}}, loose=True),
    "io.write_layers(array)": Call(
        {"rgba": LAYER}, floats=("rgba",), loose=True, takes={"rgba": ("NaN",)},
        of=lambda rgba: io.write_layers("out5.exr", {"rgba": rgba}),
        then=lambda _: io.read_layers("out5.exr")),
    "output.journal.check": Call({"place": "frames"}),
    "Scene.write": Call(
        {"pattern": "one/%04d.png", "frames": "1", "overwrite": True}, of=SCENE.write, loose=True),
    "Scene.render": Call({"t": 3.0, "region": np.s_[2:9, 3:12]}, of=SCENE.render),
    "scene.toml.load": Call({"path": "scene.toml"}),
    "scene.toml.save": Call({"scene": SCENE, "path": "saved.toml"}),
    "scene.fingerprint.fingerprint": Call({"scene": SCENE}),
    # data sets, studies, clusters, the command
    "augment.Snowfall()": Call(
        {**PLATE, "depth": DEPTH, "return_layer": True},
        of=augment.Snowfall(severity=1, seed=1).__call__, pictures=("image",), floats=("depth",),
        keeps="image",
        takes={"depth": ("NaN",)}),
    "augment.Rainfall()": Call(
        PLATE, of=augment.Rainfall(severity=2, seed=1).__call__, pictures=("image",),
        keeps="image"),
    "augment.Fog()": Call(
        PLATE, of=FOG.__call__, pictures=("image",), keeps="image"),
    "augment.Fog.apply": Call(
        {**PLATE, "depth": DEPTH, "boxes": np.array([[1.0, 2.0, 20.0, 21.0]]),
         "flow": np.zeros((*SHAPE, 2)), "motion": True}, of=FOG.apply, pictures=("image",),
        floats=("depth", "flow"), within=1e-3,
        takes={"boxes": ("empty",), "depth": ("NaN",), "flow": ("NaN",)}),
    "augment.Fog.clip": Call(
        {"frames": STACK, "index": 3}, of=FOG.clip, pictures=("frames",)),
    "augment.Fog.batch": Call(
        {"images": STACK, "index": 3}, of=FOG.batch, pictures=("images",), loose=True),
    "augment.Fog.pair": Call(
        {"left": PICTURE, "right": OTHER, "index": 3, "distance": 0.1}, of=FOG.pair,
        pictures=("left", "right")),
    "augment.Fog.record": Call({"index": 3}, of=FOG.record),
    "augment.Snowfall": Call({}, loose=True),
    "augment.Rainfall": Call({}, loose=True),
    "augment.Fog": Call({}, loose=True),
    "augment.Ground": Call({}),
    "augment.contrast_loss": Call({"amount": 0.5}),
    "augment.occlusion": Call(
        {"alpha": COVER, "boxes": np.array([[1.0, 2.0, 8.0, 9.0]])}, takes={"boxes": ("empty",)}),
    "augment.replay": Call({"record": augment.Snowfall(severity=2).record(index=1)}),
    "augment.corrupt.corrupt": Call(
        {"folder": "pictures", "out": "set", "severity": 1, "workers": 1, "weather": "snow",
         "seed": 1}, heavy=("dask", "workers"), loose=True),
    "augment.benchmark.make": Call(
        {"folder": "pictures", "out": "benchmark", "like": None}, loose=True),
    "augment.benchmark.score": Call({"benchmark": "scored", "predictions": "scored"}, loose=True),
    "output.cluster.grouped": Call({"scene": SCENE, "frames": "1-9"}),
    "output.cluster.to_dask": Call({"scene": SCENE, "frames": "1-9", "group": 2}),
    "view": Call({"scene": SCENE}, loose=True),
    "cli.main": Call({"arguments": ["--help-of-nothing"]}, loose=True),
}  # fmt: skip
