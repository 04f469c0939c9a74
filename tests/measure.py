"""Velocities of bands of waves, measured on rendered frames: shifts are (x, y) px."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

import flurries as fl
from flurries import _core
from flurries.frame.truth import truth

Floats = NDArray[np.float64]

SIZE, NEAR, LONGEST = 512, 12.0, 32.0
FOCAL = 1.2 * SIZE
BOTH = {"haze": 0.0, "shutter": 0.0, "color": 1.0, "near_depth": NEAR}
# A map that only clips beyond 3 sigma, and flakes of some pixels: the middle of a smaller one's
# light is no clearer than its pixels.
TEXTURE = {**BOTH, "flakes": 0, "texture": 1.0, "mean": 0.5, "spread": 3.0, "power": 1.0,
           "wavelengths": (4.0, LONGEST)}  # fmt: skip
# One tile: the picture is a torus, whose Fourier bins are the waves themselves.
TORUS = {"tile": SIZE, "overlap": 0}
WAVES = (24.0, 12.0, 6.0)  # Waves that stand for 16, 32 and 64 m.

# Frames apart, to tell a jump from a motion: each half of the one before.
STEPS = (0.04, 0.02, 0.01)


def scene(snow: fl.effects.TentSnow | dict[str, Any], size: int = SIZE, **about: Any) -> fl.Scene:
    """Snow on black: a channel of the composite is the snow's own opacity."""
    black = np.zeros((size, size, 3), np.float32)
    effect = fl.effects.TentSnow(**snow) if isinstance(snow, dict) else snow
    return fl.Scene(background=black, effects=[effect], **about)


def drawn_of(air: Any) -> dict[int, Floats]:
    """What the kernel lists of the flakes before a data set's picture, by their numbers."""
    ids, rows, _ = _core.flake_rows(_core.fall(air.request()))
    return dict(zip(ids.tolist(), rows, strict=True))


def same_flakes(one: Any, other: Any, least: int = 100) -> tuple[Any, Any]:
    """The rows of the flakes that are in both lists, in one order."""
    _, here, there = np.intersect1d(one["id"], other["id"], return_indices=True)
    assert len(here) > least
    return one[here], other[there]


def frame_of(shown: fl.Scene, t: float = 0.0, effect: int = 0) -> fl.effects.Frame:
    return shown._program.views(t)[effect][1]


def picture(shown: fl.Scene, t: float, **options: Any) -> Floats:
    return shown.render(t, **options)[..., 0].astype(np.float64)


def cover(shown: fl.Scene, t: float) -> NDArray[np.float32]:
    """The opacity of all layers, without their motion and depth, which take as long again."""
    program = shown._program
    (seen,) = truth(program, shown._time_of(t), [None], program.base.window, known=False)
    return seen.alpha


def band_shift(pair: tuple[Floats, Floats], wavelength: float) -> tuple[Floats, float]:
    """How far a band of waves moves between two pictures that are tori, and its mean wavelength.

    Least squares of the phase steps against the frequencies of the bins within 4 % of the
    wavelength, weighted by their power. As a wave's speed goes with its wavelength, the fit stands
    for one of sum(p f)/sum(p f^2) px.
    """
    height, across = pair[0].shape
    first, second = (np.fft.rfft2(image - image.mean()) for image in pair)
    fy = np.fft.fftfreq(height)[:, None] + np.zeros(across // 2 + 1)
    fx = np.fft.rfftfreq(across) + np.zeros((height, 1))
    # The column fx = 0 stores both bins of a mirrored pair, all others one: count each pair once.
    ring = (abs(np.hypot(fx, fy) * wavelength - 1.0) < 0.04) & ((fx > 0.0) | (fy > 0.0))
    step = -np.angle((second * first.conj())[ring]) / (2.0 * np.pi)
    power = (abs(first) ** 2)[ring]
    f = np.stack([fx[ring], fy[ring]])
    length = np.hypot(*f)
    moved = np.linalg.solve((power * f) @ f.T, (power * f) @ step)
    return moved, float(np.sum(power * length) / np.sum(power * length**2))


def parallax(pair: tuple[Floats, Floats]) -> Floats:
    """(3, 2): of the bands WAVES, m px."""
    bands = [band_shift(pair, wavelength) for wavelength in WAVES]
    return np.array([moved * NEAR * LONGEST / mean for moved, mean in bands])


def largest_changes(
    frame: Callable[[float], Floats], times: Floats, steps: Sequence[float] = STEPS
) -> Floats:
    """Per step, the largest change of a pixel within it, from any of the times on."""
    changes = [[abs(frame(t + step) - now).max() for step in steps]
               for t, now in ((t, frame(t)) for t in times)]  # fmt: skip
    return np.max(changes, axis=0)


def smooth(changes: Floats) -> bool:
    """Whether half the step makes half the change; a jump is as large in any step."""
    return all(after < 0.65 * before for before, after in pairwise(changes))
