"""Looks by name, tuned by eye on dark, bright and busy photographs (docs/looks.md)."""

from typing import Any, Literal, TypeAlias

SnowLook: TypeAlias = Literal[
    "light", "moderate", "heavy", "blizzard", "sleet", "big flakes", "night flurry"
]
SNOW_LOOKS: dict[str, dict[str, Any]] = {
    "light": {"density": 12.0, "flake_size": (0.003, 0.006, 0.018)},
    "moderate": {},
    "heavy": {"density": 90.0, "flake_size": (0.003, 0.008, 0.025), "wind": (0.5, 0.0, 0.0),
        "clumps": 0.4},
    "blizzard": {"density": 300.0, "flake_size": (0.002, 0.005, 0.016), "wind": (6.0, 0.0, 0.0),
        "clumps": 0.7},
    # Half melted: small, fast and glassy.
    "sleet": {"density": 300.0, "flake_size": (0.001, 0.0035, 0.01), "opacity": 0.7, "fall": 4.0,
        "wind": (1.5, 0.0, 0.0), "sway": (0.0, 0.0)},
    "big flakes": {"density": 6.0, "flake_size": (0.008, 0.018, 0.045), "wind": (0.15, 0.0, 0.0),
        "sway": (0.05, 2.5)},
    "night flurry": {"density": 16.0, "flake_size": (0.002, 0.006, 0.016), "wind": (0.6, 0.0, 0.0)},
}  # fmt: skip

RainLook: TypeAlias = Literal["drizzle", "rain", "downpour"]
RAIN_LOOKS: dict[str, dict[str, Any]] = {
    "drizzle": {"density": 500.0, "drop_size": (0.0004, 0.0006, 0.003), "wind": (0.3, 0.0, 0.0)},
    "rain": {},
    "downpour": {"density": 1500.0, "drop_size": (0.0005, 0.0012, 0.006)},
}

TentSnowLook: TypeAlias = Literal["light", "moderate", "heavy", "blizzard", "paper"]
TENT_SNOW: dict[str, dict[str, Any]] = {
    "light": {"texture": 0.8, "mean": -0.12, "haze": 0.0, "flakes": 2500, "fall": 1.2,
        "wind": (0.31, 0.0, 0.0)},
    "moderate": {},
    "heavy": {"texture": 0.9, "mean": 0.12, "spread": 2.2, "exponent": 0.95, "haze": 0.1,
        "flakes": 20000, "flake_size": (0.008, 0.028), "fall": 1.6, "wind": (0.5, 0.0, 0.0)},
    "blizzard": {"texture": 0.85, "mean": 0.15, "spread": 2.2, "exponent": 0.9, "haze": 0.3,
        "shutter": 0.3, "flakes": 40000, "flake_size": (0.008, 0.03), "fall": 1.7,
        "wind": (3.0, 0.0, 0.0), "near_depth": 15.0},
    # Langer 2004: tiles of 64 px, band 4 to 32 px, 1/f, overlap 10 blended linearly, white 250.
    "paper": {"texture": 1.0, "mean": 0.5, "spread": 3.0, "power": 2.0, "exponent": 1.0,
        "wavelengths": (4.0, 32.0), "tile": 64, "overlap": 10, "blend": "linear", "alias": "cut",
        "color": 250 / 255, "haze": 0.0, "shutter": 0.0, "flakes": 2000},
}  # fmt: skip

TENT_RAIN: dict[str, dict[str, Any]] = {
    "drizzle": {"fall": 4.0, "wind": (0.28, 0.0, 0.0), "texture": 0.25, "mean": 0.1,
        "haze": 0.04, "drops": 1500, "gain": 25.0},
    "rain": {},
    "downpour": {"texture": 0.5, "mean": 0.3, "haze": 0.2, "drops": 12000},
}  # fmt: skip

CONE_RAIN: dict[str, dict[str, Any]] = {
    "drizzle": {"fall": 4.0, "wind": (0.28, 0.0, 0.0), "haze": 0.04, "drops": 500,
        "drop_size": 0.003, "drop_length": 0.03, "gain": 2.5},
    "rain": {},
    "downpour": {"haze": 0.2, "drops": 2200, "gain": 3.0},
}  # fmt: skip

ConeSnowLook: TypeAlias = Literal["light", "moderate", "heavy", "blizzard"]
CONE_SNOW: dict[str, dict[str, Any]] = {
    "light": {"fall": 1.2, "wind": (0.31, 0.0, 0.0), "haze": 0.0, "texture_flakes": 250,
        "flake_size": (0.006, 0.016), "flakes": 500},
    "moderate": {},
    "heavy": {"fall": 1.6, "wind": (0.5, 0.0, 0.0), "haze": 0.1, "texture_flakes": 5000,
        "flake_size": (0.008, 0.02), "flakes": 600},
    "blizzard": {"fall": 1.7, "wind": (3.0, 0.0, 0.0), "haze": 0.3, "shutter": 0.3,
        "texture_flakes": 9000, "flake_size": (0.008, 0.022), "flakes": 700},
}  # fmt: skip

MistLook: TypeAlias = Literal["mist", "fog", "clouds", "valley", "ground", "bank", "cumulus"]
# Johnson 2005, figures 14 to 16, in a box of 5 x 5 x 5.
PAPER_MIST: dict[str, dict[str, Any]] = {
    "clouds": {"count": 1500, "radius": 0.37, "density": 0.4, "color": 0.86},
    "mist": {"count": 1000, "radius": 0.45, "density": 0.15, "color": 0.6},
    "fog": {"count": 1200, "radius": 0.45, "density": 0.4, "color": 0.7},
}  # fmt: skip

# A valley's mist lies below a camera on its edge, the ground's about its feet; a bank drifts around
# it, clouds do in lumps with gaps between; a cumulus wants a `center`.
MIST: dict[str, dict[str, Any]] = {
    "mist": {"visibility": 300.0, "structure": 0.4, "wind": (0.5, 0.0, 0.0)},
    "fog": {"visibility": 100.0, "structure": 0.5, "wind": (0.5, 0.0, 0.0)},
    "clouds": {"visibility": 150.0, "structure": 1.4, "wind": (1.0, 0.0, 0.0)},
    "valley": {"visibility": 700.0, "structure": 1.1, "top": -6.0, "falloff": 5.0,
        "wind": (1.0, 0.0, 0.0)},
    "ground": {"visibility": 150.0, "structure": 1.1, "top": -1.0, "falloff": 0.5,
        "wind": (0.4, 0.0, 0.0)},
    "bank": {"visibility": 60.0, "structure": 0.7, "wind": (0.6, 0.0, 0.0)},
    "cumulus": {"visibility": 10.0, "structure": 1.0, "box": (30.0, 14.0, 20.0),
        "wind": (0.5, 0.0, 0.0), "forward": 0.6},
}  # fmt: skip
