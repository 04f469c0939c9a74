"""`flurries render`, `check` and `texture`: weather over pictures, films and scenes, to files."""

from dataclasses import replace
from typing import Any

import click

from flurries import stereo
from flurries._trace import tracing
from flurries.cli.options import (
    FILE,
    FRAMES,
    OVERWRITE,
    THREADS,
    WORK,
    command,
    dask,
    option,
    switch,
    voice,
)
from flurries.cli.weather import scene_of, scene_options
from flurries.cli.words import Words, count, say, stages
from flurries.effects import TentSnow
from flurries.io.films.codecs import CODECS, QUALITIES
from flurries.io.pictures.writer import COMPRESSIONS
from flurries.io.sequences import with_percent
from flurries.output.journal import check as check_all
from flurries.output.write import Summary
from flurries.scene.arguments import parse_size
from flurries.scene.output import BITS, DAMAGED, MOTION, OutputFields
from flurries.spectral import export_loop

SKIPPED = DIFFERENT = 3

NAMED = 10  # How many numbers of frames a sentence names.


@command(
    "flurries render photo.jpg --snow heavy -o snowy.png",
    "flurries render photo.jpg --severity 3 --frames 1-90 -o snowy.mp4",
    "flurries render photo.jpg --rain downpour --mist fog --visibility 40 -o wet.png",
    "flurries render plate.%04d.exr --snow light --layers -o out/%04d.exr",
    "flurries render scene.toml --frames 1-600 -o frames/%04d.png",
    "flurries render plate.####.exr --camera shot.usda --snow heavy -o flakes.usdc",
)
@option("-o --output", FILE, "PATTERN|VIDEO", "frames/%04d.png", None,
        "one file a frame (also #### or $F4; .exr, .png, .tif, .dpx, .jpg), a video (.mp4, .mov, "
        ".webm, .mkv), a still, or flakes as points (.usdc)", required=True)  # fmt: skip
@FRAMES
@scene_options
@OVERWRITE
@option("--bits", tuple(map(str, BITS)), None, "float",
        "the scene's, else half in EXR, else the picture's", "of a color: half or float in EXR, 8 "
        "or 16 in PNG and TIFF, 8, 10 or 16 in DPX, what a video's codec has")  # fmt: skip
@option("--compression", tuple(COMPRESSIONS), None, "dwaa", "the scene's, else zip",
        "how EXR packs pixels; dwaa and dwab lose what is hard to see")  # fmt: skip
@option("--output-colorspace", str, "NAME", "sRGB - Display", "the scene's, else --colorspace",
        "color space of what is written")  # fmt: skip
@option("--codec", tuple(CODECS), None, "prores-hq", "the scene's, else that of the video's name",
        "of a video; prores-4444 has alpha for --alone")  # fmt: skip
@option("--motion", tuple(MOTION), None, "y-up", "the scene's, else y-down",
        "which way motion vectors of --layers count")  # fmt: skip
@switch("--layers", "EXR with the weather, depth and motion as layers", default=None)
@switch("--plate", "in the EXR of --layers the composite and the plate, too", default=None)
@switch("--alone", "only the weather, as RGBA; .exr, .png, .tif, or a .mov of --codec prores-4444",
        default=None)  # fmt: skip
@switch("--deep", "only the weather, as deep samples of an EXR", default=None)
@option("--quality", QUALITIES, None, "draft", "the scene's, else high", "of a video")
@option("--damaged", DAMAGED, None, "hold", "the scene's, else stop",
        "where the background's frame is missing or damaged: stop, skip it and exit with 3, or "
        "hold the last good one")  # fmt: skip
@switch("--no-sound", "a video without the film's sound")
@option("--eyes", 2, "METRES,METRES", "0.064,20", "one eye", "distance of two eyes, and "
        "how far away both see the same; %V in names of files is left and right")  # fmt: skip
@dask("the threads of this machine")
@option("--dask-patience", float, "SECONDS", "600", None,
        "how long to wait while the cluster has no worker", default=60.0)  # fmt: skip
@WORK
@voice
def render(words: Words, output: str, eyes: tuple[float, float] | None, **given: Any) -> int:
    """Render weather over a picture, a film, a sequence, a color such as #203040, or a scene.toml.

    Prints the files that are there. Run again, it makes only the frames that are missing.
    """
    two = "%V" in output
    if two != (eyes is not None or "%V" in (given["camera"] or "")):
        raise click.UsageError("two eyes need %V in --output, and --eyes or %V in --camera")
    if not two:
        return _render(words, output, None, **given)
    ends = []
    for side, view in enumerate(("left", "right")):
        texts = {n: v.replace("%V", view) for n, v in given.items() if isinstance(v, str)}
        front = [name.replace("%V", view) for name in given["foreground"]]
        own = {**given, **texts, "foreground": front}
        ends.append(_render(words, output.replace("%V", view), eyes and (*eyes, side), **own))
    return max(ends)


