"""The scene: a frame is a pure function of it and the frame number."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from copy import copy
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from flurries._contract import Array, choice, flag, integer, rate_of, seed_of, suggesting
from flurries._warnings import warn
from flurries.camera.lens import Camera
from flurries.camera.optics import USUAL, Lens
from flurries.camera.path import CameraPath, as_path
from flurries.effects.drawn import FLAKE, drawn_of
from flurries.frame.needs import Effect
from flurries.frame.show import figure, listing
from flurries.io import open_background
from flurries.io.sequences import EXTEND
from flurries.io.sequences import MOST_FRAMES as LAST
from flurries.io.sources import Source
from flurries.light.lamp import Lamp, Sun
from flurries.light.shot import Light
from flurries.scene.arguments import effects_of, lights_of, one_or_none, parse_size
from flurries.scene.background import backdrop
from flurries.scene.depth import DepthMap, Distance, distance_of
from flurries.scene.files import Extend
from flurries.scene.foreground import Foreground, frozen, mattes_of
from flurries.scene.output import Output
from flurries.scene.rendering import Rendering, Space

Background: TypeAlias = str | Path | Sequence[float] | Array | Source
Depth: TypeAlias = float | Array | str | Path | DepthMap
Matte: TypeAlias = str | Path | Array | Foreground
Front: TypeAlias = Matte | Sequence[Matte] | None


DEFAULT_FPS = 30.0  # Frames per second, where neither the caller nor a film says it.
DEFAULT_FOCAL = 1.2  # A focal length in picture widths, where none is given: 45 degrees across.

# Widths of a picture: a lens as long as 10 m is no usual one, nor is one of a tenth of that.
LONGEST_FOCAL = 28.0

# Widths of a picture. A shorter focal length sees 160 degrees and more: its unit is hardly pixels.
SHORTEST_FOCAL = 1 / 12


@suggesting
@dataclass(frozen=True, eq=False, init=False, repr=False)
class Scene(Rendering):
    """A background, a camera and the weather: all that a film is made of.

    Parameters
    ----------
    background : path, "#rrggbb", (r, g, b) floats, array, or source
        A picture, an image sequence (``plate.%04d.png``), or a video file; a color; an array
        (H, W, 3) of uint8, uint16 or float. Integers hold display values, floats linear light. With
        alpha, (H, W, 4), frames have it too: premultiplied for floats, straight for integers.
    size : (width, height), optional
        Size of the frame in pixels; the background's own if not given. Files and colors are fitted
        to it (scaled to cover, cut at the sides); an array must have it.
    camera : Camera or CameraPath, optional
        A still camera of 1.2 picture widths if not given.
    effects : sequence
        The weather, back to front; 1,000 at most.
    fps : float, optional
        Frames per second; that of a film in the background if not given, else 30. A scene without
        it over a still picture is a still: snow and rain without a `shutter` are exposed for
        1/250 s, and in a film for half a frame.
    seed : int
        Seed of all random numbers; each effect draws its own numbers.
    foreground : path, array or Foreground, or a list of them, optional
        What stands in front of the weather: a mask (H, W), 1 in front, or a picture with alpha; at
        a depth of its own as a :class:`Foreground`.
    space : {"auto", "display", "linear"}
        Where layers are mixed; "auto" is linear light for floats, lamps and mist of the picture's
        own light, and display values for all other integers.
    depth : float, array, path or DepthMap, optional
        Planar depth of the background in metres: a wall at one depth; an array (H, W) of float with
        infinity where nothing stands; an EXR or float TIFF, or a sequence of them, with a channel
        "Z" or "depth"; or greys, see :class:`DepthMap`. Files are fitted as the background is.
    sun : Sun, optional
        The sun that lights gas.
    lights : sequence of Lamp
        Lamps that light flakes and drops; the frame is then mixed in linear light.
    light : Light, optional
        The light of the shot, for what is "ambient" or "local" and for mist; found in nine frames
        of the background if not given, see :func:`find_light`.
    lens : Lens, "usual" or None
        A lens with an opening: flakes and drops out of focus are soft; without one all is sharp.
        "usual" is f/5.6 at 10 m over a photograph or a film of integers, else none.
    extend : {"stop", "hold", "loop"}
        What stands for frame numbers that a sequence, a film or a camera's file lacks: "stop" is an
        error, "hold" the first or last frame, "loop" begins again (not for cameras).
    colorspace : str, optional
        The background's color space by its name in ``$OCIO`` or the built-in configuration, such as
        "ACEScg". Layers are mixed in it if it is linear, else in the configuration's scene_linear,
        and the weather's colors, which are of Rec. 709, are turned into it.
    start : int, optional
        The number of films' first frame; if not given that of the background's files, else 0.
    loop : int, optional
        Number of frames, 2 or more, after which the film begins again without a jump, to the bit,
        from the background's first frame on, else from 0. Flakes, drops and puffs of one round give
        way, one by one, to those of the next; waves of a texture and a cone's tiles are bent to
        whole turns; what is keyed goes back to its first value over the last quarter; a camera ends
        as it began where that is seen. :meth:`plan` says what was changed.
    output : Output, optional
        How frames are written where :meth:`write` does not say.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene("#203040", size=(320, 240), effects=[fl.effects.TentSnow("heavy")])
    >>> frame = scene.render(17)
    >>> frame.shape, frame.dtype.name
    ((240, 320, 3), 'uint8')
    """

    background: Background
    foreground: Front
    depth: Depth | None
    _start: int | None
    _output: Output

    def __init__(
        self, background: Background = "#000000", *, size: tuple[int, int] | None = None,
        camera: Camera | CameraPath | None = None, effects: Effect | Sequence[Effect] = (),
        fps: float | None = None, seed: int = 0, foreground: Front = None, space: Space = "auto",
        depth: Depth | None = None, sun: Sun | None = None, extend: Extend = "stop",
        start: int | None = None, colorspace: str | None = None, lights: Lamp | Sequence[Lamp] = (),
        light: Light | None = None, lens: Lens | Literal["usual"] | None = "usual",
        loop: int | None = None, output: Output | None = None,
    ) -> None:  # fmt: skip
        # Frozen for all others.
        own = vars(self)
        own.update(
            seed=seed_of(seed), _space=choice("space", space, Space), effects=effects_of(effects),
            _extend=choice("extend", extend, EXTEND), _colorspace=colorspace, _found={},
            _sun=one_or_none("sun", sun, Sun), lights=lights_of(lights),
            light=one_or_none("light", light, Light),
            _start=None if start is None else integer("start", start, low=-LAST, high=LAST),
            loop=None if loop is None else integer("loop", loop, low=2, high=LAST),
            _output=one_or_none("output", output, Output) or Output(),
        )  # fmt: skip
        rate = None if fps is None else rate_of(fps)
        numbers: dict[str, Any] = {"extend": extend, "start": self._start}
        found = backdrop(background, None if size is None else parse_size(size), **numbers)
        if self._color is None:
            found.require_display()
        elif space == "display":
            raise ValueError("space must not be 'display' where a colorspace is given")
        # Arrays are copied: the caller's may change.
        given = found.given if isinstance(background, np.ndarray) else background
        own.update(
            background=given, size=found.size, fps=rate or rate_of(found.fps or DEFAULT_FPS),
            _backdrop=found if self._color is None else found.decoded(self._color),
            _still=fps is None and found.count is None and loop is None,
        )  # fmt: skip
        if start is None and self._range is not None:
            numbers["start"] = self._range[0]
        numbers["display"] = found.display
        width = self._display[2]
        usual = Camera(DEFAULT_FOCAL * width, aspect=found.aspect)
        own["camera"] = as_path(usual if camera is None else camera, usual.focal)
        if self.camera.widest.focal < SHORTEST_FOCAL * width:
            warn(
                f"camera has a focal length of {self.camera.widest.focal:g} px for a picture "
                f"{width} px wide; lengths in millimetres are multiplied by the width "
                "in pixels over that of the sensor"
            )
        if lens == "usual":
            short = self.camera.longest_focal < LONGEST_FOCAL * width
            lens = USUAL if found.photograph and self._color is None and short else None
        own["lens"] = one_or_none("lens", lens, Lens)
        path = self.camera.holding() if self._holds else self.camera
        own["_path"] = replace(path, camera=self._in_frame(path.camera))
        several = isinstance(foreground, (list, tuple))
        front: Any = tuple(map(frozen, foreground)) if several else frozen(foreground)  # type: ignore[arg-type]
        planes = None if depth is None else distance_of(depth, self._shape, **numbers)
        inverse = isinstance(depth, DepthMap) and depth.law == "inverse"
        own.update(
            foreground=front, _mattes=mattes_of(front, self._shape, **numbers),
            depth=planes.given if planes and np.ndim(depth) == 2 else depth,  # type: ignore[arg-type]
            _distance=planes and Distance.of_planes(planes, inverse=inverse),
        )  # fmt: skip

    def __repr__(self) -> str:
        width, height = self.size
        rate = "a still" if self._still else f"{self.fps:g} fps"
        names = ", ".join(type(effect).__name__ for effect in self.effects) or "none"
        return (
            f"Scene({width} x {height} px, {rate}, background={_value(self.background)}, "
            f"camera={_camera(self.camera)}, effects={names})"
        )

    def _repr_html_(self) -> str:
        width, height = self.size
        rows = [
            ("size", f"{width} x {height} px, {self.fps:g} frames a second"),
            ("background", _value(self.background)),
            ("camera", _camera(self.camera)),
        ]
        rows += [(type(effect).__name__, _own_values(effect)) for effect in self.effects]
        first, last = self._range or (0, math.inf)
        frame = self.render(int(min(first + round(self.fps), last)))
        return f"<div>{figure(frame)}{listing(rows)}</div>"

    @property
    def _arguments(self) -> dict[str, Any]:
        """What it was made from, not what was made of it; a still stays one without a rate."""
        values = {f.name.lstrip("_"): getattr(self, f.name) for f in fields(self) if f.init}
        return values | ({"fps": None} if self._still else {})

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(Scene, **self._arguments), ()

    def replace(self, **changes: Any) -> Scene:
        """Return the scene with some arguments changed."""
        return Scene(**self._arguments | changes)

    @cached_property
    def _fine(self) -> Scene:
        """The scene with a background of 8 bits in 16: weather over it has their steps."""
        return self if self._backdrop.deep else self._derive(_backdrop=self._backdrop.fine())

    def _anew(self, *, hold: bool = False) -> Scene:
        """Return the scene with all files to be read again; `hold` the last good background."""
        given, source = self.background, self._source
        if hold and isinstance(source, Source) and source.damaged != "hold":
            given = open_background(source.spec, damaged="hold", overscan=source.overscan)
        elif hasattr(given, "spec"):
            # A copy of an opened source forgets its pictures.
            given = copy(given)
        return self.replace(background=given)

    def save(self, path: str | Path) -> None:
        """Write the scene to a TOML file; backgrounds must be files or colors."""
        from flurries.scene.toml import save

        save(self, path)


def open_scene(path: str | Path, **arguments: Any) -> Scene:
    """Return the scene of a file that ends in .toml, or of a picture, a sequence or a film.

    Further arguments are those of :class:`Scene`, and replace those of a scene file.

    Examples
    --------
    >>> import flurries as fl
    >>> fl.Scene(size=(64, 48), effects=[fl.Snow()]).save("street.toml")
    >>> fl.open("street.toml", fps=24).fps
    24.0
    """
    from flurries.scene.toml import load

    if not isinstance(path, (str, Path)):
        raise TypeError(f"path must be a str or a path, got {path!r:.60}")
    if not str(path).lower().endswith(".toml"):
        return Scene(path, **arguments)
    found = load(path)
    return found.replace(**arguments) if arguments else found


def find_light(scene: Scene, *, keyed: bool = False) -> Light:
    """Return the light of a scene's background, whatever its own `light` says.

    Nine frames are read, and for each place the middle counts: a lamp that enters changes nothing.
    With `keyed` each of these frames gets a key: for a sky that changes itself, as at dusk, and
    stays in the picture. A camera that turns to another part of the sky is no such change.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene("#808080", size=(64, 48), effects=[fl.Snow()])
    >>> scene = scene.replace(light=fl.scene.find_light(scene))
    """
    return expect_scene(scene)._program.find_light(keyed=flag("keyed", keyed))


def flakes(scene: Scene, t: float = 0.0) -> npt.NDArray[Any]:
    """Return the flakes and drops of a frame that are drawn one by one, a structured array (n,).

    ``id`` (uint64, below 2^53): the same in every frame, eye, crop and size of the picture, and
    that of EXR files and USD points. ``place`` (3,): metres, x right, y down, z ahead, from the
    camera's place at frame 0. ``pixel`` (x, y), of the middle of the exposure; a flake of which
    only a part reaches into the picture lies outside. ``depth``: metres. ``diameter``: metres.
    ``opacity``: mean over the disc of the resting flake, fading included.

    Examples
    --------
    >>> import flurries as fl
    >>> scene = fl.Scene(size=(320, 180), effects=[fl.Snow()])
    >>> flakes = fl.flakes(scene, 3)
    >>> bool((flakes["depth"] > 0.3).all())
    True
    """
    program = expect_scene(scene)._program
    frame = program.frame(scene._time_of(t))
    found = [drawn_of(part.effect, replace(frame, seed=part.seed)) for part in program.parts]
    known = [one for one in found if one is not None]
    return np.concatenate(known) if known else np.empty(0, FLAKE)


def expect_scene(scene: object) -> Scene:
    if not isinstance(scene, Scene):
        raise TypeError(f"scene must be a flurries.Scene, got {type(scene).__name__}")
    return scene


def _camera(path: CameraPath) -> str:
    moves = path.position is not None or path.velocity is not None
    does = {"moving": moves, "turning": path.turns, "zooming": path.zooms}
    words = " and ".join(word for word, yes in does.items() if yes)
    return f"{words or 'still'}, focal {path.camera.focal:g} px"


def _own_values(effect: object) -> str:
    """Return the fields of an effect that are not as they are without being given."""
    if not is_dataclass(effect):
        return ""
    changed = []
    for field in fields(effect):
        value = getattr(effect, field.name)
        usual = None if field.default is MISSING else field.default
        if not field.name.startswith("_") and repr(value) != repr(usual):
            changed.append(f"{field.name} {_value(value)}")
    return ", ".join(changed) or "as it is by default"


def _value(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"{value.dtype} array {value.shape}"
    if isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(value, tuple):
        return "(" + ", ".join(map(_value, value)) + ")"
    return f"{value:.4g}" if isinstance(value, float) else repr(value)
