"""The far flakes of a population: sheets, one for each layer of depth and class of size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries.effects.bent import moved_by_wind, read_bent
from flurries.effects.lighting import lamp_shade
from flurries.effects.passes import plane_motion
from flurries.effects.sheets import covers_of, depths_of, read_sheets
from flurries.effects.weather import Weather, times
from flurries.frame.layer import Shade
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.phase import Optics


@dataclass(frozen=True, eq=False)
class FlakeTexture:
    """The texture."""

    weather: Weather

    name = "texture"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none."""
        weather = self.weather
        if weather.simulated or not weather.film(frame).layers:
            why = "all flakes are drawn one by one"
            return Needs((), (LeftOut("texture", why),), most=0.0)
        still = frame.settled and weather.motion.still and not has_keys(weather.emission)
        return Needs((Step("texture", once=still),), most=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float) -> Array:
        """Return its opacity over the window, (h, w) float32."""
        film = self.weather.film(frame)
        if film.rigid:
            return read_sheets(self.weather, frame, film, amount)
        return read_bent(self.weather, frame, film, amount)

    def lamp_shade(self, frame: Frame, optics: Optics) -> Shade:
        """Return the light of the frame's lamps on it, by places."""
        film = self.weather.film(frame)
        return lamp_shade(frame, depths_of(film), covers_of(film), optics)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        """Return motions to other frames (h, w, 2) and depth (h, w) of what the window shows.

        Depth is the mean over the layers, each weighed by what it covers; they move as flakes at
        the depth whose parallax is the mean one.
        """
        film, motion = self.weather.film(frame), self.weather.motion
        weights = np.array([layer.slab.coverage for layer in film.layers])
        depths = np.array([layer.slab.depth for layer in film.layers])
        nearness = weights / depths
        top, bottom, left, right = frame.window
        depth = np.full((bottom - top, right - left), weights.sum() / nearness.sum(), np.float32)
        speeds = np.array([layer.share.size.fall for layer in film.layers])
        speed = float(nearness @ speeds / nearness.sum() / self.weather.mean_speed)
        air: Any = {"fps": frame.fps, "fall": times(motion.fall, speed), "wind": motion.mean_wind}
        here, *places = [frame.path.relative(at.t, **air)[0] for at in (frame, *others)]
        moves = [
            plane_motion(depth, frame, other, place - here)
            for other, place in zip(others, places, strict=True)
        ]
        if motion.varied is not None:
            for move, other in zip(moves, others, strict=True):
                move += moved_by_wind(self.weather, weights, frame, other)
        depth.fill(weights @ depths / weights.sum())
        return moves, depth