def _render(
    words: Words, output: str, eye: tuple[float, float, int] | None, *, frames: str | None,
    overwrite: bool, bits: str | None, no_sound: bool, output_colorspace: str | None,
    dask: str | None, dask_patience: float, **given: Any,
) -> int:  # fmt: skip
    names = OutputFields.__annotations__
    files: Any = {name: given.pop(name) for name in names if name in given if name != "colorspace"}
    files["bits"] = int(bits) if bits is not None and bits.isdigit() else bits
    scene = scene_of(**given)
    if scene._still and (frames is not None or "%" in with_percent(output)):
        scene = scene.replace(fps=scene.fps)
    if eye is not None:
        pair = stereo.eyes(scene.camera.camera, distance=eye[0], convergence=eye[1])
        scene = scene.replace(camera=replace(scene.camera, camera=pair[eye[2]]))
    for line in scene._bent:
        words.say(line)
    if words.verbose:
        height, width = scene._shape
        weather = ", ".join(type(effect).__name__ for effect in scene.effects)
        words.say(f"{width} x {height} px, {scene.fps:g} frames a second: {weather}")
    with tracing() as trace:
        summary = scene.write(
            output, frames, colorspace=output_colorspace, overwrite=overwrite,
            sound=False if no_sound else None, **files,
            dask=None if dask is None else dask or True, dask_patience=dask_patience,
            progress=words.progress("frame"),
        )  # fmt: skip
    # Frames that are not as they should be are said in any case.
    (say if summary.skipped or summary.held else words.say)(describe(summary))
    if words.verbose and summary.written:
        words.say(stages(trace, len(summary.written)))
    for file in summary.files:
        print(file)
    return SKIPPED if summary.skipped else 0


def describe(summary: Summary) -> str:
    made = len(summary.written)
    parts = [f"{count(made, 'frame')} rendered"]
    if kept := len(summary.kept):
        parts.append(f"{kept} {'was' if kept == 1 else 'were'} there already")
    for fate, frames in (("skipped", summary.skipped), ("held", summary.held)):
        if frames:
            named = ", ".join(map(str, frames[:NAMED])) + (", ..." if len(frames) > NAMED else "")
            parts.append(f"{len(frames)} {fate} ({named})")
    if summary.sound != "none":
        parts.append(f"sound {summary.sound}")
    if made and summary.seconds > 0.0:
        parts.append(f"in {summary.seconds:.1f} s, {made / summary.seconds:.1f} a second")
    return ", ".join(parts)


@command("flurries check frames")
@click.argument("folder", metavar="FOLDER", type=FILE)
@voice
def check(words: Words, folder: str) -> int:
    """Compare the frames of a folder, or behind a url, with their journal, flurries.jsonl."""
    files, wrong = check_all(folder)
    for sentence in wrong:
        say(sentence)
    if wrong:
        return DIFFERENT
    words.say(f"{count(files, 'file')} {'is' if files == 1 else 'are'} what the journal says")
    return 0


@command(
    "flurries texture -o snow/%04d.png",
    "flurries texture --look heavy --size 256x256 --frames 32 --velocity 0,3 -o heavy/%04d.exr",
)
@option("-o --output", FILE, "PATTERN", "snow/%04d.png", None,
        "one file a frame: .png, .exr or .tif", required=True)  # fmt: skip
@option("--frames", int, "N", "32", None, "frames until it repeats", default=60)
@option("--size", str, "WxH", "256x256", None, "size in pixels", default="512x512")
@option("--velocity", 2, "X,Y", "-1,3", None,
        "pixels per frame of the longest wave, y down", default="0.5,2")  # fmt: skip
@option("--band", 2, "SHORT,LONG", "2,16", None, "wavelengths in pixels", default="4,32")
@option("--look", tuple(TentSnow.PRESETS), None, "heavy", None, "opacity", default="paper")
@option("--shutter", float, "S", "0.5", "0", "exposure in frames", default=0.0)
@option("--seed", int, "N", "7", None, "which of all loops", default=1)
@option("--bits", ("8", "16"), None, "16", "8; a .tif of floats", "of integer files")
@switch("--half", "EXR with 16 bits a value, not 32")
@OVERWRITE
@THREADS
@voice
def texture(
    words: Words, output: str, size: str, band: Any, look: Any, bits: str | None, **given: Any
) -> None:
    """Write a loop of snow as textures that repeat in x, y and time, and a JSON that describes it.

    Prints the files.
    """
    width, height = parse_size(size)
    # The presets' numbers are plain ones.
    opacity: Any = TentSnow(look)
    made = export_loop(
        output, shape=(height, width), wavelengths=band, bits=None if bits is None else int(bits),
        exponent=opacity.exponent, mean=opacity.mean, spread=opacity.spread, power=opacity.power,
        amount=opacity.texture, progress=words.progress("group"), **given,
    )  # fmt: skip
    for file in made:
        print(file)
