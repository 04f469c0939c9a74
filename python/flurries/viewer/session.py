"""What both viewers ask: a picture for where the sliders stand, the charts, the scene's text."""

import json
import threading
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from flurries import stereo
from flurries._contract import Array, choice, integer, real
from flurries.camera.path import CameraPath
from flurries.frame.show import jpeg, on_screen
from flurries.io import fit, fit_nearest
from flurries.motion.keys import Keys
from flurries.motion.wind import Wind
from flurries.scene.depth import DepthMap
from flurries.scene.foreground import Foreground
from flurries.scene.scene import Scene, expect_scene
from flurries.viewer import controls
from flurries.viewer.charts import chart, field_of
from flurries.viewer.controls import EYES, fall_of, moves, settings
from flurries.viewer.keep import Python, film, save

# Of an effect, what is counted in pixels of the picture, with the least that makes sense.
_SCALED = {"tile": 8, "overlap": 0}


class Preview:
    """A scene made small once, to be shown with changing effects and cameras."""

    def __init__(self, scene: Scene, most: int) -> None:
        limit = integer("size", most, low=16, high=4096)
        height, width = scene._shape
        self.scale = min(limit / max(height, width), 1.0)
        self.scene = scene
        if self.scale < 1.0:
            size = (max(round(width * self.scale), 1), max(round(height * self.scale), 1))
            self.scene = scene.replace(
                size=size, background=_small(scene.background, size),
                foreground=_small(scene.foreground, size), depth=_small(scene.depth, size),
                camera=scene.camera.resize(self.scale),
            )  # fmt: skip

    @cached_property
    def flat(self) -> Scene:
        return self.scene.replace(depth=None)

    def shown(self, changes: Mapping[str, Any]) -> Scene:
        """Return the small scene with what was touched, which is given for the large one."""
        # Not `replace`, which would open and fit the background's file for every picture.
        rest = dict(changes)
        base = self.flat if rest.pop("depth", self.scene.depth) is None else self.scene
        if self.scale < 1.0:
            rest["camera"] = rest["camera"].resize(self.scale)
            rest["effects"] = tuple(scaled(effect, self.scale) for effect in rest["effects"])
        return base._derive(**rest)


def scaled(effect: Any, scale: float) -> Any:
    """Return an effect for a picture `scale` times as large."""
    changes: dict[str, Any] = {}
    if getattr(effect, "wavelengths", None) is not None:
        shortest, longest = (scale * length for length in effect.wavelengths)
        shortest = max(shortest, 2.0)
        changes["wavelengths"] = (shortest, max(longest, 1.25 * shortest))
    for name, least in _SCALED.items():
        value = getattr(effect, name, None)
        if isinstance(value, int):
            changes[name] = max(round(scale * value), least)
    return replace(effect, **changes) if changes else effect


def _small(value: Any, size: tuple[int, int]) -> Any:
    """Return arrays at a size: a picture filtered, a matte or a depth by its nearest pixels."""
    if isinstance(value, DepthMap) and isinstance(value.source, np.ndarray):
        return replace(value, source=fit_nearest(value.source, size))
    if isinstance(value, Foreground):
        return Foreground(_small(value.source, size), _small(value.depth, size))
    if isinstance(value, (list, tuple)):
        return type(value)(_small(one, size) for one in value)
    if not isinstance(value, np.ndarray):
        return value
    return fit_nearest(value, size) if value.ndim == 2 else fit(value, size, "stretch")


# Where two eyes meet, if nothing else says so: in front of the far flakes, behind the nearest.
CONVERGENCE = 6.0

MOST_PAGES = 16  # Pages whose air is remembered; an older one begins again from the closed form.

# A time, and camera minus air of each effect then; None for one that does not move.
_Air: TypeAlias = tuple[float, list[Any]]


