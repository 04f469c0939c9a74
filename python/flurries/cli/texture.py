"""`flurries texture`: snow that repeats in x, y and time."""

from typing import Any

from flurries.cli.options import FILE, OVERWRITE, THREADS, command, option, switch, voice
from flurries.cli.words import Words
from flurries.effects import TentSnow
from flurries.scene.arguments import parse_size
from flurries.spectral import export_loop


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
