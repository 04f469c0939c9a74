"""The scene that a command line describes: weather, camera and depth over a picture or a scene."""

from __future__ import annotations

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
from flurries.cli.options import FILE, OneOf, join, numbers, option, weather_options
from flurries.effects import Mist, Rain, Snow
from flurries.io import open_background
from flurries.io.files import file_of
from flurries.io.sequences import EXTEND
from flurries.scene.arguments import parse_size
from flurries.scene.foreground import Foreground
from flurries.scene.scene import Scene, open_scene

# Back to front.
KINDS: dict[str, Any] = {"mist": Mist, "snow": Snow, "rain": Rain}
# In the order of the help: what most users want comes first.
PRESETS = {kind: tuple(KINDS[kind].PRESETS) for kind in ("snow", "rain", "mist")}

# Options that are an effect's arguments of these names.
KNOBS = ("severity", "rate", "visibility")
FIELDS = ("amount", "wind", "color")
# And those of what falls.
FALLING = ("density", "shutter", "near", "method")

METHODS = ("flakes", "tent", "cone", "simulated")

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


scene_options: Callable[[Any], Any] = join(
    click.argument("source", metavar="SCENE|PICTURE", type=FILE),
    *weather_options(PRESETS),
    option("--severity", type=int, metavar="1-5", example="3", unset="the preset's",
           help="how bad the weather is, in place of a preset; of snow, rain or mist"),
    option("--rate", type=float, metavar="MM_H", example="2.5", unset="the preset's",
           help="millimetres of water an hour, in place of a preset; of snow or rain"),
    option("--visibility", type=float, metavar="METRES", example="40", unset="the preset's",
           help="how far one sees: in the mist where there is some, else in snow or rain"),
    option("--amount", type=float, metavar="A", example="0.5", unset="1",
           help="how much of the weather is there, 0 to 1"),
    option("--wind", type=numbers(3), metavar="X,Y,Z", example="-2,0,0", unset="the preset's",
           help="wind in metres per second: right, down, away"),
    option("--density", type=float, metavar="N", example="200", unset="the preset's",
           help="flakes or drops in a cubic metre"),
    option("--color", type=_color, metavar="#RRGGBB|local", example="#dfe8ff", unset="the preset's",
           help="color of the weather; local: that of the picture's own light"),
    option("--shutter", type=_shutter, metavar="S", example="180deg", unset="the preset's",
           help="how long a flake or drop is exposed, frames or an angle: its streak"),
    option("--near", type=float, metavar="METRES", example="0.5", unset="the preset's",
           help="how near flakes and drops come"),
    option("--method", type=OneOf(METHODS), example="tent", unset="flakes",
           help="how snow and rain are made: flakes near and far; tent, Langer's texture; cone, "
           "drawn on a cone; simulated, every flake drawn"),
    option("--lens", type=_lens, metavar="METRES,F_STOP", example="4,2", unset="a photograph's "
           "for a still", help="focus and opening of the lens; none: all is sharp"),
    option("--fly", type=numbers(3), metavar="X,Y,Z", example="0,-0.3,5", unset="it stands",
           help="velocity of the camera in metres per second: right, down, forward"),
    option("--camera", type=FILE, metavar="FILE", example="shot.chan", unset="it stands",
           help="path of the camera: .csv with x,y,z and rx,ry,rz a frame, Nuke's .chan, a USD "
           "stage, KITTI's poses .txt, or a folder of COLMAP's text"),
    option("--camera-scale", type=float, metavar="METRES", example="0.01", unset="1",
           help="metres in a unit of the camera's file; USD says its own"),
    option("--center", type=numbers(2), metavar="X,Y", example="980,560", unset="the middle",
           help="the camera's principal point, pixels: the shift of the lens, which .chan, .csv "
           "and .txt do not say"),
    option("--down", type=numbers(3), metavar="X,Y,Z", example="0,1,0.2",
           unset="the mean of the cameras'",
           help="where things fall in the axes of COLMAP's world"),
    option("--depth", type=FILE, metavar="FILE|METRES", example="depth.exr", unset="far away",
           help="what hides weather behind it: an EXR with Z, or the distance of a wall"),
    option("--foreground", "--matte", "foreground", type=FILE, metavar="FILE[:NAMES][@METRES]",
           example="roto.%04d.exr", unset="none", multiple=True,
           help="mask or picture in front of the weather, a sequence or a film; or what an EXR's "
           "Cryptomatte has by the names after a colon; at its distance where @METRES is given; "
           "may be repeated"),
    option("--extend", type=OneOf(EXTEND), example="hold", unset="the scene's, else stop",
           help="frame numbers that the picture's files, depth, foreground or camera lack: stop, "
           "hold the first or last, or loop"),
    option("--start", type=int, metavar="N", example="1001", unset="that of the files, else 0",
           help="number of the first frame of films, which have no numbers of their own"),
    option("--loop", type=int, metavar="N", example="96", unset="the scene's, else never",
           help="after so many frames the film begins again, without a jump; the "
           "command says what it changes for that"),
    option("--seed", type=int, metavar="N", example="7", unset="the scene's, else 0",
           help="which of all snowfalls of this kind"),
    option("--size", metavar="WxH", example="1920x1080", unset="the picture's",
           help="size of the frame in pixels"),
    option("--fps", type=float, metavar="F", example="25", unset="the film's or scene's, else 30",
           help="frames a second"),
    option("--colorspace", metavar="NAME", example="ACEScg", unset="the scene's, else Rec. 709",
           help="color space of the picture, and of what is written unless --output-colorspace "
           "says another; a name of $OCIO or of the built-in configuration"),
    option("--linear", is_flag=True, help="mix in linear light, as for EXR, and not in display "
           "values"),
)  # fmt: skip


