"""The scene that a command line describes: weather, camera and depth over a picture or a scene."""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import click

from flurries.camera import importers
from flurries.camera.importers.usd import SUFFIXES as USD
from flurries.camera.optics import Lens
from flurries.camera.path import CameraPath
from flurries.cli.options import FILE, Bare, join, numbers, option, switch
from flurries.effects import Mist, Rain, Snow
from flurries.effects.notes import Body
from flurries.io import open_background
from flurries.io.files import file_of, path_text
from flurries.io.sequences import EXTEND
from flurries.scene.arguments import parse_size
from flurries.scene.foreground import Foreground
from flurries.scene.scene import Scene, open_scene

# Back to front.
KINDS: dict[str, Any] = {"mist": Mist, "snow": Snow, "rain": Rain}
# In the order of the help: what most users want comes first.
PRESETS = {kind: tuple(KINDS[kind].PRESETS) for kind in ("snow", "rain", "mist")}

# Options that are an effect's arguments of these names: its strength, by kind, what all kinds have,
# and what those have that fall.
KNOBS = ("severity", "rate", "visibility")
TAKERS = {name: (*kind.KNOBS, "visibility") for name, kind in KINDS.items()}
FIELDS = ("amount", "wind", "color")
FALLING = (
    "density", "shutter", "time", "near", "where", "holdout", "split", "hide", "place", "wakes",
    "method",
)  # fmt: skip

MISSING = (
    "a picture needs weather: add --snow PRESET, such as --snow heavy, --rain PRESET or "
    "--mist PRESET"
)


def _color(text: str) -> Any:
    return numbers(3)(text) if "," in text else text


def _lens(text: str) -> Lens | bool:
    focus, stop = (math.inf, 1.0) if text == "none" else numbers(2)(text)
    return text != "none" and Lens(focus, f_stop=stop)


def _shutter(text: str) -> float:
    try:
        return float(text.removesuffix("deg")) / (360.0 if text.endswith("deg") else 1.0)
    except ValueError:
        raise click.BadParameter(f"wants frames or an angle like 180deg, got {text!r}") from None


def _body(text: str) -> Body:
    *place, size = numbers(4)(text)
    return Body(tuple(place), size)


PRESET = "the preset's"

