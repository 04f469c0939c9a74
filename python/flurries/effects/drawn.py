"""The near flakes of a population, drawn one by one; or all of them, where the method says so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from flurries import _core
from flurries._contract import Array, Float64
from flurries._core import SortedFlakes
from flurries.effects.air import air_of
from flurries.effects.flakes import Flakes
from flurries.effects.motion import Motion
from flurries.effects.passes import STEPS
from flurries.effects.weather import Weather
from flurries.frame.layer import Shade
from flurries.frame.needs import LeftOut, Needs, Step, has_keys
from flurries.frame.view import Frame
from flurries.light.phase import Optics


class Rows(NamedTuple):
    """The flakes of a frame."""

    ids: npt.NDArray[np.uint64]  # (n,) uint64: the same in every frame, eye and window.
    points: Float64  # (n, 3): in the camera's axes, metres.
    pixels: Float64  # (n, 2): where they are seen, (x, y).
    depths: Float64  # (n,): from the eye, metres.
    diameters: Float64  # (n,): metres.
    shares: Float64  # (n,): how much of each is there, 0 to 1.
    # (n, k, 2): where they are seen at `STEPS` frames from this one; NaN behind the eye.
    others: Float64


class Seen(NamedTuple):
    """What pixels show of the flakes: the row of the one that shows most in each, -1 for none."""

    alpha: Array
    nearest: npt.NDArray[np.int32]
    rows: Rows


@dataclass(frozen=True, eq=False)
class DrawnFlakes:
    """The flakes that are drawn."""

    weather: Weather | Flakes

    name = "flakes"

    def needs(self, frame: Frame, amount: float) -> Needs:
        """Return their one step, or why there is none."""
        weather = self.weather
        if self.number_in_view(frame) == 0.0 or weather.opacity_at(frame.t) == 0.0:
            return Needs((), (LeftOut("flakes", "there are none"),), most=0.0)
        still = frame.settled and weather.motion.still and 0.0 in weather.sway
        # Shapes tumble.
        still = still and weather.shape == "round" and not has_keys(weather)
        # However few there are, one that is there shows whole.
        return Needs((Step("flakes", once=still),), most=1.0)

    def number_in_view(self, frame: Frame) -> float:
        """Return the number of flakes that are drawn in view, on average."""
        height, width = frame.shape
        fx, fy = frame.camera.focals
        view = width * height / (3.0 * fx * fy)
        return view * sum(s.size.density * s.reach**3 for s in self.weather.shares(frame))

    @property
    def motion(self) -> Motion:
        """The motion of a flake of the mean size."""
        return self.weather.motion

    def alpha(self, frame: Frame, amount: float) -> Array:
        """Return the opacity of the flakes over the window, (h, w) float32."""
        if frame.whole:
            return self.seen(frame, amount).alpha
        top, bottom, left, right = frame.window
        result = np.empty((bottom - top, right - left), np.float32)
        _core.particle_draw(result, self.sort(frame, amount), frame.window, frame.depth, None)
        return result

    def lit(
        self,
        frame: Frame,
        amount: float,
        optics: Optics,
        behind: tuple[Array, Shade] | None,
    ) -> tuple[Array, Array]:
        """Return opacity and light of the flakes under the frame's lamps, (h, w) and (h, w, 3).

        The light of what lies behind them, an opacity and its colors, is added to theirs.
        """
        top, bottom, left, right = frame.window
        near = np.empty((bottom - top, right - left), np.float32)
        glow = np.empty((*near.shape, 3), np.float32)
        flakes = self.sort(frame, amount)
        lamps = frame.lamps()
        under = None if behind is None else (behind[0], behind[1].given())
        window, depth = frame.window, frame.depth
        _core.particle_draw_lit(near, glow, flakes, window, lamps, optics, depth, under)
        return near, glow

    def sort(self, frame: Frame, amount: float) -> SortedFlakes:
        """Return the flakes, to be drawn in any band of the frame."""

        def make() -> SortedFlakes:
            return _core.fall(
                air_of(self.weather, frame, amount, steps=STEPS if frame.whole else ())
            )

        return frame.once_each(self, "flakes", make)

    def seen(self, frame: Frame, amount: float) -> Seen:
        """Return what the window's pixels show of the flakes."""

        def make() -> Seen:
            flakes = self.sort(frame, amount)
            top, bottom, left, right = frame.window
            result = np.empty((bottom - top, right - left), np.float32)
            nearest = np.empty(result.shape, np.int32)
            _core.particle_draw(result, flakes, frame.window, frame.depth, nearest)
            return Seen(result, nearest, _rows_of(flakes))

        # One frame is asked for twice where something stands in the air, with two depths.
        return frame.once_each(self, f"seen before {id(frame.depth)}", make)

    def rows(self, frame: Frame, amount: float) -> Rows:
        """Return the flakes that the frame's window may show."""
        return frame.once_each(self, "rows", lambda: _rows_of(self.sort(frame, amount)))

    def passes(self, rows: Rows, numbers: npt.NDArray[np.int32]) -> tuple[list[Array], Array]:
        """Return motions to `STEPS` (n, 2) and depth (n,) of flakes by their rows."""
        motion = rows.others[numbers] - rows.pixels[numbers][:, None]
        # One that is behind the eye in one of the frames goes on as from the other.
        for one, other in ((0, 1), (1, 0)):
            gone = np.isnan(motion[:, one])
            motion[:, one] = np.where(gone, -motion[:, other], motion[:, one])
        motion = np.nan_to_num(motion)
        ways = [np.ascontiguousarray(motion[:, i], np.float32) for i in range(len(STEPS))]
        return ways, rows.depths[numbers].astype(np.float32)


def _rows_of(flakes: SortedFlakes) -> Rows:
    ids, rows, others = _core.flake_rows(flakes)
    return Rows(
        ids, rows[:, :3], rows[:, 3:5], rows[:, 5], rows[:, 6], rows[:, 7],
        others.reshape(len(ids), -1 if len(ids) else len(STEPS), 2),
    )  # fmt: skip
