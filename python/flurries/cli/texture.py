"""`flurries texture`: snow that repeats in x, y and time."""

from __future__ import annotations

from typing import Any

from flurries.cli.options import (
    FILE,
    OVERWRITE,
    THREADS,
    OneOf,
    command,
    numbers,
    option,
    voice,
)
from flurries.cli.words import Words
from flurries.effects import TentSnow
from flurries.scene.arguments import parse_size
from flurries.spectral import export_loop


@command(
    "flurries texture -o snow/%04d.png",
    "flurries texture --look heavy --size 256x256 --frames 32 --velocity 0,3 -o heavy/%04d.exr",
)
@option("-o", "--output", required=True, metavar="PATTERN", type=FILE, example="snow/%04d.png",
        help="one file a frame: .png, .exr or .tif")  # fmt: skip
@option("--frames", type=int, default=60, metavar="N", help="frames until it repeats", example="32")
@option("--size", default="512x512", metavar="WxH", help="size in pixels", example="256x256")
@option("--velocity", type=numbers(2), default="0.5,2", metavar="X,Y", example="-1,3",
        help="pixels per frame of the longest wave, y down")  # fmt: skip
@option("--band", type=numbers(2), default="4,32", metavar="SHORT,LONG", example="2,16",
        help="wavelengths in pixels")  # fmt: skip
@option("--look", default="paper", type=OneOf(tuple(TentSnow.PRESETS)), help="opacity",
        example="heavy")  # fmt: skip
@option("--shutter", type=float, default=0.0, metavar="S", help="exposure in frames", example="0.5")
@option("--seed", type=int, default=1, metavar="N", help="which of all loops", example="7")
@option("--bits", type=OneOf(("8", "16")), unset="8; a .tif of floats", example="16",
        help="of integer files")  # fmt: skip
@option("--half", is_flag=True, help="EXR with 16 bits a value, not 32")
@OVERWRITE
@THREADS
@voice
def texture(
    words: Words, output: str, size: str, band: Any, look: str, bits: str | None, **given: Any
) -> None:
    """Write a loop of snow as textures that repeat in x, y and time, and a JSON that describes it.

    Prints the files.
    """
    width, height = parse_size(size)
    # The presets' numbers are plain ones.
    opacity: Any = TentSnow(look)  # type: ignore[arg-type]
    made = export_loop(
        output, shape=(height, width), wavelengths=band, bits=None if bits is None else int(bits),
        exponent=opacity.exponent, mean=opacity.mean, spread=opacity.spread, power=opacity.power,
        amount=opacity.texture, progress=words.progress("group"), **given,
    )  # fmt: skip
    for file in made:
        print(file)
