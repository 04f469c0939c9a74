"""How frames are written where nobody says otherwise: the [output] of a scene file."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypedDict, TypeVar

from flurries._contract import choice, flag, suggesting
from flurries.io.colorspace import ColorSpace
from flurries.io.films.codecs import CODECS, QUALITIES
from flurries.io.pictures.writer import COMPRESSIONS, format_of

# What the numbers of motion vectors in a file mean.
MOTION = {"y-down": "px per frame, x right, y down", "y-up": "px per frame, x right, y up"}

Bits: TypeAlias = Literal[8, 10, 16, "half", "float"]
Motion: TypeAlias = Literal["y-down", "y-up"]
Compression: TypeAlias = Literal["zip", "zips", "piz", "rle", "none", "dwaa", "dwab"]
Quality: TypeAlias = Literal["high", "medium", "draft"]
Damaged: TypeAlias = Literal["stop", "skip", "hold"]

_Method = TypeVar("_Method", bound=Callable[..., Any])

BITS = (8, 10, 16, "half", "float")
DAMAGED = ("stop", "skip", "hold")

KINDS = ("alone", "layers", "deep")  # What a file may hold in place of the composite.


class OutputFields(TypedDict, total=False):
    """The fields of `Output` as keywords, for type checkers; None is the scene's own."""

    bits: Bits | None
    codec: str | None
    motion: Motion | None
    colorspace: str | None
    compression: Compression | None
    quality: Quality | None
    layers: bool | None
    plate: bool | None
    alone: bool | None
    deep: bool | None
    damaged: Damaged | None
    sound: bool | None


@suggesting
@dataclass(frozen=True, kw_only=True)
class Output:
    """The way in which a scene's frames are written, where :meth:`Scene.write` does not say.

    Parameters
    ----------
    bits : 8, 10, 16, "half" or "float", optional
        Bits of a color: in EXR "half" or "float", in PNG 8 or 16, in TIFF also "float", in DPX 8,
        10 or 16, in a film what its codec has. If not given, half in EXR, 10 in DPX, and else what
        the background has: a film that holds fewer is refused.
    codec : str, optional
        Codec of a film: "h264", "h265", "vp9", "ffv1", "prores-hq", "prores-4444" (with alpha for
        `alone`) or "dnxhr"; the extension's own if not given.
    motion : {"y-down", "y-up"}
        Whether the second number of motion vectors in layers counts down or up.
    colorspace : str, optional
        Color space of the files, by its name in ``$OCIO``; the scene's own if not given. EXR holds
        linear ones, integers and films encoded ones; layers stay in the light of their mixture.
    compression : {"zip", "zips", "piz", "rle", "none", "dwaa", "dwab"}
        How an EXR packs its pixels; the last two lose bits that are hard to see, and half the bytes
        or more. Not for layers and eyes.
    quality : {"high", "medium", "draft"}
        Quality of a film.
    layers : bool
        EXR only: all layers, depths and motions of the weather as named channels.
    plate : bool
        Beside layers the composite, the background, its depth and the foreground.
    alone : bool
        The weather alone as RGBA: premultiplied linear light in EXR, straight display values in PNG
        and in a film of ProRes 4444.
    deep : bool
        EXR only: the weather alone as deep samples in linear light; the frame is drawn 32 times.
    damaged : {"stop", "skip", "hold"}
        What happens where the background is missing or damaged: "stop" is an error, "skip" leaves
        the frame out, "hold" renders it over the last good background before it.
    sound : bool
        Keep the sound of a background's film, where frames follow each other at its own rate.
    """

    bits: Bits | None = None
    codec: str | None = None
    motion: Motion = "y-down"
    colorspace: str | None = None
    compression: Compression = "zip"
    quality: Quality = "high"
    layers: bool = False
    plate: bool = False
    alone: bool = False
    deep: bool = False
    damaged: Damaged = "stop"
    sound: bool = True

    def __post_init__(self) -> None:
        for name in ("layers", "plate", "alone", "deep", "sound"):
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
        """The contents of a file: "composite", "alone", "layers" or "deep"."""
        return next((kind for kind in KINDS if getattr(self, kind)), "composite")

    def given(self, values: Mapping[str, Any]) -> Output:
        """Return these with the values that are not None in their place; one kind takes others'."""
        said = {name: value for name, value in values.items() if value is not None}
        if any(said.get(kind) is True for kind in KINDS):
            said = {**dict.fromkeys(KINDS, False), **said}
        return replace(self, **said)

    def require(self, text: str, space: ColorSpace | None, *, film: bool, eyes: bool) -> None:
        kind, suffix = self.kind, Path(text).suffix.lower()
        exr, tiff, alone = suffix == ".exr", suffix in (".tif", ".tiff"), kind == "alone"
        apart = kind in ("layers", "deep") or eyes
        known = (self.bits,) if film else (*format_of(text).bits, *format_of(text).floats)
        space = None if apart and kind != "deep" else space
        rules = [
            (film and alone and self.codec != "prores-4444",
             f"alone needs codec='prores-4444' in a film, or .exr, .png, .tif: {text}"),
            (not film and self.codec is not None, f"codec is one of a film, got {text!r}"),
            (not film and alone and not (exr or tiff or suffix == ".png"),
             f"alone needs .exr, .png or .tif, and no layers, got {text!r}"),
            (self.bits is not None and self.bits not in known,
             f"bits must be {', '.join(map(str, known))} in {text}, got {self.bits!r}"),
            (kind in ("alone", "deep") and eyes, f"{kind} and eyes must not both be given"),
            (self.compression != "zip" and (apart or not exr),
             "compression is for a composite or the weather alone in an EXR, got "
             f"{self.compression!r} for {text!r}"),
            (space is not None and space.linear and not (exr or tiff),
             f"colorspace {space and space.name!r} is linear, which {text} cannot hold: give "
             "another one for it, such as 'sRGB - Display' (--output-colorspace)"),
            (space is not None and not space.linear and exr,
             f"colorspace {space and space.name!r} is not linear, as an EXR is: {text}"),
            (self.plate and kind != "layers", f"plate is a part of layers, which {text} has not"),
            (kind in ("layers", "deep") and not exr, f"{kind} needs an EXR, got {text!r}"),
            (eyes and not exr, f"eyes need an EXR, got {text!r}"),
        ]  # fmt: skip
        for refused, why in rules:
            if refused:
                raise ValueError(why)

    def changed(self) -> dict[str, Any]:
        return {f.name: own for f in fields(self) if (own := getattr(self, f.name)) != f.default}


def takes_output(write: _Method) -> _Method:
    """Let ``**output`` of a method stand for the fields of `Output`, in its signature and page."""
    own = inspect.signature(write)
    *given, rest = own.parameters.values()
    options = [
        rest.replace(
            name=f.name, kind=rest.KEYWORD_ONLY, default=None,
            annotation=f"{f.type.removesuffix(' | None')} | None",
        )
        for f in fields(Output)
    ]  # fmt: skip
    vars(write)["__signature__"] = own.replace(parameters=[*given, *options])
    # Without docstrings, as under python -OO, there is nothing to join.
    page, fields_of = inspect.getdoc(write) or "", inspect.getdoc(Output) or "----------\n"
    listed = fields_of.split("----------\n", 1)[1].split("\n\nExamples")[0]
    write.__doc__ = page.replace("**output\n    The fields of :class:`Output`.", listed)
    return write
