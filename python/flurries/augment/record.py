"""What a weather for data sets is told, what is drawn from that, and the record of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import partial
from typing import Any, ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, choice, int64, mapping, real
from flurries._kept import kept
from flurries.augment.air import Air, View
from flurries.augment.calibration import PROFILES, Kind, Profile, strength
from flurries.augment.distance import Ground, ground_of
from flurries.augment.draws import Range, between, own_index, range_of, uniforms
from flurries.augment.pictures import picture_of
from flurries.camera.lens import Camera
from flurries.effects.strength import Strength

VERSION = 3
SEVERITY = (1, 5)
DEFAULT_AMOUNT = (0.2, 0.8)

_Kind = TypeVar("_Kind", bound="Recorded")


@dataclass(frozen=True, kw_only=True, repr=False)
class Recorded(ABC):
    """The fields of a weather, which are described in the weathers themselves."""

    amount: Range | None = None
    severity: int | tuple[int, int] | None = None
    profile: Profile = "natural"
    color: Range | tuple[float, float, float] = (0.9, 1.0)
    ground: Ground | None = None
    focal: float = 1.2
    white: float = 1.0
    seed: int | None = None
    weather_seed: int | None = None

    # Numbers that are drawn, in the order of their random numbers: (name, limits).
    DRAWN: ClassVar[tuple[str, ...]] = ()
    WEATHER: ClassVar[Kind]

    def __post_init__(self) -> None:
        settle = partial(object.__setattr__, self)
        if self.amount is not None and self.severity is not None:
            raise ValueError("amount and severity must not both be given")
        if self.severity is not None:
            low, high = range_of("severity", self.severity, low=SEVERITY[0], high=SEVERITY[1])
            if low != int(low) or high != int(high):
                raise TypeError(f"severity must be an integer or two, got {self.severity!r}")
            settle("severity", (int(low), int(high)))
        settle("profile", choice("profile", self.profile, PROFILES))
        if self.amount is not None:
            settle("amount", range_of("amount", self.amount, low=0.0, high=1.0))
        if isinstance(self.color, (tuple, list, np.ndarray)) and len(self.color) == 3:
            settle("color", tuple(real("color", c, low=0.0, high=1.0) for c in self.color))
        else:
            settle("color", range_of("color", self.color, low=0.0, high=1.0))
        settle("ground", ground_of(self.ground))
        settle("focal", real("focal", self.focal, low=0.05, high=1e3))
        settle("white", real("white", self.white, low=1e-30, high=1e30))
        for name in ("seed", "weather_seed"):
            if getattr(self, name) is not None:
                settle(name, int64(name, getattr(self, name)))

    def strength(self) -> tuple[Strength, Strength]:
        """Return how strong the weakest and the strongest weather are that are drawn.

        Returns
        -------
        two flurries.Strength
            Before a sky; of the hard profile with the depths of a picture of 512 px.
        """
        ends = self.severity and [level / SEVERITY[1] for level in self.severity]  # type: ignore[union-attr]
        low, high = ends or self.amount or DEFAULT_AMOUNT  # type: ignore[misc]
        own = self.profile, self.WEATHER, self.focal
        return strength(low, *own), strength(high, *own)

    def __repr__(self) -> str:
        values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields(self))
        said = " to ".join(dict.fromkeys(map(str, self.strength())))
        return f"{type(self).__name__}({values})  # {said}"

    def record(self, image: npt.ArrayLike | None = None, *, index: int | None = None) -> Any:
        """Return the draws of a call, as plain numbers and words.

        Parameters
        ----------
        image : array, optional
            Needed where the index comes from the picture itself.
        index : int, optional
            As for a call.

        Returns
        -------
        dict
            For :func:`flurries.augment.replay`; holds in JSON.
        """
        if index is None and self.seed is None and self.weather_seed is None:
            raise ValueError("index must be given: without it and a seed each call draws anew")
        if index is None and image is None:
            raise ValueError("index or image must be given")
        return self._drawn(None if image is None else picture_of("image", image), index)

    @classmethod
    def replay(cls: type[_Kind], record: Mapping[str, Any]) -> _Kind:
        """Return the weather that makes what was recorded, whatever the index."""
        values = dict(mapping("record", record))
        kind, version = values.pop("transform", None), values.pop("version", None)
        if kind != cls.__name__ or version != VERSION:
            raise ValueError(
                f"record must be of a {cls.__name__}, version {VERSION}, got {kind!r}, {version!r}"
            )
        ground = values.pop("ground", None)
        known = {f.name for f in fields(cls)} - {"severity", "seed", "ground"}
        if set(values) != known:
            odd = sorted(set(values) ^ known)
            raise ValueError(f"record must hold {sorted(known)}, differs in {odd}")
        values["color"] = tuple(values["color"])
        return cls(ground=ground, **values)

    def _drawn(self, image: Array | None, index: int | None) -> dict[str, Any]:
        """Return the record of a call."""
        if index is not None:
            number = int64("index", index)
        elif self.seed is None and self.weather_seed is not None:
            number = 0
        else:
            assert image is not None
            number = own_index(self.seed, image)
        u = uniforms(self.seed or 0, number, 4 + len(self.DRAWN))
        if self.severity is not None:
            low, high = self.severity  # type: ignore[misc]
            amount = (low + int(u[1] * (high - low + 1))) / SEVERITY[1]
        else:
            amount = between(self.amount or DEFAULT_AMOUNT, u[1])
        if len(self.color) == 3:  # type: ignore[arg-type]
            color: Any = self.color
        else:
            color = (between(self.color, u[2]),) * 3
        own = self.weather_seed
        record: dict[str, Any] = {
            "transform": type(self).__name__,
            "version": VERSION,
            "amount": amount,
            "profile": self.profile,
            "color": color,
            "ground": None if self.ground is None else asdict(self.ground),
            "focal": self.focal,
            "white": self.white,
            "weather_seed": int(u[0] * 2**53) if own is None else own,
        }
        for slot, name in enumerate(self.DRAWN):
            record[name] = between(getattr(self, name), u[4 + slot])
        return record

    @abstractmethod
    def _air(self, record: dict[str, Any]) -> Air:
        """Return the air that a record describes."""


@kept(32)
def view_of(shape: tuple[int, int], focal: float, aside: float = 0.0, eyes: float = 0.0) -> View:
    return View(shape, Camera(focal * max(shape), offset=(aside, 0.0, 0.0)), eyes)