class Session:
    """A scene that is being looked at."""

    def __init__(self, scene: Scene, *, size: int = 512, save: str | Path = "tuned.toml") -> None:
        scene = expect_scene(scene)
        # What plays is a film.
        self.scene = scene = scene.replace(fps=scene.fps) if scene._still else scene
        self.save_path = Path(save)
        self.values: dict[str, Any] = {}
        # A page plays on beyond a film's end.
        self._preview = Preview(scene.replace(extend="hold") if scene._spans else scene, size)
        # Where it was in each page's last picture: all else comes with every question.
        self._air: dict[str, _Air] = {}
        self._lock = threading.Lock()  # Sources of files decode one frame at a time.

    def describe(self, values: Mapping[str, Any] | None = None) -> dict[str, Any]:
        """Return the page's parts, as JSON has them, with the looks that were chosen."""
        height, width = self._preview.scene._shape
        return {
            "width": width, "height": height, "full": list(self.scene.size or ()),
            "fps": self.scene.fps, "frames": self.scene._backdrop.count,
            "effects": controls.names(self.scene),
            "textured": [field_of(effect) is not None for effect in self.scene.effects],
            "controls": [asdict(row) for row in controls.controls_of(self.scene, values)],
            "save": str(self.save_path),
        }  # fmt: skip

    def answer(self, ask: Mapping[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        """Return a header, as JSON has it, and buffers; a mistake is a header with "error"."""
        try:
            if not isinstance(ask, Mapping):
                raise TypeError(f"ask must be an object, got {type(ask).__name__}")
            values = ask.get("values", {})
            if not isinstance(values, Mapping):
                raise TypeError(f"values must be an object, got {type(values).__name__}")
            kinds = ("frame", "save", "python", "film", "describe")
            kind = choice("kind", ask.get("kind", "frame"), kinds)
            with self._lock, warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                if kind == "frame":
                    return self._frame(ask, values)
                if kind == "describe":
                    return self.describe(values), []
                if kind == "film":
                    shown = self._preview.shown(settings(self.scene, values))
                    return {"film": str(film(shown, self.save_path))}, []
                self.values = dict(values)
                if kind == "python":
                    return {"text": Python(self.save_path.resolve()).of(self.tuned)}, []
                save(self.tuned, self.save_path)
                text = self.save_path.read_text(encoding="utf-8")
                return {"saved": str(self.save_path), "text": text}, []
        except (ValueError, TypeError, OSError, MemoryError, OverflowError) as error:
            return {"error": " ".join(str(error).split()) or type(error).__name__}, []

    @property
    def tuned(self) -> Scene:
        return controls.applied(self.scene, {k: v for k, v in self.values.items() if k != EYES})

    def _frame(
        self, ask: Mapping[str, Any], values: Mapping[str, Any]
    ) -> tuple[dict[str, Any], list[bytes]]:
        began = time.perf_counter()
        asked = real("t", ask.get("t", 0.0))
        # Pages count from 0, plates from where their files do.
        now = asked + (0 if self.scene._range is None else self.scene._range[0])
        changes = settings(self.scene, values)
        self.values = dict(values)
        scene = self._preview.shown(changes)
        last = max(len(scene.effects) - 1, 0)
        index = integer("effect", ask.get("effect", 0), low=0, high=last)
        page = ask.get("page", "")
        if not isinstance(page, str) or len(page) > 64:
            raise ValueError("page must be a short text")
        before = None if ask.get("begin", True) else self._air.get(page)
        scene, places = _carried(scene, now, before, index)
        self._air.pop(page, None)
        if places is not None:
            self._air[page] = (now, places)
        while len(self._air) > MOST_PAGES:
            del self._air[next(iter(self._air))]
        picture = self._eyes(scene, now, float(values.get(EYES, 0.0)) / 1000.0)
        head: dict[str, Any] = {"t": asked}
        buffers = [jpeg(picture)]
        if ask.get("charts"):
            at = ask.get("at", (0.5, 0.5))
            x, y = (real("at", v, low=0.0, high=1.0) for v in at)
            place = integer("chart", ask.get("chart", index), low=0, high=last)
            found = chart(scene, now, place, (x, y))
            if found is not None:
                head["chart"] = {**vars(found), "side": len(found.rate)}
                buffers += [head["chart"].pop(plane).tobytes() for plane in ("rate", "power")]
        strong = [e.strength(now) for e in scene.effects if hasattr(e, "strength")]
        head["inert"] = controls.inert(scene, values)
        head["strength"] = " · ".join(map(str, strong))
        head["ms"] = round(1e3 * (time.perf_counter() - began), 2)
        return head, buffers

    def _eyes(self, scene: Scene, t: float, distance: float) -> Array:
        """Return the picture as uint8 display values, for one eye or red-cyan glasses."""
        if distance <= 0.0:
            return on_screen(scene.render(t))
        pair = stereo.eyes(scene.camera.camera, distance=distance, convergence=CONVERGENCE)
        left, right = (on_screen(scene.render(t, eye=eye)) for eye in pair)
        return stereo.anaglyph(left, right)


def packed(head: Mapping[str, Any], buffers: list[bytes]) -> bytes:
    """Return an answer as one run of bytes: the header's length, the header, the buffers."""
    text = json.dumps({**head, "buffers": [len(part) for part in buffers]}).encode()
    # Floats behind it begin at a multiple of 4 once the page has cut them out; it copies.
    return len(text).to_bytes(4, "little") + text + b"".join(buffers)


def _carried(
    scene: Scene, t: float, before: _Air | None, index: int
) -> tuple[Scene, list[Any] | None]:
    """Return the scene moved so that the air goes on from where it was, and where it is now."""
    # With another speed the air would jump to where that speed had brought it by now. There is one
    # camera to move, so the effect at `index`, which is under the hand, decides.
    path: CameraPath = scene.camera
    if path.turns or not any(map(moves, scene.effects)):
        return scene, None
    here = _places(scene, t)
    if before is None:
        return scene, here
    if not moves(scene.effects[index]):
        index = next(i for i, effect in enumerate(scene.effects) if moves(effect))
    then, places = before
    offset = np.subtract(places[index], _places(scene, then)[index])
    if not np.any(np.abs(offset) > 1e-9):
        return scene, here
    start, rate = path.place(t, fps=scene.fps) + offset, path.rate(t, fps=scene.fps)
    keys = Keys([(t, tuple(start)), (t + 1.0, tuple(start + rate))])
    moved = scene._derive(camera=replace(path, position=keys, velocity=None))
    return moved, _places(moved, t)


def _places(scene: Scene, t: float) -> list[Any]:
    """Return camera minus air for each effect that moves, three numbers each."""
    frame = scene._program.frame(t)

    def place(effect: Any) -> Any:
        wind = effect.wind.steady if isinstance(effect.wind, Wind) else effect.wind
        return frame.displacement(fall=fall_of(effect), wind=wind).tolist()

    return [place(effect) if moves(effect) else None for effect in scene.effects]