def scene_of(source: str, **options: Any) -> Scene:
    """Return the scene that `scene_options` describe."""
    changes = _given(options, ("seed", "size", "fps", "extend", "start", "colorspace"))
    if options["lens"] is not None:
        changes["lens"] = options["lens"] or None
    if options["foreground"]:
        changes["foreground"] = [_matte(text) for text in options["foreground"]]
    if options["linear"]:
        changes["space"] = "linear"
    if options["depth"] is not None:
        changes["depth"] = _depth(options["depth"])
    if options["fly"] is not None and options["camera"] is not None:
        raise click.UsageError("--camera and --fly must not both be given")
    # What a camera says in pixels is of the picture's own size: smaller or larger comes after it.
    late = None
    if (options["camera"] or options["center"]) and not source.startswith("#"):
        late = changes.pop("size", None)
    if Path(source).suffix.lower() == ".toml":
        scene = _changed(open_scene(source), changes, options)
    else:
        scene = _new(source, changes, options)
    for name in ("down", "camera_scale"):
        if options[name] is not None and options["camera"] is None:
            option = name.replace("_", "-")
            raise click.UsageError(f"--{option} needs --camera with a file or folder")
    lens = scene.camera.camera
    if options["center"] is not None:
        lens = replace(lens, center=options["center"])
        scene = scene.replace(camera=replace(scene.camera, camera=lens))
    if options["fly"] is not None:
        scene = scene.replace(camera=CameraPath(lens, velocity=options["fly"]))
    elif options["camera"] is not None:
        file = Path(options["camera"])
        if options["center"] is not None and (file.is_dir() or file.suffix.lower() in USD):
            raise click.UsageError(f"--center is for a camera that does not say it: {file} does")
        with file_of("camera"):
            shape = scene._display[3], scene._display[2]
            way = importers.load(
                file, shape, camera=lens, down=options["down"], scale=options["camera_scale"] or 1.0
            )
        scene = scene.replace(camera=way)
    if late is not None:
        scene = _resized(scene, late)
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
        background = open_background(source, overscan=options["size"] is None)
    return Scene(background, size=changes.pop("size", None), effects=effects, **changes)


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
    size = changes.pop("size", None)
    scene = scene.replace(**changes)
    return scene if size is None else _resized(scene, size)


def _resized(scene: Scene, text: str) -> Scene:
    """Return the scene with another size, which its picture covers, and the same view."""
    (width, height), (tall, wide) = parse_size(text), scene.shape
    scale = max(width / wide, height / tall)
    way = scene.camera.resize(scale)
    if way.camera.center is not None:
        x, y = way.camera.center
        center = x + 0.5 * (width - scale * wide), y + 0.5 * (height - scale * tall)
        way = replace(way, camera=replace(way.camera, center=center))
    return scene.replace(size=(width, height), camera=way)


def _effects(options: dict[str, Any]) -> list[Any]:
    """Return the weather of the options, back to front."""
    knobs = _given(options, KNOBS)
    common = _given(options, FIELDS)
    effects, used = [], set()
    for name, kind in KINDS.items():
        look = options[name]
        if look is not None:
            own = {knob: v for knob, v in knobs.items() if knob in (*kind.KNOBS, "visibility")}
            # How far one sees belongs to the mist.
            if options["mist"] is not None and kind is not Mist:
                own.pop("visibility", None)
            used |= set(own)
            given = {**own, **common, **({} if kind is Mist else _given(options, FALLING))}
            effects.append(kind(look, **given) if look else kind(**given))
    lost = _given(options, FALLING)
    if effects and lost and options["snow"] is options["rain"] is None:
        raise click.UsageError(f"--{next(iter(lost))} needs --snow or --rain")
    for knob in knobs:
        if knob not in used:
            takers = [f"--{one}" for one in KINDS if knob in (*KINDS[one].KNOBS, "visibility")]
            raise click.UsageError(f"--{knob} needs one of {', '.join(takers)}")
    return effects


def _given(options: dict[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: options[name] for name in names if options[name] is not None}


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
