"""A frame's weather as deep samples: what each slice of the air adds to a pixel."""

import numpy as np

from flurries._contract import Array
from flurries.frame.truth import truth
from flurries.io.color import to_linear
from flurries.io.layers.deep import Deep
from flurries.scene.depth import Distance
from flurries.scene.numbered import Planes
from flurries.scene.scene import Scene

# Slices of the air, and the first depth at which one ends: 32 to a distance of 256, each 1.28
# times as far as the one before.
SLICES, FIRST, LAST = 31, 0.15, 256.0

# What is fainter waits for the next slice; the last one takes what is left down to the second.
_FAINT, _FAINTEST = 1.0 / 512.0, 1e-4

# Samples of a frame: each is handed to the writer number by number.
MOST_SAMPLES = 1 << 24


def deep_of(scene: Scene, number: float) -> Deep:
    """Return the weather of a frame as deep samples, without background and foreground."""
    there = scene._depth_at(number)
    limit = np.full(scene._shape, 2.0 * LAST, np.float32)
    if there is not None:
        limit = np.where(np.isfinite(there), there, limit).astype(np.float32)
    whole = _layers(scene, number)
    # What has been written of each effect, and up to which depth.
    written = {name: np.zeros(limit.size, np.float32) for name in whole}
    begun = {name: np.zeros(limit.size, np.float32) for name in whole}
    pixels, samples, total = [], [], 0
    for edge in [*np.geomspace(FIRST, LAST, SLICES).tolist(), np.inf]:
        last = edge == np.inf
        layers = whole if last else _before(scene, number, edge)
        end = np.minimum(limit, edge).ravel()
        for name, layer in whole.items():
            light, past = layer.reshape(-1, 4), written[name]
            now = cover = light[:, 3]
            if not last:
                now = np.clip(layers[name][..., 3].ravel(), past, np.maximum(cover, past))
            share = (now - past) / np.maximum(1.0 - past, 1e-6)
            shown = np.flatnonzero(share >= (_FAINTEST if last else _FAINT))
            total += len(shown)
            if total > MOST_SAMPLES:
                raise ValueError(
                    f"deep: frame {number:g} has more than {MOST_SAMPLES} samples; take a smaller "
                    "frame, or fewer effects to a file"
                )
            part = share[shown, None]
            color = light[shown, :3] * (part / np.maximum(cover[shown, None], 1e-6))
            ends = begun[name][shown, None], end[shown, None]
            pixels.append(shown)
            samples.append(np.concatenate([color, part, *ends], axis=1))
            past[shown] = now[shown]
            begun[name][shown] = end[shown]
    pixel, values = np.concatenate(pixels), np.concatenate(samples)
    values = values[np.lexsort((values[:, 5], values[:, 4], pixel))]
    if not scene._linear:
        # Premultiplied display colors as light.
        cover = np.maximum(values[:, 3:4], 1e-6)
        values[:, :3] = to_linear(values[:, :3] / cover, "display") * cover
    counts = np.bincount(pixel, minlength=limit.size).reshape(scene._shape)
    return Deep(counts, values)


def _before(scene: Scene, number: float, edge: float) -> dict[str, Array]:
    """Return the layers of a frame before a wall."""
    far = scene._distance or Distance.of_planes(Planes(np.full(scene._shape, np.inf, np.float32)))
    return _layers(scene._derive(depth=edge, _distance=far.up_to(edge)), number)


def _layers(scene: Scene, number: float) -> dict[str, Array]:
    """Return the layers of a frame, without what else is known of them."""
    t = scene._time_of(number)
    (seen,) = truth(scene._program, t, [None], scene._program.base.window, known=False)
    return {name: layer.rgba for name, layer in seen.layers.items()}
