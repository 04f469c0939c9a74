"""A frame with what it is made of: layers, and what their pixels show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from flurries._contract import Array
from flurries._trace import current
from flurries.camera.lens import Camera
from flurries.frame.bands import Window, crop
from flurries.frame.layer import Layer
from flurries.frame.mixing import free_name
from flurries.frame.picture import Picture
from flurries.frame.program import Program
from flurries.frame.show import figure, listing
from flurries.frame.view import Shared
from flurries.io.color import light_of, to_single, to_unit


@dataclass(frozen=True, eq=False)
class RenderedLayer:
    """One effect's part of a frame; what an effect does not know is None.

    Attributes
    ----------
    rgba : (h, w, 4) float32
        Premultiplied color and opacity; `alpha` is the latter.
    depth : (h, w) float32 or None
        Planar depth, world units: at every pixel that of the flake or of the texture, whichever has
        more opacity there (a flake hides the texture behind it). The texture's is the depth that
        its wavelength of `motion` stands for. Infinity where nothing is. A veil (haze) has none.
    motion, backward : (h, w, 2) float32 or None
        From this frame, t, to t + 1 and to t - 1: pixels, (x, y), x right, y down. What is at p now
        will be at ``p + motion`` and was at ``p + backward``. Of a flake, the change of its place
        in the picture; of the texture, the one vector for each tile that predicts the other frame
        best (see `flurries.spectral.motion.tile_motions`), interpolated between tiles as they are
        blended. Flake or texture as in `depth`; 0 where nothing is.
    coverage : (h, w) float32 or None
        Opacity of what is drawn one by one, flakes and drops, without texture and veil.
    ids : (h, w) int64 or None
        The number of the flake or drop with the greatest opacity of its own at the pixel, -1 for
        none. A flake keeps its number from frame to frame, and from eye to eye.
    """

    rgba: Array
    depth: Array | None = None
    motion: Array | None = None
    backward: Array | None = None
    coverage: Array | None = None
    ids: Array | None = None

    @property
    def alpha(self) -> Array:
        """Opacity, (h, w) float32."""
        return self.rgba[..., 3]


@dataclass(frozen=True, eq=False, repr=False)
class Rendered:
    """A frame with its layers.

    Layers are in front of the background and behind the foreground, back to front, premultiplied,
    in the light of the composite: in float32 ``foreground over (layers over background)`` is the
    image, before it is rounded to integers. Where two sides of an edge are known, by alpha or a
    picture at a depth, the image has each behind its own weather. Of layers of one name the second
    is called "name2", and so on.

    Attributes
    ----------
    image : (h, w, 3 or 4)
        The composite, as `Scene.render` returns it.
    alpha : (h, w) float32
        Opacity of all layers together.
    layers : dict of str to RenderedLayer
        Each effect's part: `rgba`, `alpha`, `depth`, `motion`, `backward`, `coverage`, `ids`.
    depth : (h, w) float32 or None
        The background's planar depth, where the scene has one, world units.
    motion, backward, weather_depth : (h, w, 2), (h, w, 2), (h, w) float32 or None
        Of the layers together: at every pixel that of the layer that shows most, 0 or infinity
        where that layer has none. With a single layer it is the layer's own array.
    background : (h, w, 3 or 4) float32
        The background in the light of the composite, multiplied by alpha; foregrounds with a depth
        of their own, which stand in the weather, are part of it.
    foreground : (h, w, 4) float32 or None
        The foreground's picture, premultiplied; None without one. A mask is in the layers already.
    linear : bool
        Whether the light of the composite is linear; display values otherwise.
    """

    image: Array
    alpha: Array
    layers: dict[str, RenderedLayer]
    depth: Array | None = None
    motion: Array | None = None
    backward: Array | None = None
    weather_depth: Array | None = None
    background: Array | None = None
    foreground: Array | None = None
    linear: bool = True

    def __repr__(self) -> str:
        height, width = self.alpha.shape
        names = ", ".join(self.layers) or "none"
        return f"Rendered({width} x {height} px, {self.image.dtype}, layers={names})"

    def _repr_html_(self) -> str:
        cover = "opacity {:.3f} on average, {:.3f} at most".format
        rows = [
            (name, cover(float(layer.alpha.mean()), float(layer.alpha.max())))
            for name, layer in self.layers.items()
        ]
        return f"<div>{figure(self.image)}{listing(rows)}</div>"


def truth(
    program: Program, t: float, eyes: Sequence[Camera | None], window: Window, *, known: bool = True
) -> list[Rendered]:
    """Return the picture of a window for each eye, whole and exact, with the layers apart."""
    # Without `known` there are colors and opacities alone, no motion, depth, coverage and ids.
    cameras = tuple(program.camera(eye, t) for eye in eyes)
    shared = Shared(cameras, window)
    return [_truth(program, t, camera, window, shared, known) for camera in cameras]


def _truth(
    program: Program, t: float, camera: Camera, window: Window, shared: Shared, known: bool
) -> Rendered:
    with current.get().stage("background"):
        plate = crop(program.backdrop.frame(t), window)
    front, mix = program.front(t), program.mix(plate)
    front = front and front.window(window)
    asks = [ask.derive(shared=shared, whole=known) for ask in program.asks(t, camera, window, None)]
    parts: list[Layer] = []
    image = Picture(asks, mix, plate, front, window, window, shown=parts).compose(window, None)
    layers: dict[str, RenderedLayer] = {}
    for part in parts:
        layers[free_name(part.name, layers)] = RenderedLayer(
            mix.rgba(part), part.depth, part.motion, part.backward, part.coverage, part.ids
        )
    alphas = [part.alpha for part in parts]
    cover = alphas[0] if parts else np.zeros(plate.shape[:2], np.float32)
    for alpha in alphas[1:]:
        cover = 1.0 - (1.0 - cover) * (1.0 - alpha)
    most = _most(alphas if len(alphas) > 1 else ())
    depth = None if program.distance is None else program.depth_at(t)
    behind = mix.plate(plate)
    if front is not None and front.deep is not None:
        # What stands in the weather is a part of the background.
        behind = to_single(to_unit(front.behind(mix.decode(plate), linear=mix.linear)))
    return Rendered(
        image=image, alpha=cover, layers=layers,
        depth=None if depth is None else crop(depth, window),
        motion=_chosen([part.motion for part in parts], most, 0.0),
        backward=_chosen([part.backward for part in parts], most, 0.0),
        weather_depth=_chosen([part.depth for part in parts], most, np.inf), background=behind,
        foreground=None if front is None else front.rgba(linear=mix.linear), linear=mix.linear,
    )  # fmt: skip


def _most(alphas: Sequence[Array]) -> Array:
    """Return at every pixel which of layers, back to front, shows most, -1 where none does."""
    most = np.full(alphas[0].shape if alphas else (), -1, np.int16)
    strongest: Array | float = 0.0
    through: Array | float = 1.0
    for number in reversed(range(len(alphas))):
        shows = alphas[number] * through
        # Of what shows as much the front.
        np.copyto(most, number, where=shows > strongest)
        strongest = np.maximum(strongest, shows)
        through = through * (1.0 - alphas[number])
    return most


def _chosen(planes: Sequence[Array | None], most: Array, unknown: float) -> Array | None:
    """Return at every pixel the plane of the layer that shows most; None where no layer has one."""
    # Where a layer shows most that has no plane, it is `unknown`: another layer's would be wrong.
    known = next((plane for plane in planes if plane is not None), None)
    if known is None or len(planes) == 1:
        return known
    found = np.full_like(known, unknown, order="C")
    for number, plane in enumerate(planes):
        if plane is not None:
            # A pixel's two numbers as one: a mask over pairs is several times slower.
            into, of = (
                one.view(np.complex64)[..., 0] if one.ndim == 3 else one for one in (found, plane)
            )
            np.copyto(into, of, where=most == number)
    return found


# The layers of a frame under the names that files and compositors have for them.


def planes(rendered: Rendered, *, up: bool, plate: bool, whole: bool) -> dict[str, Array]:
    """Return a frame as the layers of an EXR, see `flurries.io.write_layers`."""

    def turned(motion: Array | None) -> Any:
        return motion * np.array([1.0, -1.0], np.float32) if up and motion is not None else motion

    # A composite of 8 bits shows no more of its layers.
    short = _short if rendered.image.dtype == np.uint8 and not whole else np.asarray
    found: dict[str, Array | None] = {}
    if plate:
        found = {
            "rgba": opaque(rendered.image), "background": rendered.background,
            "foreground": rendered.foreground, "depth": rendered.depth,
        }  # fmt: skip
    if len(rendered.layers) != 1:
        # What one layer says of itself would stand there twice.
        found |= {
            "alpha": short(rendered.alpha), "weather.depth": rendered.weather_depth,
            "forward": turned(rendered.motion), "backward": turned(rendered.backward),
        }  # fmt: skip
    for name, layer in rendered.layers.items():
        cover = None if layer.coverage is None else short(layer.coverage)
        found |= {
            name: short(layer.rgba), f"{name}.depth": layer.depth, f"{name}.coverage": cover,
            f"{name}.forward": turned(layer.motion), f"{name}.backward": turned(layer.backward),
            f"{name}.id": None if layer.ids is None else np.maximum(layer.ids, 0),
        }  # fmt: skip
    return {name: plane for name, plane in found.items() if plane is not None}


def _short(values: Array) -> Array:
    """Round to 9 bits: what a difference of large numbers loses."""
    large: Array = values * np.float32(2**15 + 1)
    return np.asarray(large - (large - values))


def opaque(image: Array) -> Array:
    """Return an image as premultiplied light with alpha, which is 1 where it has none."""
    light = light_of(image)
    alpha = np.ones_like(light[..., :1])
    return light if light.shape[2] == 4 else np.concatenate([light, alpha], axis=2)


def order(rendered: Rendered) -> str:
    front = [] if rendered.foreground is None else ["foreground"]
    return ", ".join(["background", *rendered.layers, *front])


def weather(rendered: Rendered) -> Array:
    """Return (H, W, 4) float32: the layers over each other, premultiplied."""
    whole = np.zeros((*rendered.alpha.shape, 4), np.float32)
    for layer in rendered.layers.values():
        whole = layer.rgba + (1.0 - layer.rgba[..., 3:]) * whole
    return whole
