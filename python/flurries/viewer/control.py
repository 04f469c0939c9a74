"""What a page shows for one number, choice or color of a scene, and what it may send back."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal, TypeAlias

from flurries._contract import choice, real
from flurries.io.color import parse_hex

Kind: TypeAlias = Literal["slider", "choice", "color"]


@dataclass(frozen=True)
class Control:
    """One row of the page; a slider's range is in its unit, a color may be one of the choices."""

    key: str  # Place of the effect and field ("0.amount"), or "camera.forward", or "eyes".
    group: str
    label: str
    unit: str = ""
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    value: float | str = 0.0  # Where it stands now: a number, one of `choices`, or "#rrggbb".
    kind: Kind = "slider"
    choices: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        return asdict(self)

    def checked(self, value: Any) -> Any:
        """Return a value that came from a page, if it is one that this row can have."""
        name = f"values[{self.key!r}]"
        if self.kind == "slider":
            return real(name, value, low=self.low, high=self.high)
        if self.kind == "color" and isinstance(value, str) and value.startswith("#"):
            parse_hex(name, value)
            return value
        return choice(name, value, self.choices)


def choice_of(key: str, group: str, label: str, choices: tuple[str, ...], value: str) -> Control:
    return Control(key, group, label, value=value, kind="choice", choices=choices)


def color_of(key: str, group: str, label: str, value: str, words: tuple[str, ...] = ()) -> Control:
    """Return a color, or one of some words that stand for one."""
    return Control(key, group, label, value=value, kind="color", choices=words)


def hex_of(parts: Any) -> str:
    """Return "#rrggbb" of three display values, 0 to 1."""
    return "#" + "".join(f"{round(255 * min(max(float(part), 0.0), 1.0)):02x}" for part in parts)