scene_options: Callable[[Any], Any] = join(
    click.argument("source", metavar="SCENE|PICTURE", type=FILE),
    *(option(f"--{name}", str, "PRESET", known[-1], "none", f"{name}: {', '.join(known)}; alone "
             "the usual look, or that of --severity or --rate", cls=Bare, pattern=r"\w[\w -]*",
             words=known) for name, known in PRESETS.items()),
    option("--severity", int, "1-5", "3", PRESET,
           "how bad the weather is, in place of a preset; of snow, rain or mist"),
    option("--rate", float, "MM_H", "2.5", PRESET,
           "millimetres of water an hour, in place of a preset; of snow or rain"),
    option("--visibility", float, "METRES", "40", PRESET,
           "how far one sees: in the mist where there is some, else in snow or rain"),
    option("--amount", float, "A", "0.5", "1", "how much of the weather is there, 0 to 1"),
    option("--wind", 3, "X,Y,Z", "-2,0,0", PRESET,
           "wind in metres per second: right, down, away"),
    option("--density", float, "N", "200", PRESET, "flakes or drops in a cubic metre"),
    option("--color", _color, "#RRGGBB|local", "#dfe8ff", PRESET,
           "color of the weather; local: that of the picture's own light"),
    option("--shutter", _shutter, "S", "180deg", PRESET,
           "how long a flake or drop is exposed, frames or an angle: its streak"),
    option("--time", float, "SPEED", "0.5", "1",
           "how fast the time of snow and rain alone goes: 0.5 is slow motion, 0 stands still"),
    option("--near", float, "METRES", "0.5", PRESET, "how near flakes and drops come"),
    option("--where", FILE, "FILE", "mask.png", "everywhere",
           "a picture of where there are flakes and drops: white all, black none"),
    option("--holdout", FILE, "FILE", "roto.png", "none",
           "a mask of what stands before snow and rain alone: white hides them"),
    option("--split", numbers(0), "METRES", "3,12", "one layer",
           "depths that part snow and rain into layers: near, mid and far"),
    option("--hide", numbers(0, int), "IDS", "4711,4712", "none",
           "flakes that are not shown, by their ids"),
    option("--place", 5, "FRAME,X,Y,Z,SIZE", "8,0.2,-0.1,1.5,0.02", "none",
           "a flake of your own: where it is in a frame, and its diameter, metres; may be repeated",
           multiple=True),
    option("--wakes", _body, "X,Y,Z,SIZE", "0,0.5,4,1.8", "none",
           "a ball that flakes go around: its middle and diameter, metres; may be repeated",
           multiple=True),
    option("--method", ("flakes", "tent", "cone", "simulated"), None, "tent", "flakes",
           "how snow and rain are made: flakes near and far; tent, Langer's texture; cone, drawn "
           "on a cone; simulated, every flake drawn"),
    option("--lens", _lens, "METRES,F_STOP", "4,2", "a photograph's for a still",
           "focus and opening of the lens; none: all is sharp"),
    option("--fly", 3, "X,Y,Z", "0,-0.3,5", "it stands",
           "velocity of the camera in metres per second: right, down, forward"),
    option("--camera", FILE, "FILE", "shot.chan", "it stands",
           "path of the camera: .csv with x,y,z and rx,ry,rz a frame, Nuke's .chan, a USD stage, "
           "KITTI's poses .txt, or a folder of COLMAP's text"),
    option("--camera-scale", float, "METRES", "0.01", "1",
           "metres in a unit of the camera's file; USD says its own"),
    option("--center", 2, "X,Y", "980,560", "the middle",
           "the camera's principal point in pixels, which .chan, .csv and .txt do not say"),
    option("--down", 3, "X,Y,Z", "0,1,0.2", "the mean of the cameras'",
           "where things fall in the axes of COLMAP's world"),
    option("--depth", FILE, "FILE|METRES", "depth.exr", "far away",
           "what hides weather behind it: an EXR with Z, or the distance of a wall"),
    option("--foreground --matte foreground", FILE, "FILE[:NAMES][@METRES]", "roto.%04d.exr",
           "none", "mask, picture, sequence or film in front of the weather, or what an EXR's "
           "Cryptomatte has by the names after a colon; at its distance; may be repeated",
           multiple=True),
    option("--extend", EXTEND, None, "hold", "the scene's, else stop",
           "frame numbers that files of picture, depth, foreground or camera lack: stop, hold the "
           "first or last, or loop"),
    option("--start", int, "N", "1001", "that of the files, else 0",
           "number of the first frame of films, which have no numbers of their own"),
    option("--loop", int, "N", "96", "the scene's, else never",
           "after so many frames the film begins again, without a jump; what is changed is said"),
    option("--seed", int, "N", "7", "the scene's, else 0", "which of all snowfalls of this kind"),
    option("--size", str, "WxH", "1920x1080", "the picture's", "size of the frame in pixels"),
    option("--fps", float, "F", "25", "the film's or scene's, else 30", "frames a second"),
    option("--colorspace", str, "NAME", "ACEScg", "the scene's, else Rec. 709",
           "color space of the picture and, without --output-colorspace, of what is written; a "
           "name of $OCIO or of the built-in configuration"),
    switch("--linear", "mix in linear light, as for EXR, not display values"),
)  # fmt: skip


def scene_of(source: str, **options: Any) -> Scene:
    for name in ("down", "camera_scale"):
        if options[name] is not None and options["camera"] is None:
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} needs --camera with a file or folder")
    if options["fly"] is not None and options["camera"] is not None:
        raise click.UsageError("--camera and --fly must not both be given")
    changes = _given(options, ("seed", "fps", "extend", "start", "colorspace"))
    if options["lens"] is not None:
        changes["lens"] = options["lens"] or None
    if options["foreground"]:
        changes["foreground"] = [_matte(text) for text in options["foreground"]]
    if options["linear"]:
        changes["space"] = "linear"
    if options["depth"] is not None:
        changes["depth"] = _depth(options["depth"])
    size = options["size"]
    if Path(source).suffix.lower() == ".toml":
        scene = _changed(open_scene(source), changes, options)
    else:
        # What a camera says in pixels is of the picture's own size: another one comes after it.
        if source.startswith("#") or not (options["camera"] or options["center"]):
            changes["size"], size = size, None
        scene = _new(source, changes, options)
    scene = _seen(scene, options)
    if size is not None:
        scene = _resized(scene, size)
    return scene if options["loop"] is None else scene.replace(loop=options["loop"])


