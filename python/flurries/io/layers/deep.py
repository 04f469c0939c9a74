"""Deep EXR files: any number of samples in each pixel, with depths, a color and an opacity."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import rectangular
from flurries.io.atomic import replacing
from flurries.io.color import Array
from flurries.io.files import given
from flurries.io.layers.planes import require_exr
from flurries.io.oiio import openimageio
from flurries.io.pictures.header import opened_picture
from flurries.io.pictures.parts import output_of, unwritten
from flurries.io.pictures.reader import samples_of
from flurries.io.pictures.slate import Slate, checked_metadata

CHANNELS = ("R", "G", "B", "A", "Z", "ZBack")

# Rows that are handed over together.
_ROWS = 16


@dataclass(frozen=True, eq=False)
class Deep:
    """The samples of a deep picture."""

    counts: Array  # (H, W): samples of each pixel.
    # (N, 6): CHANNELS, pixel after pixel, nearest sample first; colors are light times opacity.
    values: Array

    def __post_init__(self) -> None:
        counts = rectangular("counts", self.counts)
        if counts.ndim != 2 or counts.dtype.kind not in "iu" or bool((counts < 0).any()):
            raise ValueError(f"counts must be (H, W) numbers of samples, got {self.counts!r:.80}")
        values, wanted = rectangular("values", self.values), (int(counts.sum()), len(CHANNELS))
        if values.shape != wanted or values.dtype.kind != "f":
            raise ValueError(f"values must be floats of shape {wanted}, got {self.values!r:.80}")
        object.__setattr__(self, "counts", counts.astype(np.int64))
        object.__setattr__(self, "values", values.astype(np.float32))


def write_deep(
    path: str | os.PathLike[str], deep: Deep, *, half: bool = True,
    metadata: Mapping[str, object] | None = None, slate: Slate | None = None,
) -> None:  # fmt: skip
    """Write samples into a deep EXR; large pictures take long, number by number."""
    require_exr(path, "deep samples")
    if not isinstance(deep, Deep):
        raise TypeError(f"deep must be a Deep, got {deep!r:.80}")
    strings, said = checked_metadata(metadata), given("slate", slate, Slate)
    library, target = openimageio(), os.fspath(path)
    height, width = deep.counts.shape
    kinds = [library.TypeDesc("half" if half else "float")] * 4 + [library.TypeDesc("float")] * 2
    specification = library.ImageSpec(width, height, len(CHANNELS), "float")
    specification.channelnames, specification.channelformats = CHANNELS, tuple(kinds)
    specification.alpha_channel, specification.z_channel = 3, 4
    specification.deep = True
    said.put(specification, "openexr", "linear", strings)
    specification.attribute("compression", "zips")
    starts = np.concatenate([[0], np.cumsum(deep.counts.sum(axis=1))])
    with replacing(path) as temporary:
        with output_of(target, temporary, [specification]) as output:
            for top in range(0, height, _ROWS):
                last = min(top + _ROWS, height)
                values = deep.values[starts[top] : starts[last]]
                band = _band(library, kinds, deep.counts[top:last], values)
                rows = specification.y + top, specification.y + last
                if not output.write_deep_scanlines(*rows, 0, band):
                    raise unwritten(target, output)
        with opened_picture(temporary, deep=True) as opened:
            there, _ = samples_of(opened, [])
        if not np.array_equal(there, deep.counts):
            raise OSError(f"{target}: does not read back as what was written")


def read_deep(path: str | os.PathLike[str]) -> Deep:
    """Return the samples of a deep EXR, the inverse of `write_deep`."""
    with opened_picture(path, deep=True) as opened:
        names = opened.specification.channelnames
        if not opened.specification.deep or not set(CHANNELS) <= set(names):
            raise ValueError(f"{opened.path}: holds no deep samples of {', '.join(CHANNELS)}")
        return Deep(*samples_of(opened, [names.index(name) for name in CHANNELS]))


def _band(library: Any, kinds: list[Any], counts: Array, values: Array) -> Any:
    data = library.DeepData()
    data.init(counts.size, len(CHANNELS), kinds, list(CHANNELS))
    flat = counts.ravel().tolist()
    for pixel, count in enumerate(flat):
        if count:
            data.set_samples(pixel, count)
    put, rows = data.set_deep_value, iter(values.tolist())
    for pixel, count in enumerate(flat):
        for sample in range(count):
            for channel, value in enumerate(next(rows)):
                put(pixel, channel, sample, value)
    return data
