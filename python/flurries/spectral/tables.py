"""Tables of waves: rates, amplitudes, phases, and what a frame rate does to them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from flurries import _contract as check
from flurries import _core
from flurries._contract import LARGEST, SMALLEST, ArrayLike, Float64
from flurries._warnings import warn

Aliasing: TypeAlias = Literal["cut", "soft", "keep"]

#: Bands of wavelengths in pixels that the sources name: the paper's three octaves (section 5.3),
#: and the upper three octaves of the slides of 2003.
BANDS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {"paper": (4.0, 32.0), "slides": (2.0, 16.0)}
)
# Cycles per frame from which "soft" fades waves out, where nobody says.
SOFT_FROM = 0.4
FLOAT64 = np.dtype(np.float64)

# Cycles of drift up to which phases are right to 2e-5 cycles; at 1e16 nothing is left of them.
FAR = 1e12


def band_of(wavelengths: object) -> tuple[float, float]:
    low, high = check.vector("wavelengths", wavelengths, 2)
    return float(low), float(high)


def _cycles(name: str, value: object, wavelength_max: object) -> list[float]:
    longest = check.real("wavelength_max", wavelength_max, low=SMALLEST, high=LARGEST)
    return [float(v) / longest for v in check.vector(name, value, 2)]


def tent_rate(
    shape: tuple[int, int], velocity: ArrayLike, *, wavelength_max: float = 32.0,
    loop: int | None = None, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Temporal frequency (H, W) of each wave on the tent surface, cycles per frame.

    It is ``-(a kx' + b ky') / |k'|`` with ``(a, b) = velocity / wavelength_max``, of at most its
    length, float64. Odd in k; 0 at dc. On a Nyquist line that axis' part of the numerator is 0, as
    the real field demands. `velocity` is the drift per frame; with `loop`, the frames after which
    the film shall repeat, rates are rounded to ``n / loop``, half to even.

    Langer 2004, Eq. 6 with the sign of Eq. 1: the printed sign moves the snow backwards
    (``docs/internals/deviations.md``, 1).
    """
    size = check.shape_of("shape", shape)
    drift = _cycles("velocity", velocity, wavelength_max)
    result = check.output(out, size, FLOAT64)
    frames = None if loop is None else float(check.integer("loop", loop, low=1, high=2**31 - 1))
    _core.tent_rate(result, drift, frames)
    return result


def velocity_from_paper(
    C: float, theta: float, *, period: float, wavelength_max: float = 32.0
) -> tuple[float, float]:
    """Drift per frame from the constants of the paper, pixels of the longest wave.

    It is ``C / period * wavelength_max * (cos theta, sin theta)``.

    Parameters
    ----------
    C : float
        Temporal frequency of the tent's ridge, cycles per `period`.
    theta : float
        Direction of motion in radians from +x towards +y; pi/2 falls down the screen.
    period : float
        The paper's T, frames.
    """
    frames = check.real("period", period, low=SMALLEST)
    longest = check.real("wavelength_max", wavelength_max, low=SMALLEST, high=LARGEST)
    speed = check.real("C", C, low=-LARGEST, high=LARGEST) / frames * longest
    angle = check.real("theta", theta)
    return speed * math.cos(angle), speed * math.sin(angle)


