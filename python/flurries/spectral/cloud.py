"""Motion Clouds: random textures by frequency, orientation and speed, each with a bandwidth."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from flurries import _contract as check
from flurries._contract import SMALLEST
from flurries.spectral.tables import random_phase
from flurries.spectral.texture import Texture

# Rows of tiles that no picture has: their hashes draw speeds, and no phases.
_SPEEDS = ((-1, 0), (-1, 1))


def cloud(
    tile: int | tuple[int, int], velocity: npt.ArrayLike, *, seed: int, frequency: float = 0.125,
    frequency_bandwidth: float = 0.5, orientation: float = 0.0,
    orientation_bandwidth: float | None = None, speed_bandwidth: float = 0.0,
    loop: int | None = None,
) -> Texture:  # fmt: skip
    """Texture of a Motion Cloud: waves around one frequency, orientation and velocity.

    Bandwidths are standard deviations of the power of the film.

    Parameters
    ----------
    tile : int or (rows, cols)
        Size of the texture in pixels; :func:`movie` and :func:`field` of this shape have no seam.
    velocity : (vx, vy)
        Pixels per frame of all waves.
    seed : int
        Draws the speeds.
    frequency : float
        Cycles per pixel, above 0 and at most 1/2.
    frequency_bandwidth : float
        Octaves around it, above 0.
    orientation : float
        Direction in which the waves rise and fall, radians from +x towards +y; bars stand across.
    orientation_bandwidth : float, optional
        Radians around it, above 0; if not given all directions are alike.
    speed_bandwidth : float
        Pixels per frame by which waves are faster or slower along their own direction.
    loop : int, optional
        Frames after which the film shall repeat: rates are rounded to ``n / loop``.

    Returns
    -------
    Texture
        Its envelope has the power ``exp(-o^2 / (2 b^2)) / f^2`` at o octaves from `frequency`,
        times ``exp(-a^2 / (2 b^2))`` at an angle a from `orientation`, a up to a right angle; its
        rate is ``-(fx vx + fy vy) + speed_bandwidth f n``, n one normal number for each wave.

    Notes
    -----
    After J. Leon and others, "Motion Clouds", J. Neurophysiology 107 (2012), whose bandwidths are
    of amplitudes: B_V and B_theta are ``sqrt(2)`` times these, and B_sf is ``frequency *
    (2 ** (sqrt(2) * frequency_bandwidth) - 1)``. There each wave has many rates and comes and goes;
    here it has one, so that frames are pure and each has the same contrast.
    """
    sides, _ = check.tile_of(tile, 0)
    vx, vy = check.vector("velocity", velocity, 2)
    number = check.seed_of(seed)
    middle = check.real("frequency", frequency, above=0.0, high=0.5)
    octaves = check.real("frequency_bandwidth", frequency_bandwidth, low=1e-3, high=1e3)
    boiling = check.real("speed_bandwidth", speed_bandwidth, low=0.0, high=1e6)
    fy, fx = np.meshgrid(*map(np.fft.fftfreq, sides), indexing="ij")
    radius = np.hypot(fx, fy)
    radius[0, 0] = SMALLEST
    envelope = np.exp(-0.25 * (np.log2(radius / middle) / octaves) ** 2) / radius
    angle = check.real("orientation", orientation)
    if orientation_bandwidth is not None:
        width = check.real("orientation_bandwidth", orientation_bandwidth, low=1e-3, high=1e3)
        # A wave and its opposite are one: the angle counts up to a right one.
        off = np.arctan(np.tan(np.arctan2(fy, fx) - angle))
        envelope *= np.exp(-0.25 * (off / width) ** 2)
    if not envelope.any():
        raise ValueError(
            f"frequency_bandwidth must reach a wave of the tile {sides}, got {octaves:g} octaves "
            f"around {middle:g} cycles a pixel"
        )
    size, turn = (random_phase(sides, seed=number, tile=place) for place in _SPEEDS)
    # Normal numbers that are odd in k, as rates of a real field are (Box and Muller).
    normal = np.sqrt(-2.0 * np.log(np.maximum(2.0 * np.abs(size), SMALLEST)))
    normal *= np.sin(2.0 * np.pi * turn)
    rate = boiling * radius * normal - (fx * vx + fy * vy)
    if loop is not None:
        frames = check.integer("loop", loop, low=1, high=2**31 - 1)
        rate = np.rint(rate * frames) / frames
    return Texture(tile=sides, overlap=0, envelope=envelope, rate=rate)
