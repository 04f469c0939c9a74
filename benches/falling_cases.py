"""The scenes by which falling snow is judged, each for the package and for the twin.

Flakes are round, and fade in from 1.6 to 2 m: a few large near flakes decide the moments of
a picture of 480 px by chance, and near shapes have no twin.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import flurries as fl

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from judges import Picture
from twin_falling import View
from twin_law import Law

NEAR = 2.0
FPS = 30.0

# The camera's velocity in m/s, and its turning to the right in radians a second.
CAMERAS: dict[str, tuple[tuple[float, float, float], float]] = {
    "still": ((0.0, 0.0, 0.0), 0.0),
    "sideways": ((2.0, 0.0, 0.0), 0.0),
    "forward": ((0.0, 0.0, 2.0), 0.0),
    "turning": ((0.0, 0.0, 0.0), 0.2),
}
WEATHERS: dict[str, dict[str, Any]] = {
    "light": fl.Snow.PRESETS["light"],
    "heavy": fl.Snow.PRESETS["heavy"],
    "blizzard": fl.Snow.PRESETS["blizzard"],
    "rain": {"rate": 10.0, "gain": 1.0},
}
WINDS = (0.0, 3.0)


@dataclass(frozen=True)
class Case:
    """A scene."""

    camera: str  # Of `CAMERAS`.
    weather: str  # Of `WEATHERS`.
    wind: float  # To the right, m/s.
    width: int = 480  # Pixels; the height is three quarters of it, the focal length 1.2 of it.

    def __str__(self) -> str:
        return f"{self.weather}-{self.camera}-{self.wind:g}-{self.width}"

    @property
    def uniform(self) -> bool:
        return self.camera in ("still", "sideways")

    @property
    def followed(self) -> float:
        """Over how many frames peaks are followed: rain has left the picture after more."""
        return 4.0 if self.weather == "rain" else 10.0

    @property
    def size(self) -> tuple[int, int]:
        return self.width, 3 * self.width // 4

    def effect(self, method: str = "flakes") -> Any:
        fields = {
            **WEATHERS[self.weather], "wind": (self.wind, 0.0, 0.0), "shape": "round",
            "near": NEAR, "color": 1.0, "method": method, "shutter": 0.5, "clumps": 0.0,
        }  # fmt: skip
        return fl.Rain(**fields) if self.weather == "rain" else fl.Snow(**fields)

    def scene(self, seed: int, method: str = "flakes") -> fl.Scene:
        velocity, spin = CAMERAS[self.camera]
        turn = fl.Keys([(0.0, (0.0, 0.0, 0.0)), (30 * FPS, (0.0, 30.0 * spin, 0.0))])
        about = {"orientation": turn} if spin else {"velocity": velocity} if any(velocity) else {}
        path = fl.CameraPath(fl.Camera(1.2 * self.width), **about)
        # White before black in floats is opacity.
        black = np.zeros((*self.size[::-1], 3), np.float32)
        return fl.Scene(
            black, size=self.size, camera=path, effects=[self.effect(method)], seed=seed, fps=FPS
        )

    def twin(self) -> tuple[Law, View]:
        snow = self.effect()
        rain = self.weather == "rain"
        law = Law(
            density=snow.density, sizes=snow.drop_size if rain else snow.flake_size,
            opacity=snow.opacity, kind="rain" if rain else "snow", fall=snow.fall,
            near=snow.near, far=snow.far,
        )  # fmt: skip
        velocity, spin = CAMERAS[self.camera]
        view = View(
            size=self.size, focal=1.2 * self.width, velocity=velocity,
            wind=(self.wind, 0.0, 0.0), spin=spin, sway=(0.0, 0.0) if rain else snow.sway,
            shutter=snow.shutter, fps=FPS,
        )  # fmt: skip
        return law, view

    def flow(self, at: Picture, near: Picture, start: float, end: float) -> Picture:
        """Return where flakes of the mean size go from places (2, n) px at a nearness, 1/m."""
        law, view = self.twin()
        x, y = (at - 0.5 * np.array(self.size)[:, None]) / view.focal
        places = view.matrix(start) @ (np.stack([x, y, np.ones_like(x)]) / near)
        places += np.array(view.velocity)[:, None] * (start / FPS)
        fall = law.speed(np.array([law.sizes[1]]))
        return view.project(places + view.carried(fall, end - start), end)[0]


def pictures(scene: fl.Scene, times: tuple[float, ...]) -> list[Picture]:
    return [scene.render(t)[..., 0].astype(np.float64) for t in times]