def band_amplitude(
    shape: tuple[int, int], *, wavelengths: tuple[float, float] = BANDS["paper"],
    exponent: float = 1.0, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Amplitude (H, W) of each wave: a band of wavelengths, falling as a power of the frequency.

    Squares sum to 1, so the field has variance 1. 0 at dc, float64. Langer 2004, sections 5.3 and
    5.4.

    Parameters
    ----------
    wavelengths : (shortest, longest)
        Pixels, ``2 <= shortest < longest``; waves with ``shortest < wavelength <= longest`` take
        part. One that holds no wave is refused, longer waves than the tile's are warned of. The
        default is the paper's three octaves, (2, 16) the slides'; see :data:`BANDS`.
    exponent : float
        Amplitude ~ ``|k| ** -exponent``; 1 gives octaves equal power, less makes finer snow.
    """
    size = check.shape_of("shape", shape)
    band = band_of(wavelengths)
    power = check.real("exponent", exponent)
    result = check.output(out, size, FLOAT64)
    _core.band_amplitude(result, band, power)
    warn_long(size, band)
    return result


def warn_long(tile: tuple[int, int], band: tuple[float, float]) -> None:
    """Warn of waves that do not exist."""
    if band[1] > max(tile):
        warn(
            f"wavelengths asks for waves up to {band[1]:g} px, but a tile of {tile[0]} x {tile[1]} "
            f"px holds none longer than {max(tile)} px"
        )


def warn_far(cycles: float) -> None:
    """Warn where float64 no longer holds the phase: the drift counts in whole cycles, too."""
    if cycles > FAR:
        warn(f"drift is {cycles:.1e} cycles: phases are off by over 1e-5 cycles beyond {FAR:g}")


def random_phase(
    shape: tuple[int, int], *, seed: int, tile: tuple[int, int] = (0, 0), out: Float64 | None = None
) -> Float64:
    """Random phases of a tile, odd in k so that the field is real, (H, W) float64.

    Cycles in [-1/2, 1/2), uniform over a whole turn: a hash of seed, `tile` (row, col) of the grid
    and wave, the same whatever else is computed. Bins that are their own mirror have 0 or -1/2.
    """
    size = check.shape_of("shape", shape)
    if not check.is_pair(tile):
        raise TypeError(f"tile must be (row, col), got {check._came(tile)}")
    row, col = (check.int64("tile", index) for index in tile)
    number = check.seed_of(seed)
    result = check.output(out, size, FLOAT64)
    _core.random_phase(result, number, (row, col))
    return result


def advance_phase(
    phase: ArrayLike, drift: ArrayLike, *, shift: ArrayLike = (0.0, 0.0),
    wavelength_max: float = 32.0, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Phases (H, W) after a displacement of the snow, float64.

    ``phase - (A kx' + B ky') / |k'| - (fx sx + fy sy)`` reduced to [-1/2, 1/2) cycles. At a drift
    of 1e6 times the wavelength it is right to 1e-9; beyond 1e12 times nothing is left. The paper
    multiplies where phases must be added (Langer 2004, section 5.2;
    ``docs/internals/deviations.md``, 6 and 7).

    Parameters
    ----------
    phase : (H, W)
        Cycles at time 0.
    drift, shift : (x, y)
        Displacements in pixels: of the wave of `wavelength_max`, and of all waves alike.
    """
    start = check.table("phase", phase)
    size = check.shape_of("phase", start.shape)
    cycles = _cycles("drift", drift, wavelength_max)
    warn_far(max(map(abs, cycles)))
    plane = check.vector("shift", shift, 2)
    result = check.output(out, size, FLOAT64, start)
    _core.advance_phase(result, start, cycles, plane.tolist())
    return result


def temporal_filter(
    amplitude: ArrayLike, velocity: ArrayLike, *, shift_rate: ArrayLike = (0.0, 0.0),
    alias: Aliasing = "cut", soft_from: float = SOFT_FROM, shutter: float = 0.0,
    renormalise: bool = False, wavelength_max: float = 32.0, out: Float64 | None = None,
) -> Float64:  # fmt: skip
    """Amplitudes (H, W) after what frames do to fast waves: aliasing and the open shutter.

    Langer 2004, section 5.5. The equal case, exactly half a cycle, is cut
    (``docs/internals/deviations.md``, 15). The result is float64.

    Parameters
    ----------
    amplitude : (H, W)
        Amplitudes of the waves.
    velocity, shift_rate : (x, y)
        Change per frame of the drift and of the shift, pixels; both count.
    alias : {"cut", "soft", "keep"}
        Waves of half a cycle per frame or more are dropped (the paper), fade out from `soft_from`
        on as cos^2 (nothing pops when the speed varies), or stay and run backwards.
    soft_from : float
        Cycles per frame, 0 to 1/2.
    shutter : float
        Exposure in frames, centred on the frame's time: a factor sinc(rate * shutter), whose
        negative lobes are kept.
    renormalise : bool
        Restore the power that the alias law took, before the shutter. Nothing kept gives zeros.
    """
    given = check.table("amplitude", amplitude)
    size = check.shape_of("amplitude", given.shape)
    drift = _cycles("velocity", velocity, wavelength_max)
    plane = check.vector("shift_rate", shift_rate, 2)
    law = check.choice("alias", alias, Aliasing)
    start = check.real("soft_from", soft_from)
    exposure = check.real("shutter", shutter, low=0.0, high=LARGEST)
    restore = check.flag("renormalise", renormalise)
    result = check.output(out, size, FLOAT64, given)
    _core.temporal_filter(result, given, drift, plane.tolist(), law, start, exposure, restore)
    return result


def temporal_gain(
    rate: ArrayLike, *, alias: str, soft_from: float = SOFT_FROM, shutter: float = 0.0
) -> Float64:
    """Return the factors of the amplitudes of waves of these rates, cycles per frame."""
    given = np.ascontiguousarray(rate, np.float64)
    gain = np.empty(given.shape)
    _core.temporal_gain(gain.reshape(-1), given.reshape(-1), alias, soft_from, shutter)
    return gain


def kept_power(cycles: float, alias: str, *, shutter: float = 0.0) -> float:
    """Return the share of the power of a large tile that aliasing and the shutter leave."""
    # A wave whose direction makes an angle b with the motion turns at c cos b cycles a frame,
    # whatever its wavelength; `cycles` is c, so that the share is a mean over b. For the cut alone
    # it is (2/pi) asin(1/(2c)) from c = 1/2 on.
    if cycles <= 0.0:
        return 1.0
    # Equal steps of the rate's angle, only where something is kept: fast motion keeps little.
    most = 1.0 if alias == "keep" else min(0.5 / cycles, 1.0)
    angle = math.asin(most) * (np.arange(4096) + 0.5) / 4096
    rate = cycles * np.sin(angle)
    kept = temporal_gain(rate, alias=alias, shutter=shutter) ** 2
    return float(kept.mean() * math.asin(most) / (0.5 * np.pi))


def wave_depth(wavelength: ArrayLike, *, near_depth: float, longest: float) -> Float64:
    """Return near_depth * longest / wavelength, the depths that waves stand for, or their waves."""
    # Each moves as a flake at its depth does. Infinite for 0, and 0 for what is infinite.
    with np.errstate(divide="ignore"):
        return np.asarray(near_depth * longest / np.asarray(wavelength, np.float64))
