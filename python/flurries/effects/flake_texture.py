"""The far flakes of a population: sheets, one for each layer of depth and class of size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flurries._contract import Array
from flurries.effects.bent import moved_by_wind, read_bent
from flurries.effects.checks import DepthMode
from flurries.effects.lighting import lamp_shade
from flurries.effects.passes import plane_motion
from flurries.effects.sheets import read_sheets
from flurries.effects.weather import Film, Layer, Weather, times
from flurries.frame.layer import Shade
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.phase import Optics


@dataclass(frozen=True, eq=False)
class FlakeTexture:
    """The texture."""

    weather: Weather
    # Of the effect; sheets follow a scene's depth pixel by pixel in any case.
    depth_mode: DepthMode = "pixel"
    keyed_amount: bool = False  # Whether the amount changes.

    name = "texture"

    def _layers(self, film: Film) -> tuple[Layer, ...]:
        return () if self.weather.simulated else film.layers

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return its one step, or why there is none."""
        film = self.weather.film(frame)
        layers = self._layers(film)
        if not layers:
            why = "all flakes are drawn one by one"
            return Needs((), (LeftOut("texture", why),), most=0.0)
        still = frame.settled and self.weather.motion.still and not has_keys(self.weather.emission)
        return Needs((Step("texture", once=still),), most=1.0 - 1e-6)

    def alpha(self, frame: Frame, amount: float) -> Array:
        """Return its opacity over the window, (h, w) float32."""
        film = self.weather.film(frame)
        if film.rigid:
            return read_sheets(self.weather, frame, film, amount)
        return read_bent(self.weather, frame, film, amount, self.keyed_amount)

    def lamp_shade(self, frame: Frame, optics: Optics) -> Shade:
        """Return the light of the frame's lamps on it, by places."""
        layers = self.weather.film(frame).layers
        depths = np.array([layer.slab.depth for layer in layers])
        weights = np.array([layer.slab.coverage for layer in layers])
        return lamp_shade(frame, depths, weights, optics)

    def passes(self, frame: Frame, others: Sequence[Frame]) -> tuple[list[Array], Array]:
        """Return motions to other frames (h, w, 2) and depth (h, w) of what the window shows.

        Depth is the mean over the layers, each weighed by what it covers; they move as flakes at
        the depth whose parallax is the mean one.
        """
        layers, motion = self._layers(self.weather.film(frame)), self.weather.motion
        weights = np.array([layer.slab.coverage for layer in layers])
        depths = np.array([layer.slab.depth for layer in layers])
        nearness = weights / depths
        top, bottom, left, right = frame.window
        depth = np.full((bottom - top, right - left), weights.sum() / nearness.sum(), np.float32)
        speeds = np.array([layer.share.size.fall for layer in layers])
        fall = times(
            motion.fall, float(nearness @ speeds / nearness.sum() / self.weather.mean_speed)
        )
        wind = motion.mean_wind
        places = [
            frame.path.relative(t, fps=frame.fps, fall=fall, wind=wind)[0]
            for t in (frame.t, *(other.t for other in others))
        ]
        moves, varied = [], motion.varied is not None
        for other, place in zip(others, places[1:], strict=True):
            move = plane_motion(depth, frame, other, place - places[0])
            if varied:
                move += moved_by_wind(self.weather, weights, frame, other)
            moves.append(move)
        depth.fill(weights @ depths / weights.sum())
        return moves, depth
