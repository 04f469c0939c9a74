"""Seamless texture sequences for game engines: a loop's opacity as files, and what they are."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import flag
from flurries.spectral.tables import BANDS, SOFT_FROM, Aliasing
from flurries.spectral.texture import Texture
from flurries.spectral.tiles import opacity, opacity_map
from flurries.spectral.volume import film, rendered

# Frames made at once: enough for all threads, little in memory.
TOGETHER = 16

# What the description says of the waves.
_LAW = ("wavelengths", "exponent", "seed", "alias", "soft_from", "shutter", "jitter")

# Formats that keep a torus seamless: no block of a lossy one knows its neighbour across the border.
INTEGERS, FLOATS = (".png", ".tif", ".tiff"), (".exr", ".tif", ".tiff")


def export_loop(
    pattern: str | os.PathLike[str], frames: int, shape: tuple[int, int], velocity: npt.ArrayLike,
    *, seed: int, wavelengths: tuple[float, float] = BANDS["paper"], exponent: float = 1.0,
    alias: Aliasing = "keep", soft_from: float = SOFT_FROM, shutter: float = 0.0,
    jitter: bool = False, mean: float = 0.5, spread: float = 3.0, power: float = 2.0,
    amount: float = 1.0, bits: int | None = None, half: bool = False, overwrite: bool = False,
    progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
) -> list[Path]:  # fmt: skip
    """Write a loop of snow as textures that repeat in x, y and time.

    Parameters
    ----------
    pattern : str or path
        ``textures/snow_%04d.png`` (opacity as integers), ``.exr`` (floats) or ``.tif`` (floats, or
        integers with `bits`); frames are numbered from 0.
    frames, shape, velocity, seed, wavelengths, exponent, alias, soft_from, shutter, jitter
        See :func:`loop`.
    mean, spread, power, amount
        The map to opacity, see :func:`opacity`.
    bits, half : {8, 16}, bool
        Of integer files, 8 if not given; and EXR as half floats, else 32 bits.
    overwrite : bool
        Replace what is there; otherwise files in the way are refused.
    progress : callable, optional
        Wraps the frame numbers, as tqdm does.

    Returns
    -------
    list of Path
        The frames in order, and last the description: a JSON file beside them, named like the
        pattern without its number. It holds size (width, height), frames, the pattern, the type of
        the values, all arguments, the mean opacity of what the files hold, and the version.

    Notes
    -----
    Langer 2004, section 6.2: their films repeat 30 frames of 8-bit luminance textures, 512 x 512,
    tiled across a polygon. Sample with a linear filter and a repeating address in all directions.
    """
    from flurries import __version__
    from flurries.io import Pattern, write_picture
    from flurries.io.atomic import checked_target, replacing
    from flurries.io.color import to_half, to_integer

    again = flag("overwrite", overwrite)
    narrow = flag("half", half)
    waves = Texture(
        wavelengths=wavelengths, exponent=exponent, alias=alias, soft_from=soft_from,
        shutter=shutter, jitter=jitter,
    )  # fmt: skip
    asked = film(frames, shape, velocity, waves, seed=seed)
    mapped = opacity_map(mean, spread, power, amount)
    look: dict[str, Any] = dict(zip(("mean", "spread", "power", "amount"), mapped, strict=True))
    target = Pattern(os.fspath(pattern))
    stored = _stored(target, bits, narrow)
    files = [target.path(t) for t in range(asked.frames)]
    side = _description(target)
    for file in (*files, side):
        checked_target(file)
        if not again and file.exists():
            raise ValueError(
                f"{file} is there already (pattern {target.text!r}); overwrite=True (--overwrite) "
                "replaces it"
            )
    integer = stored.startswith("uint")
    options: dict[str, Any] = {"encoding": "display" if integer else "linear", "half": narrow}
    if integer:
        options["bits"] = int(stored[4:])
    total, done = 0.0, 0
    for first in (progress or iter)(range(0, asked.frames, TOGETHER)):
        times = np.arange(first, min(first + TOGETHER, asked.frames), dtype=np.float64)
        # The values that the files will hold, so that the mean is theirs.
        values = opacity(rendered(asked, times, np.float32, None), **look)
        if integer or stored == "half":
            values = to_integer(values, options["bits"]) if integer else to_half(values)
        for t, picture in zip(range(first, first + len(times)), values, strict=True):
            write_picture(files[t], picture, **options)
        total += float(values.sum(dtype=np.float64))
        done += values.size
    top = float(2 ** int(stored[4:]) - 1) if integer else 1.0
    described = {
        "generator": "flurries",
        "version": __version__,
        "size": [asked.shape[1], asked.shape[0]],
        "frames": asked.frames,
        "first": 0,
        "files": Path(target.text).name,
        "type": stored,
        "periodic": ["x", "y", "t"],
        "mean_opacity": total / done / top,
        "velocity": [c * asked.wavelengths[1] for c in asked.drift],
        **{name: getattr(asked, name) for name in _LAW},
        **look,
    }
    with replacing(side) as temporary:
        temporary.write_text(json.dumps(described, indent=2) + "\n", encoding="utf-8")
    return [*files, side]


def _stored(target: Any, bits: object, half: bool) -> str:
    """Return the type of the values in the files."""
    suffix = Path(target.text).suffix.lower()
    if suffix not in (*INTEGERS, *FLOATS):
        raise ValueError(f"pattern must end in .png, .exr or .tif, got {target.text!r}")
    if bits is not None and bits not in (8, 16):
        raise ValueError(f"bits must be 8 or 16, got {bits!r}")
    if suffix in FLOATS and bits is None:
        return "half" if half and suffix == ".exr" else "float"
    if suffix not in INTEGERS:
        raise ValueError(f"bits are for integer files, and {suffix} holds floats")
    return f"uint{8 if bits is None else bits}"


def _description(target: Any) -> Path:
    """Return the JSON file beside the frames: the pattern's name without its number."""
    path = Path(target.text)
    head, _, tail = path.stem.partition("%")
    name = (head.rstrip("._- ") + tail.lstrip("0123456789").removeprefix("d")).strip("._- ")
    return path.with_name(f"{name or 'loop'}.json")
