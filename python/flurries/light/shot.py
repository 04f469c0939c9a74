"""The light of a shot: what its sky and ground shed on the weather, one for all frames."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from flurries._contract import Array, Float64, suggesting
from flurries.light.lamp import as_light
from flurries.motion.keys import Keys

# What pictures reflect on average, the grey of exposure meters; and fresh snow.
_GREY, _SNOW = 0.18, 0.9
# The share of places that are darker than the shot's white.
_SKY = 0.98
# That white over the mean, for what is all card and what is all picture.
_CARD = 1.02, 1.1
# The range of the channels of snow's light at most, in parts of their mean: in photographs flakes
# are within 17 of 255, and those that let light through have some of it from what is behind them.
_TINT = 0.01
# What the most saturated color counts for the tint, so that a picture of one color has one.
_LEAST = 1e-6

# Of what is outside the picture the upper half shines as the picture's brighter part does, the sky
# where there is one, without lamps, which are small; the lower half as its darker part, the ground.
_BRIGHTER = (0.75, 0.98)
_DARKER = 0.5


@suggesting
@dataclass(frozen=True)
class Light:
    """The light of a shot, the same for all of its frames and for whoever makes one of them.

    A scene without it finds it in nine frames of its background. `flurries light` prints and saves
    it, and :func:`flurries.scene.find_light` returns it.

    Parameters
    ----------
    snow : float or (r, g, b)
        Radiance of white snow: linear light, 1 for the white of a picture of integers, without an
        upper end. Effects whose color is "ambient" have it. Keyed where the sky itself changes.
    sky, ground : float or (r, g, b), optional
        Light from above, outside the picture, for mist and "local", and from below; `snow` / 0.9
        and 0.18 of `sky` if not given. Keyed.

    Examples
    --------
    >>> import flurries as fl
    >>> dusk = fl.scene.Light(snow=fl.Keys([(1, (0.5, 0.5, 0.52)), (240, (0.1, 0.1, 0.12))]))
    >>> scene = fl.Scene("#304050", size=(96, 64), effects=[fl.Snow()], light=dusk)
    """

    snow: Any
    sky: Any = None
    ground: Any = None

    def __post_init__(self) -> None:
        for part in fields(self):
            given = getattr(self, part.name)
            if given is not None or part.name == "snow":
                object.__setattr__(self, part.name, as_light(part.name, given))

    def at(self, t: float) -> tuple[Float64, Float64, Float64]:
        """Return the light of snow, sky and ground at `t`, each (3,) and linear."""

        def now(part: Any) -> Float64:
            return np.resize(part.value(t) if isinstance(part, Keys) else part, 3).astype(float)

        sky = now(self.snow) / _SNOW if self.sky is None else now(self.sky)
        return now(self.snow), sky, _GREY * sky if self.ground is None else now(self.ground)


def light_of(frames: Mapping[int, Array], *, keyed: bool = False) -> Light:
    """Return the light of a shot out of sums of `cell_sums` of some of its frames, by number."""
    # It goes with the exposure, and has no end at 1. With `keyed` each of the frames has a key: the
    # light times what the shot's sky has in it, over what it has in the middle.
    sums = [*frames.values()]
    # What is there in less than half of the frames, such as a lamp that enters, is no light of all.
    halves = slice((len(sums) - 1) // 2, len(sums) // 2 + 1)
    middle = np.sort(sums, axis=0)[halves].mean(axis=0) if sums else np.zeros((1, 1, 4))
    cells = cells_of(middle)
    places = cells.reshape(-1, 3)
    bright = places.sum(axis=1)
    half, low, high = (_quantile(bright, share) for share in (_DARKER, *_BRIGHTER))
    white, tint = _white(middle)
    sky = places[(bright >= low) & (bright <= high)].mean()
    sides = {"snow": white, "sky": sky * tint, "ground": places[bright <= half].mean() * tint}
    if not (keyed and frames):
        return Light(**{name: tuple(part.tolist()) for name, part in sides.items()})
    there = (bright >= low) & (bright > 0.0)
    own = [cells_of(one).reshape(-1, 3)[there].sum(axis=1) / bright[there] for one in sums]
    shares = [_quantile(one, 0.5) for one in own]
    pairs = [*zip(frames, shares, strict=True)]
    return Light(**{
        name: Keys([(number, tuple((share * part).tolist())) for number, share in pairs])
        for name, part in sides.items()
    })  # fmt: skip


def _quantile(values: Array, share: float) -> float:
    # The bits of `np.quantile`, which imports masked arrays: that takes longer than all of this.
    first, part = divmod(share * (values.size - 1), 1.0)
    low, high = np.sort(values)[[int(first), min(int(first) + 1, values.size - 1)]].tolist()
    found: float = high - (high - low) * (1.0 - part) if part >= 0.5 else low + (high - low) * part
    return found


def cells_of(sums: Array) -> Float64:
    """Return the light of cells, (rows, columns, 3); transparent ones count as far as they show."""
    cover = sums[..., 3:].astype(np.float64)
    light = np.maximum(sums[..., :3].astype(np.float64), 0.0)
    if not cover.any() or not light.any():
        # Black is no picture: what is laid over it is meant for one later.
        return np.ones_like(light)
    mean = light.sum(axis=(0, 1)) / max(float(cover.sum()), 1e-12)
    # A cell of which nothing shows has the light of the rest.
    return np.where(cover > 0.0, light / np.maximum(cover, 1e-12), mean)


def _white(sums: Array) -> tuple[Float64, Float64]:
    """Return the light of white snow and the tint of the sky, (3,) of mean 1."""
    sums = np.maximum(sums.reshape(-1, 4), 0.0).astype(np.float64)
    sums = sums[sums[:, 3] > 0.0]
    light = sums[:, :3] / sums[:, 3:]
    if not light.any():
        # A black picture is none, and what is laid over it is white.
        return np.ones(3), np.ones(3)
    bright = light.mean(axis=1)
    sky, mean = _quantile(bright, _SKY), float(bright.mean())
    # A card has no sky: it is taken as what reflects as much as pictures do.
    card = float(np.interp(sky / max(mean, np.finfo(np.float32).tiny), _CARD, (1.0, 0.0)))
    white = _SNOW * (sky + card * (mean / _GREY - sky))
    # A bright place counts for the tint by its least channel over its largest: coats light nothing.
    there = bright >= _quantile(bright, _BRIGHTER[0])
    grey = light.min(axis=1) / np.maximum(light.max(axis=1), np.finfo(np.float32).tiny)
    tint = (grey[there] + _LEAST) @ light[there]
    tint /= tint.mean()
    snow = 1.0 + (tint - 1.0) * min(_TINT / max(float(np.ptp(tint)), 1e-12), 1.0)
    return np.asarray(white * snow / max(float(snow.max()), 1.0)), np.asarray(tint)
