"""What a weather is told, what is drawn from that, purely by seed and index, and the record."""

from __future__ import annotations

import secrets
import zlib
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, choice, int64, real, uniforms
from flurries.augment.calibration import PROFILES, Kind, Profile, strength
from flurries.augment.distance import Ground, ground_of
from flurries.augment.pictures import picture_of
from flurries.effects.strength import SEVERITIES, Strength

Range: TypeAlias = float | tuple[float, float]
Limits: TypeAlias = tuple[float, float]

VERSION = 3
DEFAULT_AMOUNT = (0.2, 0.8)

# Limits of numbers that are drawn, in the order of their random numbers; and of those that are not.
DRAWN: dict[str, Limits] = {
    "patches": (0.0, 1.0), "wind": (-100.0, 100.0), "fall": (-100.0, 100.0),
    "exposure": (0.0, 10.0), "shade": (0.0, 1e5), "drops": (0.0, 1e4),
}  # fmt: skip
_FIXED = {"focal": (0.05, 1e3), "white": (1e-30, 1e30), "veil": (0.0, 1.0)}

# Samples of a picture that its own index is taken from.
_SAMPLES = 4096


@dataclass(frozen=True, kw_only=True, repr=False)
class Recorded:
    """The fields of a weather, which are described in the weathers themselves."""

    amount: Range | None = None
    severity: int | tuple[int, int] | None = None
    profile: Profile = "natural"
    color: Range | tuple[float, float, float] = (0.9, 1.0)
    ground: Ground | None = None
    focal: float = 1.2
    white: float = 1.0
    shade: Range = 0.0
    drops: Range = 0.0
    seed: int | None = None
    weather_seed: int | None = None

    WEATHER: ClassVar[Kind]

    def __post_init__(self) -> None:
        own = vars(self)  # In which a frozen class can be settled.
        if self.amount is not None and self.severity is not None:
            raise ValueError("amount and severity must not both be given")
        own["profile"] = choice("profile", self.profile, PROFILES)
        own["ground"] = ground_of(self.ground)
        if isinstance(self.color, (tuple, list, np.ndarray)) and len(self.color) == 3:
            own["color"] = tuple(real("color", c, low=0.0, high=1.0) for c in self.color)
        else:
            own["color"] = range_of("color", self.color, (0.0, 1.0))
        if self.amount is not None:
            own["amount"] = range_of("amount", self.amount, (0.0, 1.0))
        if self.severity is not None:
            levels = range_of("severity", self.severity, (1, SEVERITIES))
            if any(level != int(level) for level in levels):
                raise TypeError(f"severity must be an integer or two, got {self.severity!r}")
            own["severity"] = tuple(map(int, levels))
        own |= {n: range_of(n, own[n], ends) for n, ends in DRAWN.items() if n in own}
        own |= {n: real(n, own[n], low=a, high=b) for n, (a, b) in _FIXED.items() if n in own}
        own |= {n: int64(n, own[n]) for n in ("seed", "weather_seed") if own[n] is not None}

    def strength(self) -> tuple[Strength, Strength]:
        """Return the weakest and strongest weather drawn: before a sky, if hard of 512 px."""
        ends = self.severity and [level / SEVERITIES for level in self.severity]  # type: ignore[union-attr]
        low, high = ends or self.amount or DEFAULT_AMOUNT  # type: ignore[misc]
        own = self.profile, self.WEATHER, self.focal
        return strength(low, *own), strength(high, *own)

    def __repr__(self) -> str:
        values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self))
        said = " to ".join(dict.fromkeys(map(str, self.strength())))
        return f"{type(self).__name__}({values})  # {said}"

    def record(self, image: npt.ArrayLike | None = None, *, index: int | None = None) -> Any:
        """Return the draws of a call as plain numbers and words, for `replay`; holds in JSON.

        Parameters
        ----------
        image : array, optional
            Needed where the index comes from the picture itself.
        index : int, optional
            As for a call.
        """
        if index is None and self.seed is None and self.weather_seed is None:
            raise ValueError("index must be given: without it and a seed each call draws anew")
        if index is None and image is None:
            raise ValueError("index or image must be given")
        return self._drawn(None if image is None else picture_of("image", image), index)

    def _drawn(self, image: Array | None, index: int | None) -> dict[str, Any]:
        """Return the record of a call."""
        if index is not None:
            number = int64("index", index)
        elif self.seed is None and self.weather_seed is not None:
            number = 0
        else:
            assert image is not None
            # The system's numbers are never shared by forked workers.
            number = secrets.randbits(62) if self.seed is None else _index_of(image)
        drawn = [name for name in DRAWN if name in vars(self)]
        u = uniforms(self.seed or 0, number, 4 + len(drawn)).tolist()
        record = {"transform": type(self).__name__, "version": VERSION, **vars(self)}
        del record["severity"], record["seed"]
        if self.weather_seed is None:
            record["weather_seed"] = int(u[0] * 2**53)
        if self.severity is not None:
            low, high = self.severity  # type: ignore[misc]
            record["amount"] = (low + int(u[1] * (high - low + 1))) / SEVERITIES
        else:
            record["amount"] = between(self.amount or DEFAULT_AMOUNT, u[1])
        if len(self.color) == 2:  # type: ignore[arg-type]
            record["color"] = (between(self.color, u[2]),) * 3
        if self.ground is not None:
            record["ground"] = asdict(self.ground)
        for name, share in zip(drawn, u[4:], strict=True):
            record[name] = between(record[name], share)
        return record


def range_of(name: str, value: object, limits: Limits) -> Limits:
    """Return (low, high) of a number or of a pair, within limits."""
    ends = value if isinstance(value, (tuple, list, np.ndarray)) else (value, value)
    if len(ends) != 2:
        raise ValueError(f"{name} must be a number or (low, high), got {value!r}")
    first, last = (real(name, end, low=limits[0], high=limits[1]) for end in ends)
    if first > last:
        raise ValueError(f"{name} must be (low, high) with low <= high, got {(first, last)}")
    return first, last


def between(limits: Any, u: float) -> float:
    """Return the number at a share of a range."""
    low, high = limits
    return float(low + (high - low) * u)


def _index_of(image: Array) -> int:
    """Return an index that is a picture's own."""
    values = image.reshape(-1) if image.flags.c_contiguous else np.ravel(image)
    content = np.ascontiguousarray(values[:: max(values.size // _SAMPLES, 1)]).tobytes()
    head = zlib.crc32(repr((image.shape, image.dtype.name)).encode())
    return (zlib.crc32(content, head) & 0x7FFF_FFFF) << 32 | zlib.adler32(content, head)
