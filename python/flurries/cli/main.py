"""The command line: words to stderr, data to stdout, exit code 2 for a user's mistake."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

__all__ = ["main"]

MISTAKE = 2
SKIPPED = 3
INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise _Mistake(f"{message} (see {self.prog} --help)")


class _Mistake(Exception):
    """What the user can mend; one clear sentence."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        In place of ``sys.argv[1:]``.

    Returns
    -------
    int
        0; 2 for a user's mistake or a file that fails; 3 if frames were skipped, or if files are
        not what their manifest says; 130 after Ctrl-C.
    """
    try:
        given = sys.argv[1:] if arguments is None else list(arguments)
        options = _parser().parse_args(_joined(given))
        _threads(options)
        code: int = options.run(options)
        return code
    except _Mistake as mistake:
        return _say(mistake)
    except (ValueError, TypeError, OSError, MemoryError, ImportError) as error:
        # The library's own refusals are sentences that name the argument or the file.
        return _say(error)
    except KeyboardInterrupt:
        print("flurries: stopped; finished frames stay, run again to go on", file=sys.stderr)
        return INTERRUPTED


def _joined(arguments: Sequence[str]) -> list[str]:
    """Join "--wind -1,0,0" by "=": argparse would take the minus for an option.

    And part "--dask" from a file that follows it, which argparse would take for an address.
    """
    result: list[str] = []
    for argument in arguments:
        if result and result[-1] == "--dask" and not re.match(r"\w+://|[\w.-]+:\d+$", argument):
            result[-1] = "--dask="
        if (
            result
            and result[-1] in ("--wind", "--fly", "--velocity")
            and re.match(r"-[\d.]", argument)
        ):
            result[-1] += f"={argument}"
        else:
            result.append(argument)
    return result


def _say(error: BaseException) -> int:
    text = str(error) or type(error).__name__
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        text = f"{error.filename}: {error.strerror}"
    print(f"flurries: {' '.join(text.split())}", file=sys.stderr)
    return MISTAKE


def _threads(options: argparse.Namespace) -> None:
    if options.threads is not None:
        from flurries._threads import set_threads

        set_threads(options.threads)
    if getattr(options, "reproducible", False):
        import os

        from flurries._threads import set_reproducible

        set_reproducible(True)
        # For the workers that it may start.
        os.environ["FLURRIES_REPRODUCIBLE"] = "1"


def _parser() -> argparse.ArgumentParser:
    from flurries import __version__

    parser = _Parser(prog="flurries", description="Falling snow for pictures and film.")
    parser.add_argument("--version", action="version", version=f"flurries {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)

    demo = commands.add_parser("demo", help="snow on a photograph: films, stills, an EXR")
    demo.add_argument("-o", "--output", default="demo", metavar="FOLDER", help="default: demo")
    demo.add_argument("--size", type=int, default=1024, metavar="PX", help="default: 1024")
    demo.add_argument("--frames", type=int, default=60, metavar="N", help="default: 60")
    demo.set_defaults(run=_demo)

    render = commands.add_parser("render", help="a scene or a picture to files")
    render.add_argument(
        "input", metavar="SCENE|PICTURE", help="scene.toml, a picture, a film, #rrggbb"
    )
    render.add_argument(
        "-o",
        "--output",
        required=True,
        metavar="PATTERN|VIDEO",
        help="frames/%%04d.exr, .png, ...; out.mp4, .webm, .mkv; or one still",
    )
    _add_scene(render)
    render.add_argument("--frames", metavar="RANGE", help="1-60, 1-100x2, 7")
    render.add_argument("--float", action="store_true", help="EXR with 32 bits, not half")
    render.add_argument("--layers", action="store_true", help="EXR with the snow as a layer")
    render.add_argument("--alone", action="store_true", help="only the snow, as RGBA")
    render.add_argument("--quality", choices=("high", "medium", "draft"), default="high")
    render.add_argument("--overwrite", action="store_true", help="render again what is there")
    render.add_argument(
        "--damaged",
        choices=("stop", "skip", "hold"),
        default="stop",
        help="where the background's frame is missing or damaged: stop (default), leave the frame "
        "out and exit with 3, or hold the last good one",
    )
    render.add_argument("--no-sound", action="store_true", help="a video without the film's sound")
    render.add_argument(
        "--dask",
        nargs="?",
        const="",
        metavar="ADDRESS",
        help="on a Dask cluster: tcp://host:8786, or one made on this machine",
    )
    render.add_argument("--no-manifest", action="store_true", help="no flurries.json")
    render.add_argument(
        "--reproducible", action="store_true", help="the same bits on every processor"
    )
    render.add_argument("--quiet", action="store_true", help="no progress bar")
    render.set_defaults(run=_render)

    plan = commands.add_parser(
        "plan", help="what rendering would cost: steps, times, memory, and what is left out"
    )
    plan.add_argument(
        "input", metavar="SCENE|PICTURE", help="scene.toml, a picture, a film, #rrggbb"
    )
    _add_scene(plan)
    plan.add_argument("--frames", metavar="RANGE", help="1-60, 1-100x2, 7")
    plan.add_argument("--json", action="store_true", help="JSON in place of a table")
    plan.add_argument(
        "--calibrate", action="store_true", help="measure this machine's speed again first"
    )
    plan.set_defaults(run=_plan)

    from flurries.effects.presets import SNOW

    texture = commands.add_parser(
        "texture", help="snow that repeats in x, y and time, as textures for a game engine"
    )
    texture.add_argument(
        "-o", "--output", required=True, metavar="PATTERN", help="snow/%%04d.png, .exr or .tif"
    )
    texture.add_argument("--frames", type=int, default=60, metavar="N", help="default: 60")
    texture.add_argument("--size", default="512x512", metavar="WxH", help="default: 512x512")
    texture.add_argument(
        "--velocity",
        type=_numbers(2),
        default=(0.5, 2.0),
        metavar="X,Y",
        help="pixels per frame of the longest wave, y down; default: 0.5,2",
    )
    texture.add_argument(
        "--band", metavar="NAME|SHORT,LONG", default="paper", help="paper, slides, or pixels"
    )
    texture.add_argument("--look", metavar="PRESET", default="paper", help=", ".join(SNOW))
    texture.add_argument("--shutter", type=float, default=0.0, metavar="S", help="frames")
    texture.add_argument("--seed", type=int, default=1, metavar="N")
    texture.add_argument("--bits", type=int, choices=(8, 16), help="of integer files; default: 8")
    texture.add_argument("--half", action="store_true", help="EXR with 16 bits")
    texture.add_argument("--overwrite", action="store_true", help="replace what is there")
    texture.add_argument("--quiet", action="store_true", help="no progress bar")
    texture.set_defaults(run=_texture)

    view = commands.add_parser("view", help="a scene in the browser, with sliders")
    view.add_argument(
        "input", metavar="SCENE|PICTURE", help="scene.toml, a picture, a film, #rrggbb"
    )
    _add_scene(view)
    view.add_argument("--save", metavar="FILE", help="where the button writes; beside the input")
    view.add_argument("--pixels", type=int, default=512, metavar="N", help="longer side; 512")
    view.add_argument("--port", type=int, default=0, metavar="N", help="any free one")
    view.add_argument("--no-browser", action="store_true", help="only print the address")
    view.set_defaults(run=_view)

    check = commands.add_parser("check", help="compare frames with their folder's flurries.json")
    check.add_argument("folder", metavar="FOLDER")
    check.set_defaults(run=_check, threads=None)

    corrupt = commands.add_parser("corrupt", help="a folder of pictures in weather")
    corrupt.add_argument("input", metavar="IN_DIR", help="pictures, also in folders below")
    corrupt.add_argument("output", metavar="OUT_DIR", help="gets WEATHER/SEVERITY/NAME")
    corrupt.add_argument(
        "--weather", default="snow", metavar="W", help="snow, rain, fog; several with commas"
    )
    corrupt.add_argument("--severity", default="1-5", metavar="S", help="such as 3; default: 1-5")
    corrupt.add_argument("--seed", type=int, default=0, metavar="N")
    corrupt.add_argument("--workers", type=int, metavar="N", help="processes; default: all cores")
    corrupt.add_argument(
        "--dask", nargs="?", const="", metavar="ADDRESS", help="by Dask; without address here"
    )
    corrupt.add_argument("--overwrite", action="store_true", help="make again what is there")
    corrupt.add_argument("--quiet", action="store_true", help="no progress bar")
    corrupt.set_defaults(run=_corrupt, threads=None)

    accuracy = commands.add_parser("accuracy", help="error against time, measured here")
    accuracy.add_argument("axes", nargs="*", metavar="AXIS", help="all if none; see --list")
    accuracy.add_argument("--list", action="store_true", help="say what can be measured")
    accuracy.add_argument(
        "-o", "--output", default="accuracy", metavar="FOLDER", help="default: accuracy"
    )
    accuracy.add_argument("--runs", type=int, default=20, metavar="N", help="of each; 20 or more")
    accuracy.add_argument("--page", metavar="FILE", help="also a page in Markdown")
    accuracy.add_argument("--quiet", action="store_true", help="no progress bar")
    accuracy.set_defaults(run=_accuracy)

    for command in (demo, render, plan, texture, view, accuracy):
        command.add_argument("--threads", type=int, metavar="N")
    return parser


def _add_scene(command: argparse.ArgumentParser) -> None:
    """Add the options that make or change a scene."""
    from flurries.effects.presets import CONE_RAIN, CONE_SNOW, MIST, RAIN, SNOW

    command.add_argument(
        "--snow", metavar="PRESET", help=", ".join(SNOW) + "; or severity=1..5, or rate_mm_h=R"
    )
    command.add_argument("--rain", metavar="PRESET", help="likewise; " + ", ".join(RAIN))
    command.add_argument("--cone-snow", metavar="PRESET", help=", ".join(CONE_SNOW))
    command.add_argument("--cone-rain", metavar="PRESET", help=", ".join(CONE_RAIN))
    command.add_argument(
        "--mist", metavar="PRESET", help=", ".join(MIST) + "; or severity=1..5, or visibility_m=V"
    )
    command.add_argument(
        "--visibility", type=float, metavar="METRES", help="how far one sees in it"
    )
    command.add_argument("--amount", type=float, metavar="A", help="how much of it, 0 to 1")
    command.add_argument("--wind", type=_numbers(3), metavar="X,Y,Z", help="metres per second")
    command.add_argument(
        "--fly", type=_numbers(3), metavar="X,Y,Z", help="camera velocity, metres per second"
    )
    command.add_argument(
        "--camera",
        metavar="FILE",
        help="camera path: .csv with x,y,z and rx,ry,rz a frame, Nuke's .chan, KITTI's poses .txt, "
        "or a folder of COLMAP's text",
    )
    command.add_argument("--depth", metavar="FILE|METRES", help="EXR with Z; or a wall's distance")
    command.add_argument(
        "--foreground", metavar="FILE", help="mask or picture in front of the weather"
    )
    command.add_argument("--seed", type=int, metavar="N")
    command.add_argument(
        "--tolerance", type=float, metavar="E", help="how far values may be off to save time"
    )
    command.add_argument("--size", metavar="WxH")
    command.add_argument("--fps", type=float, metavar="F")
    command.add_argument("--linear", action="store_true", help="mix in linear light")


def _numbers(count: int) -> Any:
    def parse(text: str) -> tuple[float, ...]:
        parts = text.split(",")
        if len(parts) != count:
            raise argparse.ArgumentTypeError(f"wants {count} numbers like 1,0,0, got {text!r}")
        try:
            return tuple(float(part) for part in parts)
        except ValueError:
            message = f"wants {count} numbers like 1,0,0, got {text!r}"
            raise argparse.ArgumentTypeError(message) from None

    return parse


def _demo(options: argparse.Namespace) -> int:
    from flurries.cli.demo import run

    run(options.output, size=options.size, frames=options.frames)
    return 0


def _texture(options: argparse.Namespace) -> int:
    from flurries.effects import Snow
    from flurries.scene.arguments import parse_size
    from flurries.spectral import BANDS, export_loop

    width, height = parse_size(options.size)
    band = BANDS.get(options.band)
    if band is None:
        try:
            low, high = (float(part) for part in options.band.split(","))
        except ValueError:
            raise _Mistake(
                f"--band wants {', '.join(BANDS)}, or two numbers like 4,32, got {options.band!r}"
            ) from None
        band = (low, high)
    # The presets' numbers are plain ones.
    look: Any = Snow.preset(options.look)
    made = export_loop(
        options.output,
        options.frames,
        (height, width),
        options.velocity,
        seed=options.seed,
        wavelengths=band,
        exponent=look.exponent,
        shutter=options.shutter,
        mean=look.mean,
        spread=look.spread,
        power=look.power,
        amount=look.texture,
        bits=options.bits,
        half=options.half,
        overwrite=options.overwrite,
        progress=_silent if options.quiet else _bar,
    )
    for file in made:
        print(file)
    return 0


def _render(options: argparse.Namespace) -> int:
    scene = _scene(options)
    summary = scene.write(
        options.output,
        options.frames,
        half=not options.float,
        layers=options.layers,
        alone=options.alone,
        overwrite=options.overwrite,
        damaged=options.damaged,
        sound=not options.no_sound,
        manifest=not options.no_manifest,
        quality=options.quality,
        dask=None if options.dask is None else options.dask or True,
        progress=_silent if options.quiet else _bar,
    )
    print(f"flurries: {told(summary)}", file=sys.stderr)
    for file in summary.files:
        print(file)
    return SKIPPED if summary.skipped else 0


def told(summary: Any) -> str:
    """Return a summary in words."""
    made = len(summary.written)
    parts = [f"{made} frames rendered"]
    if summary.kept:
        parts.append(f"{len(summary.kept)} were there already")
    for what, frames in (("skipped", summary.skipped), ("held", summary.held)):
        if frames:
            named = ", ".join(map(str, frames[:10])) + (", ..." if len(frames) > 10 else "")
            parts.append(f"{len(frames)} {what} ({named})")
    if summary.sound != "none":
        parts.append(f"sound {summary.sound}")
    if made and summary.seconds > 0.0:
        parts.append(f"in {summary.seconds:.1f} s, {made / summary.seconds:.1f} a second")
    return ", ".join(parts)


def _check(options: argparse.Namespace) -> int:
    from flurries.output import manifest

    wrong = manifest.check(options.folder)
    for sentence in wrong:
        print(f"flurries: {sentence}", file=sys.stderr)
    if not wrong:
        count = len(manifest.read(options.folder))
        print(f"flurries: {count} files are what the manifest says", file=sys.stderr)
    return SKIPPED if wrong else 0


def _plan(options: argparse.Namespace) -> int:
    from flurries.frame.calibration import scales

    scene = _scene(options)
    if options.calibrate:
        scales(again=True)
    plan = scene.plan(options.frames)
    print(plan.to_json() if options.json else plan)
    return 0


def _accuracy(options: argparse.Namespace) -> int:
    from flurries.accuracy import AXES, study, write

    if options.list:
        for axis in AXES.values():
            print(f"{axis.name:10} {axis.title}")
        return 0
    unknown = [name for name in options.axes if name not in AXES]
    if unknown:
        raise _Mistake(f"unknown axis {unknown[0]!r}: known are {', '.join(AXES)}")
    progress = _silent if options.quiet else _axes
    found = study(options.axes or None, runs=options.runs, progress=progress)
    for file in write(found, options.output, page=options.page):
        print(file)
    return 0


def _axes(axes: Iterable[Any]) -> Iterable[Any]:
    from tqdm import tqdm

    bar: Iterable[Any] = tqdm(axes, unit="axis", file=sys.stderr, dynamic_ncols=True)
    return bar


def _view(options: argparse.Namespace) -> int:
    from flurries.viewer.server import Server, serve

    if not 0 <= options.port < 65536:
        raise _Mistake(f"--port must be 0 to 65535, got {options.port}")
    given = Path(options.input)
    save = options.save or given.with_name(f"{given.stem.lstrip('#') or 'scene'}-tuned.toml")
    server = Server(_scene(options), port=options.port, size=options.pixels, save=save)
    print(server.url, flush=True)
    print("flurries: Ctrl-C ends the viewer", file=sys.stderr)
    if not options.no_browser:
        import webbrowser

        webbrowser.open(server.url)
    serve(server)
    return 0


def _corrupt(options: argparse.Namespace) -> int:
    from flurries.augment.corrupt import corrupt

    made = corrupt(
        options.input,
        options.output,
        weather=options.weather.split(","),
        severity=options.severity,
        seed=options.seed,
        workers=options.workers,
        dask=options.dask,
        overwrite=options.overwrite,
        progress=None if options.quiet else _bar,
    )
    kept = f", {len(made.kept)} were there already" if made.kept else ""
    print(f"flurries: {len(made.written)} pictures written{kept}", file=sys.stderr)
    for name, why in made.failed.items():
        print(f"flurries: {name}: {' '.join(why.split())}", file=sys.stderr)
    print(made.manifest)
    return MISTAKE if made.failed else 0


def _silent(frames: Iterable[Any]) -> Iterable[Any]:
    return frames


def _bar(frames: Iterable[int]) -> Iterable[int]:
    from tqdm import tqdm

    bar: Iterable[int] = tqdm(frames, unit="frame", file=sys.stderr, dynamic_ncols=True)
    return bar


def _scene(options: argparse.Namespace) -> Any:
    """Return the scene that the options describe."""
    from dataclasses import replace

    from flurries.camera.path import CameraPath
    from flurries.scene.scene import Scene

    given = Path(options.input)
    changes: dict[str, Any] = {
        name: getattr(options, name)
        for name in ("seed", "tolerance", "size", "fps", "foreground")
        if getattr(options, name) is not None
    }
    if options.linear:
        changes["space"] = "linear"
    if options.depth is not None:
        changes["depth"] = _depth(options.depth)
    weather = {
        name: getattr(options, name)
        for name in ("amount", "wind")
        if getattr(options, name) is not None
    }
    if given.suffix.lower() == ".toml":
        scene = Scene.load(given)
        if effects := _effects(options, weather):
            changes["effects"] = effects
        elif weather:
            changes["effects"] = [
                replace(e, **weather) if set(weather) <= set(vars(e)) else e for e in scene.effects
            ]
        if "size" in changes:
            # The focal length belongs to the picture's width: keep the angle of view.
            scene, changes = _resized(scene, changes)
        scene = scene.replace(**changes)
    else:
        effects = _effects(options, weather)
        if not effects:
            raise _Mistake(
                "a picture needs weather: add --snow PRESET, such as --snow heavy, "
                "--rain PRESET or --mist PRESET"
            )
        source: Any = options.input
        if not options.input.startswith("#"):
            from flurries.io import open_background

            source = open_background(options.input)
            if source.fps is not None:
                changes.setdefault("fps", float(source.fps))
        size = changes.pop("size", None)
        scene = Scene(size, source, effects=effects, **changes)
    if options.fly is not None:
        scene = scene.replace(camera=CameraPath(scene.camera.camera, velocity=options.fly))
    if options.camera is not None:
        if options.fly is not None:
            raise _Mistake("--camera and --fly must not both be given")
        from flurries.camera.importers import load

        way = load(options.camera, scene.shape, camera=scene.camera.camera)
        scene = scene.replace(camera=way)
    return scene


def _effects(options: argparse.Namespace, weather: dict[str, Any]) -> list[Any]:
    """Return the weather of the options, back to front."""
    from flurries.effects import ConeRain, ConeSnow, Mist, Rain, Snow

    effects: list[Any] = []
    if options.mist is not None:
        seen = {} if options.visibility is None else {"visibility": options.visibility}
        effects.append(_look(Mist, options.mist, **weather, **seen))
    elif options.visibility is not None:
        raise _Mistake("--visibility is one of mist: add --mist PRESET, such as --mist fog")
    kinds: tuple[tuple[type[Any], str | None], ...] = (
        (ConeSnow, options.cone_snow),
        (Snow, options.snow),
        (ConeRain, options.cone_rain),
        (Rain, options.rain),
    )
    effects += [_look(kind, name, **weather) for kind, name in kinds if name is not None]
    return effects


def _look(kind: type[Any], name: str, **weather: Any) -> Any:
    """Return an effect by a preset's name, or by a knob such as "severity=3"."""
    knob, given, value = name.partition("=")
    if not given:
        return kind.preset(name, **weather)
    knobs: tuple[str, ...] = getattr(kind, "KNOBS", ())
    if knob not in knobs:
        known = " or ".join(f"{one}=NUMBER" for one in knobs) or "none"
        raise _Mistake(f"{name!r}: knobs of {kind.NAME} are {known}")
    try:
        number: float | int = int(value) if knob == "severity" else float(value)
    except ValueError:
        raise _Mistake(f"{knob} must be a number, got {value!r}") from None
    return kind(**{knob: number}, **weather)


def _depth(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _resized(scene: Any, changes: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    from flurries.scene.arguments import parse_size

    changes = dict(changes)
    size = parse_size(changes.pop("size"))
    return scene, {**changes, "size": size, "camera": scene.camera.resize(size[0] / scene.size[0])}


if __name__ == "__main__":
    sys.exit(main())
