"""Color spaces by their names, through OpenColorIO: ``$OCIO`` or the one built into it."""

from __future__ import annotations

import difflib
import hashlib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries._kept import kept
from flurries.io.color import to_unit, unmultiply
from flurries.io.oiio import last_error, openimageio

# What configurations call linear light of Rec. 709's primaries, in which the weather's colors are.
_REC709 = (
    "Linear Rec.709 (sRGB)", "lin_rec709_scene", "lin_rec709", "lin_srgb",
    "scene-linear Rec.709-sRGB", "Utility - Linear - sRGB", "Utility - Linear - Rec.709",
)  # fmt: skip
_WORKING = "scene_linear"


@dataclass(frozen=True)
class ColorSpace:
    """A color space of the configuration."""

    name: str  # Its name there.
    linear: bool  # Whether its numbers are in proportion to light.

    @staticmethod
    def of(argument: str, name: object) -> ColorSpace:
        if not isinstance(name, str):
            raise TypeError(f"{argument} must be the name of a color space, got {name!r}")
        config = _config(os.environ.get("OCIO", ""))
        if not 0 < len(name) <= 200 or config.getColorSpaceIndex(name) < 0:
            known = list(config.getColorSpaceNames())
            near = difflib.get_close_matches(name[:200], known, n=3, cutoff=0.4) or known[:6]
            raise ValueError(
                f"{argument} must be a color space of $OCIO or the built-in configuration, such as "
                f"{', '.join(map(repr, near))}; got {name!r:.60}"
            )
        own = str(config.resolve(name))
        return ColorSpace(own, bool(config.isColorSpaceLinear(own)))

    @property
    def working(self) -> ColorSpace:
        """The space in which layers are mixed over a picture: this one if it is linear."""
        return self if self.linear else ColorSpace.of("the role scene_linear of $OCIO", _WORKING)

    def convert(self, pixels: Array, target: ColorSpace) -> Array:
        """Return colors (H, W, 3) of this space in another one, float32."""
        light = np.ascontiguousarray(pixels, np.float32)
        if target.name == self.name:
            return light
        library = openimageio()
        buffer = library.ImageBuf(light)
        made = library.ImageBufAlgo.colorconvert(
            buffer, self.name, target.name, False, "", "", os.environ.get("OCIO", "")
        )
        if made.has_error:
            raise ValueError(f"{self.name} cannot be turned into {target.name}: {last_error(made)}")
        return np.asarray(made.get_pixels("float"), np.float32).reshape(light.shape)

    def convert_rgba(self, pixels: Array, target: ColorSpace) -> Array:
        """Return premultiplied float colors (H, W, 3 or 4) of this space in another one."""
        if pixels.shape[2] == 3 or target.name == self.name:
            return self.convert(pixels, target)
        cover = np.asarray(pixels[..., 3:], np.float32)
        colors = self.convert(unmultiply(np.asarray(pixels[..., :3], np.float32), cover), target)
        return np.concatenate([colors * cover, cover], axis=2)

    def decode(self, pixels: Array) -> Array:
        """Return a picture of this space as premultiplied light of its working space."""
        unit = np.asarray(to_unit(pixels), np.float32)
        if pixels.shape[2] == 4 and pixels.dtype.kind == "u":
            unit = np.concatenate([unit[..., :3] * unit[..., 3:], unit[..., 3:]], axis=2)
        return self.convert_rgba(unit, self.working)

    def from_rec709(self) -> Array:
        """Return M (3, 3): linear light c of Rec. 709's primaries is c @ M in this linear space."""
        turned = _rec709().convert(np.eye(3, dtype=np.float32)[None], self)
        return np.asarray(turned[0], np.float64)

    @property
    def video(self) -> tuple[str, str]:
        """What a DPX calls the curve of such numbers, and their primaries."""
        light = np.concatenate([np.eye(3), 0.045 * 2.0 ** np.arange(-1, 4)[:, None] * np.ones(3)])
        light[3] = 0.0
        seen = _rec709().convert(light[None], self)[0]
        # Where each doubling of the light is one step, it is a logarithm.
        steps = np.diff(seen[4:, 1])
        curve = "Logarithmic" if np.ptp(steps) < 0.02 * steps.mean() else "Unspecified video"
        alike = np.abs(seen[:3] - seen[3])[~np.eye(3, dtype=bool)].max() < 1e-4
        return "Linear" if self.linear else curve, "ITU-R 709-4" if alike else "User defined"


def _rec709() -> ColorSpace:
    config = _config(os.environ.get("OCIO", ""))
    name = next((one for one in _REC709 if config.getColorSpaceIndex(one) >= 0), None)
    if name is None:
        raise ValueError(
            f"$OCIO has no linear space of Rec. 709's primaries ({', '.join(_REC709[:4])}), in "
            "which the weather's colors are"
        )
    return ColorSpace.of("colorspace", name)


def config_hash() -> str:
    """Return a hash of what $OCIO holds: its file and the tables that it names."""
    path = Path(os.environ.get("OCIO", ""))
    if not path.is_file():
        return hashlib.sha256(f"{path} {openimageio().VERSION_STRING}".encode()).hexdigest()
    data = path.read_bytes()
    digest = hashlib.sha256(data)
    # Tables may also lie where its search path says.
    paths = re.findall(r"^ *(?:search_path: *|- )(.+)$", data.decode(errors="replace"), re.M)
    words = {word.strip(" []\"'") for line in paths for word in re.split("[:,]", line)}
    for name in sorted(set(re.findall(rb"src: *\"?([^,}\"\n]+)", data))):
        wanted = name.decode(errors="replace").strip()
        found = {*path.parent.rglob(Path(wanted).name)}
        found |= {path.parent / word / wanted for word in words}
        for table in sorted(filter(Path.is_file, found)):
            digest.update(table.read_bytes())
    return digest.hexdigest()


@kept(4)
def _config(path: str) -> Any:
    config = openimageio().ColorConfig(path)
    if words := config.geterror():
        raise ValueError(f"$OCIO cannot be read: {words}")
    return config
