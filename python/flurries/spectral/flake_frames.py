"""Frames of a texture of flakes as the kernel reads them: which patterns stand where in tiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64, float_dtype, output


class Before(NamedTuple):
    """A scene that hides what lies behind it, for groups of terms of a :class:`Request`.

    Attributes
    ----------
    depth : (H, W) float32
        Of the whole frame.
    group : (n,) int32
        Of each term, from 0 on.
    edges : (E,) float64
        Rising depths.
    shares : (G, E) float64
        Of each group, what share of its optical depth lies before these: it rises evenly from one
        to the next, and is constant beyond the ends.
    mean : (rows, cols, G) or (1, 1, G) float64
        Mean optical depth of each group, in place of the request's.
    """

    depth: Array
    group: npt.NDArray[np.int32]
    edges: Float64
    shares: Float64
    mean: Float64


class Request(NamedTuple):
    """The patterns of a frame's window and their places, as the kernel reads them.

    Arrays begin with (rows, cols), the tiles of the whole frame, or with (1, 1) or (rows, 1) or
    (1, cols) where tiles are alike; n is the number of terms of a tile. A term is a pattern of
    :func:`prepare`: a layer has one, or two while a generation gives way to the next.

    Attributes
    ----------
    shape : (H, W)
        Of the whole frame.
    overlap : int
        Pixels shared by neighbours.
    pattern : (rows, cols, n) int32
        Number of a pattern, as they were prepared; below 0 for none.
    gain : (rows, cols, n) float64
        Factor of the pattern without its mean.
    shift : (rows, cols, n, 2) float64
        Pixels (x, y) that it is moved by, shift of the torus and displacement together.
    streak : (rows, cols, n, 2) float64 or None
        Pixels (x, y) that it moves by while the shutter is open.
    mean : (rows, cols) float64
        Mean optical depth of the tile.
    window : (top, bottom, left, right)
        What is made of the frame, in pixels.
    before : Before, optional
        What the scene hides; not for :func:`bands_of`.
    """

    shape: tuple[int, int]
    overlap: int
    pattern: npt.NDArray[np.int32]
    gain: Float64
    shift: Float64
    streak: Float64 | None
    mean: Float64
    window: tuple[int, int, int, int]
    before: Before | None = None


class Choices(NamedTuple):
    """The choices of tiles by a seed: arrays of a :class:`Request`."""

    pattern: npt.NDArray[np.int32]
    shift: Float64


def prepare(patterns: Array, *, shear: float, dtype: npt.DTypeLike) -> _core.PreparedFlakes:
    """Return patterns as frames of float32 or float64 read them; make it once for a film.

    Parameters
    ----------
    patterns : (L, P, M, M // 2 + 1) complex64 or complex128
        Of :func:`flake_patterns`. Pattern p of layer l is number ``l P + p`` of a :class:`Request`.
    shear : float
        That of the patterns.
    dtype : float32 or float64
        Of the frames.

    Returns
    -------
    PreparedFlakes
        For :func:`frame_of`; ``_core.flake_mix(first, second, weight)`` is between two of them,
        such as two rungs of the ladder of amounts.
    """
    flat = patterns.reshape(-1, *patterns.shape[2:])
    return _core.flake_prepare(flat, shear, float_dtype(dtype) == np.float64)


def choices(
    seed: int,
    tiles: tuple[int, int],
    *,
    layers: int,
    patterns: int,
    tile: int,
    generation: npt.NDArray[np.int64] | None = None,
    moved: Float64 | None = None,
    placed: bool = False,
    terms: Sequence[int] | None = None,
) -> Choices:
    """Return the choices of each tile for each layer: a pattern and its place.

    Parameters
    ----------
    seed : int
    tiles : (rows, cols)
        A larger picture keeps the choices of a smaller one's tiles.
    layers, patterns, tile : int
        L, P and M of the patterns.
    generation : (rows, cols, L) int64, optional
        Number of the generation that passes through a layer; another one has other patterns.
        None is 0 everywhere.
    moved : (rows, cols, L, 2) or (1, 1, L, 2), optional
        Displacements of the layers, pixels (x, y), to be added to the shifts.
    placed : bool
        Whether patterns stand at 16 places within a pixel, as ``_core.flake_population`` makes
        them: the nearest place is taken, and whole pixels are left of the shift.
    terms : sequence of int, optional
        Layers of the terms that are asked for; all arrays then have these in place of the layers.

    Returns
    -------
    Choices
        ``pattern`` and ``shift`` for L terms.
    """
    number = layers if terms is None else len(terms)
    pattern = np.empty((*tiles, number), np.int32)
    shift = np.empty((*tiles, number, 2))
    _core.flake_choices(pattern, shift, seed, patterns, tile, generation, moved, placed, terms)
    return Choices(pattern, shift)


def frame_of(
    patterns: _core.PreparedFlakes,
    request: Request,
    *,
    opacity: bool,
    mask: Array | None = None,
    dtype: npt.DTypeLike = np.float32,
    out: Array | None = None,
    add: bool = False,
) -> Array:
    """Return a request's window: optical depth, or the opacity ``1 - exp(-depth)``.

    Any window has the bits of the whole frame, for any number of threads. Where ``mean`` differs
    from tile to tile it is blended by weights that sum to 1.

    Parameters
    ----------
    patterns : PreparedFlakes
        Of :func:`prepare`, for `dtype`.
    request : Request
    opacity : bool
    mask : (h, w), dtype of the result, optional
        Share of the depth that is seen in each pixel of the window: a group of layers before a
        wall, or by its rows what has not yet begun to fall.
    dtype : float32 or float64
    out : (h, w), optional
        Array to write into and return.
    add : bool
        Add the depth to what `out` holds, the depth of other groups of layers; the last group's
        call asks for the opacity of all.

    Returns
    -------
    (h, w)
    """
    top, bottom, left, right = request.window
    given = [] if mask is None else [mask]
    result = output(out, (bottom - top, right - left), float_dtype(dtype), *given)
    _core.flake_frame(result, patterns, request, opacity, add, mask)
    return result


def bands_of(
    patterns: _core.PreparedFlakes, request: Request, *, opacity: bool
) -> _core.FlakeBands:
    """Begin a window that is taken band by band, each tile made once.

    ``_core.flake_take(bands, out, first)`` writes the rows of the frame from `first` on, as many as
    `out` (h, w) has, from the top down; rows before `first` are skipped. They have the bits of
    :func:`frame_of`.
    """
    return _core.flake_bands(patterns, request, opacity)
