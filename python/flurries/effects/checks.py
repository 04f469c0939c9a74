"""What the fields of effects may be, by their names, and one number in place of many."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from functools import partial, wraps
from typing import Any, Literal, TypeAlias, TypeVar

from flurries._contract import choice, flag, integer, real, seed_of, suggesting, vector
from flurries.effects.color import as_color
from flurries.motion.keys import as_number, as_vector
from flurries.motion.wind import Wind
from flurries.spectral.tables import Aliasing, band_of
from flurries.spectral.tiles import Blend

_Kind = TypeVar("_Kind")

LOOKS = ("v1",)  # Versions of the looks of tents, cones and mist.
Check = Callable[[str, Any], Any]  # From a field's name and value to the value as it is kept.

DepthMode: TypeAlias = Literal["tile", "pixel"]

share: Check = partial(as_number, low=0.0, high=1.0)
positive: Check = partial(as_number, above=0.0)
length: Check = partial(real, above=0.0)
part: Check = partial(real, low=0.0, high=1.0)
count: Check = partial(integer, low=0, high=100_000)
_number: Check = partial(integer, low=0, high=100_000_000)
_density: Check = partial(real, low=0.0, high=1e6)


def one_of(options: Any) -> Check:
    return lambda name, value: choice(name, value, options)


def sizes(name: str, value: object) -> tuple[float, float]:
    low, high = vector(name, value, 2).tolist()
    if not 0.0 < low <= high:
        raise ValueError(f"{name} must be 0 < smallest <= largest, got {(low, high)}")
    return low, high


def _wavelengths(name: str, value: object) -> tuple[float, float]:
    low, high = band_of(value)
    if not 2.0 <= low < high:
        raise ValueError(f"{name} must be 2 <= shortest < longest, got {(low, high)}")
    return low, high


# What effects mean by the same names; a field whose default is None may be None.
CHECKS: dict[str, Check] = {
    "look": one_of(LOOKS), "amount": share, "haze": share, "fall": as_number,
    "wind": lambda name, value: value if isinstance(value, Wind) else as_vector(name, value, 3),
    "color": lambda _, value: as_color(value), "seed": lambda _, value: seed_of(value),
    # In frames: an angle of 180 degrees, which is half a frame, is none.
    "shutter": partial(as_number, low=0.0, high=16.0),
    "sway": lambda name, value: tuple(vector(name, value, 2).tolist()),
    "gain": partial(real, low=0.0, high=1e4), "near": length, "radius": length,
    # Of what is drawn one by one.
    "flakes": _number, "flake_density": _density, "flake_size": sizes, "flake_opacity": share,
    "drops": _number, "drop_density": _density, "drop_size": sizes, "drop_depth": length,
    # Of the tent's texture.
    "texture": share, "mean": as_number, "spread": positive, "power": positive,
    "exponent": real, "near_depth": length, "wavelengths": _wavelengths,
    "tile": partial(integer, low=5, high=2**15), "overlap": partial(integer, low=0, high=2**15),
    "blend": one_of(Blend), "alias": one_of(Aliasing), "jitter": flag, "renormalise": flag,
    "depth_mode": one_of(DepthMode),
}  # fmt: skip


def checks_of(kind: Any) -> Mapping[str, Check]:
    """Return the checks of a class of effects: those of all, but for its own."""
    return {**CHECKS, **getattr(kind, "CHECKS", {})}


def part_of(kind: type[_Kind], effect: Any, **own: Any) -> _Kind:
    """Return a part with the fields of an effect that have the same names, and `own` ones."""
    names = {f.name for f in fields(kind)} - set(own)  # type: ignore[arg-type]
    same = {name: getattr(effect, name) for name in names if hasattr(effect, name)}
    return kind(**same, **own)


def settle(effect: Any) -> None:
    """Check the fields of an effect, and keep them in one form."""
    checks = checks_of(type(effect))
    for field in fields(effect):
        value = getattr(effect, field.name)
        if field.name in checks and not (value is None and field.default is None):
            object.__setattr__(effect, field.name, checks[field.name](field.name, value))
    tile, overlap = getattr(effect, "tile", None), getattr(effect, "overlap", None)
    if tile is not None and overlap is not None and overlap >= tile:
        raise ValueError(f"overlap must be less than the tile ({tile} px), got {overlap}")
    # Its parts are made here, before threads ask for them.
    getattr(effect, "parts", None)


# Effects of other fields that a `method` of snow and rain chooses; `kinds` names them.
METHODS: dict[type, dict[str, type]] = {}

# What frames ask of an effect, and users do not.
INNER = {"CHECKS", "KNOBS", "MATTER", "NAME", "NATURAL", "OPTICS", "SIZES", "of_preset", "parts"}


class Described(type):
    """The class of effects: its `dir` has their fields and what users call."""

    def __dir__(cls) -> Iterable[str]:
        return [name for name in super().__dir__() if name[0] != "_" and name not in INNER]

    def of_preset(cls, name: str, changes: dict[str, Any]) -> dict[str, Any]:
        presets, knobs = cls.PRESETS, cls.KNOBS  # type: ignore[attr-defined]
        values = presets[choice("preset", name, tuple(presets))]
        if given := [knob for knob in knobs if changes.get(knob) is not None]:
            raise TypeError(f"{given[0]} and a preset set the same fields: give one of them")
        return {**values, **changes}


def effect(
    *knobs: str, law: Callable[[Any, dict[str, Any], dict[str, Any]], dict[str, Any]] | None = None
) -> Callable[[type[_Kind]], type[_Kind]]:
    """Let a dataclass take the name of one of its ``PRESETS``, and knobs: they set fields."""
    # The law goes from the class, the knobs and the other arguments to those fields.

    def made(kind: Any) -> Any:
        plain, described = suggesting(kind).__init__, kind.__repr__

        @wraps(plain)
        def init(self: Any, *others: Any, preset: str | None = None, **given: Any) -> None:
            if len(others) > 1 or (others and preset is not None):
                raise TypeError(f"{kind.__name__} takes one preset and its fields by name")
            for name in {*others, preset} - {None}:
                given = kind.of_preset(name, given)
            turned = {name: value for name in knobs if (value := given.pop(name, None)) is not None}
            if turned and {f.name for f in fields(kind)} <= set(given):
                raise TypeError(
                    f"{next(iter(turned))} sets fields of a new effect, {kind.__name__}(...); in a "
                    "copy all of them are given"
                )
            plain(self, **{**given, **(law(kind, turned, given) if law and turned else {})})

        @wraps(plain)
        def new(cls: Any, *others: Any, method: Any = None, **given: Any) -> Any:
            # Of what another class makes Python calls no `__init__` of this one.
            other = METHODS.get(cls, {}).get(method) if isinstance(method, str) else None
            return other(*others, **given) if other else object.__new__(cls)

        def shown(self: Any) -> str:
            strength = f"  # {self.strength()}" if hasattr(self, "strength") else ""
            return f"{described(self)}{strength}"

        kind.__init__, kind.__new__, kind.__repr__, kind.KNOBS = init, new, shown, knobs
        return kind

    return made
