"""Films that repeat: the 3-D method of the paper, and loops for game engines, with their files."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries import _core
from flurries._contract import MOST_ELEMENTS, Array, ArrayLike, Float64, PathLike
from flurries._warnings import warn
from flurries.spectral.tables import BANDS, SOFT_FROM, Aliasing, warn_long
from flurries.spectral.texture import Texture, reads_texture
from flurries.spectral.tiles import opacity, opacity_map

Cells: TypeAlias = Literal["one", "overlap"]

STILL = 0.25  # More of a loop standing still than this deserves a word.


class Film(NamedTuple):
    """A film that repeats, as the kernel reads it: every argument settled and checked."""

    texture: Texture
    frames: int
    shape: tuple[int, int]
    drift: tuple[float, float]
    seed: int
    cells: str

    def __getattr__(self, name: str) -> Any:
        # For who checks types: what the texture has is there.
        raise AttributeError(name)


reads_texture(Film)


def film(
    frames: int, shape: tuple[int, int], velocity: ArrayLike, texture: Texture, *, seed: int,
    cells: Cells = "one", most_still: float = STILL,
) -> Film:  # fmt: skip
    """Settle the arguments of a film, and warn of what would disappoint."""
    count = check.integer("frames", frames, low=1, high=2**31 - 1)
    size = check.shape_of("shape", shape)
    band = texture.wavelengths
    speed = check.vector("velocity", velocity, 2)
    warn_long(size, band)
    cycles = speed / band[1] if band[1] > 0.0 else np.zeros(2)
    steepest = math.hypot(float(cycles[0]), float(cycles[1]))
    if steepest >= 0.5 and texture.alias == "keep":
        warn(
            f"velocity turns the fastest waves by {steepest:.3g} cycles a frame; from half a cycle "
            'on they seem to run backwards: lower it, or drop them with alias="cut"'
        )
    turns = steepest * count
    # Rates below half a turn round to none; snow that is asked to stand still needs no warning.
    still = 2.0 / math.pi * math.asin(min(1.0, 0.5 / turns)) if turns > 0.0 else 0.0
    if still > most_still and cells == "one":
        warn(
            f"a loop of {count} frames rounds {100 * still:.0f} % of the waves to rest at this "
            "velocity: take more frames"
        )
    drift, number = (float(cycles[0]), float(cycles[1])), check.seed_of(seed)
    return Film(texture, count, size, drift, number, check.choice("cells", cells, Cells))


def rendered(asked: Film, times: Float64 | None, dtype: npt.DTypeLike, out: Array | None) -> Array:
    """Return (n, H, W): the film at each of the times, or at all its frames."""
    shape = (asked.frames if times is None else len(times), *asked.shape)
    if math.prod(shape) > MOST_ELEMENTS:
        raise ValueError(
            f"frames must hold at most {MOST_ELEMENTS} pixels together, got {shape[0]} of "
            f"{shape[1]} x {shape[2]}"
        )
    result = check.output(out, shape, check.float_dtype(dtype), *([] if times is None else [times]))
    moments = np.arange(shape[0], dtype=np.float64) if times is None else times
    _core.volume(result.reshape(-1, shape[2]), asked, moments)
    return result


def volume(
    frames: int, size: int, velocity: ArrayLike, *, seed: int,
    wavelengths: tuple[float, float] = BANDS["paper"], cells: Cells = "one",
    dtype: npt.DTypeLike = np.float32, out: Array | None = None,
) -> Array:  # fmt: skip
    """Film (T, M, M) of falling snow by the 3-D method: an inverse transform in space and time.

    Every column (kx, ky) of the M x M x T spectrum holds power where the tent passes through it;
    the rest is zero. The film is periodic in x, y and t: ``sum_k,n a(k, n) cos 2 pi (f_k . (x, y) +
    n t / T + phase(k, n))``. Mean 0; mean square 1 over space and time, with one cell per column in
    every frame. Waves so fast that they seem to run backwards, longer than the tile, or all rounded
    to rest are warned of.

    Parameters
    ----------
    frames, size : int
        T, the length of the film and its period, and M, pixels of a side.
    velocity : (vx, vy)
        Pixels per frame of the longest wave, ``wavelengths[1]``.
    seed : int
        Frame 0 with one cell per column is that of :func:`field` with one tile.
    wavelengths : (shortest, longest)
        See :func:`band_amplitude`.
    cells : {"one", "overlap"}
        Which cells of a column hold power: the one nearest to the tent, so that each wave keeps its
        amplitude and moves at ``round(rate T) / T``; or, an experiment, all whose unit cube the
        tent passes through, as the paper says. The latter has more cells at low frequencies, so
        that octaves are not equal any more, and every wave beats (``docs/internals/deviations.md``,
        14).

    Notes
    -----
    Langer 2004, section 5.1, and the slides of 2003, whose band is ``BANDS["slides"]``. Unlike
    :func:`field` it wants a constant motion, and M M T pixels in memory.
    """
    side = check.integer("size", size, low=1, high=2**15)
    texture = Texture(wavelengths=wavelengths)
    asked = film(frames, (side, side), velocity, texture, seed=seed, cells=cells, most_still=0.999)
    return rendered(asked, None, dtype, out)


def loop(
    frames: int, shape: tuple[int, int], velocity: ArrayLike, *, seed: int,
    time: ArrayLike | None = None, wavelengths: tuple[float, float] = BANDS["paper"],
    exponent: float = 1.0, alias: Aliasing = "keep", soft_from: float = SOFT_FROM,
    shutter: float = 0.0, jitter: bool = False, dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
) -> Array:  # fmt: skip
    """Field of falling snow that repeats after so many frames, and in x and y.

    (T, H, W), (n, H, W) or (H, W): all frames, or those at `time`, each of mean 0 and variance 1
    less what the filter takes. Each wave turns a whole number of times in the loop: the rates of
    :func:`tent_rate` with ``loop=frames``. Frame T + 3 has the bits of frame 3. Warned of is what
    :func:`volume` warns of, and more than a quarter of the waves at rest.

    Parameters
    ----------
    frames : int
        T, the length of the loop. Rounding is off by 0.29 cycles a loop (rms), so short loops of
        slow snow lose motion: of 30 frames at 2 px per frame 17 % of the power stands still.
    shape, velocity : (H, W), (vx, vy)
        Of the texture, a torus, and pixels per frame of the longest wave, ``wavelengths[1]``.
    time : float or (n,), optional
        Which moments, in frames; any numbers. If not given, frames 0 to T - 1.
    wavelengths, exponent, alias, soft_from, shutter, jitter
        See :class:`Texture`; the filter acts on the rounded rates.
    """
    texture = Texture(
        wavelengths=wavelengths, exponent=exponent, alias=alias, soft_from=soft_from,
        shutter=shutter, jitter=jitter,
    )  # fmt: skip
    asked = film(frames, shape, velocity, texture, seed=seed)
    if time is None:
        return rendered(asked, None, dtype, out)
    times = check.moderate("time", check.table("time", time, ndim=None))
    if times.ndim > 1 or times.size == 0:
        raise ValueError(f"time must be a number or (n,), got an array of shape {times.shape}")
    if np.ndim(time) != 0:
        return rendered(asked, times, dtype, out)
    result = check.output(out, asked.shape, check.float_dtype(dtype))
    rendered(asked, times.reshape(1), dtype, result[np.newaxis])
    return result


TOGETHER = 16  # Frames made at once: enough for all threads, little in memory.

# What the description says of the waves.
_LAW = ("wavelengths", "exponent", "seed", "alias", "soft_from", "shutter", "jitter")

# Formats that keep a torus seamless: no block of a lossy one knows its neighbour across the border.
INTEGERS, FLOATS = (".png", ".tif", ".tiff"), (".exr", ".tif", ".tiff")


def export_loop(
    pattern: PathLike, frames: int, shape: tuple[int, int], velocity: ArrayLike,
    *, seed: int, wavelengths: tuple[float, float] = BANDS["paper"], exponent: float = 1.0,
    alias: Aliasing = "keep", soft_from: float = SOFT_FROM, shutter: float = 0.0,
    jitter: bool = False, mean: float = 0.5, spread: float = 3.0, power: float = 2.0,
    amount: float = 1.0, bits: int | None = None, half: bool = False, overwrite: bool = False,
    progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
) -> list[Path]:  # fmt: skip
    """Write a loop of snow as textures that repeat in x, y and time, and return the files.

    Last of them is the description: a JSON file beside the frames, named like the pattern without
    its number. It holds size (width, height), frames, the pattern, the type of the values, all
    arguments, the mean opacity of what the files hold, and the version.

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

    Notes
    -----
    Langer 2004, section 6.2: their films repeat 30 frames of 8-bit luminance textures, 512 x 512,
    tiled across a polygon. Sample with a linear filter and a repeating address in all directions.
    """
    from flurries import __version__
    from flurries.io import Pattern, write_picture
    from flurries.io.atomic import checked_target, replacing
    from flurries.io.color import to_half, to_integer

    again = check.flag("overwrite", overwrite)
    narrow = check.flag("half", half)
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
    depth: dict[str, Any] = {"bits": int(stored[4:])} if integer else {}
    options: dict[str, Any] = {"encoding": "display" if integer else "linear", "half": narrow}
    total, done = 0.0, 0
    for first in (progress or iter)(range(0, asked.frames, TOGETHER)):
        times = np.arange(first, min(first + TOGETHER, asked.frames), dtype=np.float64)
        # The values that the files will hold, so that the mean is theirs.
        values = opacity(rendered(asked, times, np.float32, None), **look)
        if integer or stored == "half":
            values = to_integer(values, depth["bits"]) if integer else to_half(values)
        for t, picture in zip(range(first, first + len(times)), values, strict=True):
            write_picture(files[t], picture, **options, **depth)
        total += float(values.sum(dtype=np.float64))
        done += values.size
    top = 2.0 ** depth["bits"] - 1.0 if integer else 1.0
    described = {
        "generator": "flurries", "version": __version__, "size": [asked.shape[1], asked.shape[0]],
        "frames": asked.frames, "first": 0, "files": Path(target.text).name, "type": stored,
        "periodic": ["x", "y", "t"], "mean_opacity": total / done / top,
        "velocity": [c * asked.wavelengths[1] for c in asked.drift],
        **{name: getattr(asked, name) for name in _LAW}, **look,
    }  # fmt: skip
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