def _new(source: str, changes: dict[str, Any], options: dict[str, Any]) -> Scene:
    kinds = [kind for kind in KINDS if options[kind] is not None]
    if not kinds and not options["rate"] is options["severity"] is None:
        options = {**options, "snow": ""}
    effects = _effects(options)
    if not effects:
        raise click.UsageError(MISSING)
    background: Any = source
    if not source.startswith("#"):
        background = path_text("background", source)
        background = open_background(background, overscan=options["size"] is None)
    return Scene(background, effects=effects, **changes)


def _changed(scene: Scene, changes: dict[str, Any], options: dict[str, Any]) -> Scene:
    common = _given(options, FIELDS + FALLING)
    if effects := _effects(options):
        changes["effects"] = effects
    elif common:
        known = [{f.name for f in fields(effect)} for effect in scene.effects]
        for name in common.keys() - {one for names in known for one in names}:
            raise click.UsageError(f"--{name} needs --snow or --rain, or a scene that has them")
        changes["effects"] = [
            replace(effect, **{name: common[name] for name in common.keys() & names})
            for effect, names in zip(scene.effects, known, strict=True)
        ]
    return scene.replace(**changes)


def _seen(scene: Scene, options: dict[str, Any]) -> Scene:
    lens, center = scene.camera.camera, options["center"]
    if center is not None:
        lens = replace(lens, center=center)
        scene = scene.replace(camera=replace(scene.camera, camera=lens))
    if options["fly"] is not None:
        return scene.replace(camera=CameraPath(lens, velocity=options["fly"]))
    if options["camera"] is None:
        return scene
    file, (_, _, width, height) = Path(options["camera"]), scene._display
    if center is not None and (file.is_dir() or file.suffix.lower() in USD):
        raise click.UsageError(f"--center is for a camera that does not say it: {file} does")
    axes = {"down": options["down"], "scale": options["camera_scale"] or 1.0}
    with file_of("camera"):
        way = importers.load(file, (height, width), camera=lens, **axes)
    return scene.replace(camera=way)


def _resized(scene: Scene, text: str) -> Scene:
    """Return the scene with another size, which its picture covers, and the same view."""
    (width, height), (tall, wide) = parse_size(text), scene._shape
    scale = max(width / wide, height / tall)
    way = scene.camera.resize(scale)
    if way.camera.center is not None:
        x, y = way.camera.center
        center = x + 0.5 * (width - scale * wide), y + 0.5 * (height - scale * tall)
        way = replace(way, camera=replace(way.camera, center=center))
    return scene.replace(size=(width, height), camera=way)


def _effects(options: dict[str, Any]) -> list[Any]:
    knobs, common = _given(options, KNOBS), _given(options, FIELDS)
    falling = _given(options, FALLING)
    effects, used = [], set()
    for name, kind in KINDS.items():
        if options[name] is None:
            continue
        own = {knob: v for knob, v in knobs.items() if knob in TAKERS[name]}
        # How far one sees belongs to the mist.
        if options["mist"] is not None and kind is not Mist:
            own.pop("visibility", None)
        used |= set(own)
        given = {**own, **common, **({} if kind is Mist else falling)}
        effects.append(kind(*filter(None, [options[name]]), **given))
    if effects and falling and options["snow"] is options["rain"] is None:
        raise click.UsageError(f"--{next(iter(falling))} needs --snow or --rain")
    for knob in knobs.keys() - used:
        takers = [f"--{name}" for name, taken in TAKERS.items() if knob in taken]
        raise click.UsageError(f"--{knob} needs one of {', '.join(takers)}")
    return effects


def _given(options: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: options[name] for name in names if options[name] not in (None, ())}


def _matte(text: str) -> Any:
    """Return "roto.%04d.exr@4.5" as a file and its distance."""
    name, mark, metres = text.rpartition("@")
    if not mark or Path(text).exists():
        return text
    return Foreground(name, depth=_depth(metres))


def _depth(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
