"""How frames are written where nobody says otherwise: the [output] of a scene file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from flurries._contract import choice, flag, suggesting
from flurries.io.films.codecs import CODECS, QUALITIES
from flurries.io.pictures.writer import COMPRESSIONS

# What the numbers of motion vectors in a file mean.
MOTION = {
    "y-down": "px per frame, x right, y down",
    "y-up": "px per frame, x right, y up",
}

BITS = (8, 10, 16, "half", "float")
DAMAGED = ("stop", "skip", "hold")

# What a file may hold in place of the composite.
KINDS = ("alone", "layers", "deep")


@suggesting
@dataclass(frozen=True, kw_only=True)
class Output:
    """How the frames of a scene are written.

    Arguments of :meth:`Scene.write` and options of the command line come before these. A codec is
    for films and a compression for EXR: other files are written without.

    Parameters
    ----------
    bits : 8, 10, 16, "half" or "float", optional
        Of a color, as far as the file holds them. If not given, half in EXR, 10 in DPX, and else
        what the background has.
    codec : str, optional
        Of a film: "h264", "h265", "vp9", "ffv1", "prores-hq", "prores-4444" or "dnxhr"; the
        extension's own if not given.
    motion : {"y-down", "y-up"}
        Which way the second number of motion vectors in layers counts.
    colorspace : str, optional
        What is written, by its name in ``$OCIO``; the scene's own if not given.
    compression : {"zip", "zips", "piz", "rle", "none", "dwaa", "dwab"}
        How an EXR packs its pixels; the last two are lossy.
    quality : {"high", "medium", "draft"}
        Of a film.
    layers : bool
        EXR only: the weather, depth and motion as channels beside the composite.
    alone : bool
        The weather alone as RGBA.
    deep : bool
        EXR only: the weather alone as deep samples, see :func:`flurries.output.deep.deep_of`.
    damaged : {"stop", "skip", "hold"}
        What becomes of frames whose background is missing or damaged.
    sound : bool
        Keep the sound of a background film.
    manifest : bool
        Write ``flurries.json`` beside a sequence.

    Raises
    ------
    ValueError, TypeError
        For a value that is not as described; the message names it.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene((64, 48), "#203040", output=fl.Output(bits="float", motion="y-up"))
    >>> scene.output.bits
    'float'
    """

    bits: Literal[8, 10, 16, "half", "float"] | None = None
    codec: str | None = None
    motion: Literal["y-down", "y-up"] = "y-down"
    colorspace: str | None = None
    compression: Literal["zip", "zips", "piz", "rle", "none", "dwaa", "dwab"] = "zip"
    quality: Literal["high", "medium", "draft"] = "high"
    layers: bool = False
    alone: bool = False
    deep: bool = False
    damaged: Literal["stop", "skip", "hold"] = "stop"
    sound: bool = True
    manifest: bool = True

    def __post_init__(self) -> None:
        for name in ("layers", "alone", "deep", "sound", "manifest"):
            flag(name, getattr(self, name))
        choice("damaged", self.damaged, DAMAGED)
        choice("compression", self.compression, tuple(COMPRESSIONS))
        choice("motion", self.motion, tuple(MOTION))
        choice("quality", self.quality, QUALITIES)
        if isinstance(self.bits, bool) or self.bits not in (None, *BITS):
            raise ValueError(f"bits must be one of {', '.join(map(str, BITS))}, got {self.bits!r}")
        if self.codec is not None:
            choice("codec", self.codec, tuple(CODECS))
        if self.colorspace is not None and not isinstance(self.colorspace, str):
            raise TypeError(f"colorspace must be a name, got {self.colorspace!r}")
        kinds = [name for name in KINDS if getattr(self, name)]
        if len(kinds) > 1:
            raise ValueError(f"{' and '.join(kinds)} must not both be given")

    @property
    def kind(self) -> str:
        """What a file holds: "composite", "alone", "layers" or "deep"."""
        return next((kind for kind in KINDS if getattr(self, kind)), "composite")

    def given(self, values: Mapping[str, Any]) -> Output:
        """Return these with the values that are not None in their place.

        One of alone, layers and deep that is given takes the others' place.
        """
        said = {name: value for name, value in values.items() if value is not None}
        if any(said.get(kind) is True for kind in KINDS):
            said = {**dict.fromkeys(KINDS, False), **said}
        return replace(self, **said)

    def changed(self) -> dict[str, Any]:
        """Return the values that differ from their defaults."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {f.name: values[f.name] for f in fields(self) if values[f.name] != f.default}
