"""What flakes look like, in plain float64, slow and independent: the judge of the kernels."""

import math
from fractions import Fraction

import numpy as np
from scipy.special import erf, erfc

import twin

STREAM = int.from_bytes(b"flakebox", "big")


def unit(seed: int, index: int, word: int) -> float:
    return float(twin.unit(twin.hashed(seed, STREAM, index, word))[0])


def position(index, box, seed, velocity, time, center, axis) -> Fraction:
    """Return one coordinate exactly, without sway."""
    side, middle = Fraction(box), Fraction(center)
    start = Fraction(box * unit(seed, index, axis))
    x = start + Fraction(velocity) * Fraction(time) - middle
    return middle + x - side * math.floor(x / side + Fraction(1, 2))


def rim(u: np.ndarray) -> np.ndarray:
    """Return the end of the footprint: 1 inside 3 sigma, 0 from 4 sigma."""
    t = np.clip(u - 3, 0, 1)
    return 1 - t * t * (3 - 2 * t)


def swept(s: np.ndarray, length: float) -> np.ndarray:
    """Return G of a segment of `length` sigma, s measured from its start."""
    if length < 1e-3:
        x = s - length / 2
        return np.exp(-x * x / 2) * (1 + length**2 * (x * x - 1) / 24)
    a, b = s / math.sqrt(2), (s - length) / math.sqrt(2)
    right, left = erfc(b) - erfc(a), erfc(-a) - erfc(-b)
    between = erf(a) - erf(b)
    total = np.where(b > 0, right, np.where(a < 0, left, between))
    return math.sqrt(math.pi / 2) / length * total


def share(sigma2: float, effective: float) -> float:
    """Return amplitude over opacity; the second factor makes up for the end of the footprint."""
    return sigma2 / effective * (1 + 4.8e-4 / effective)


def image(flake: dict, focal: float, center, offset, near: float):
    p = np.asarray(flake["point"], float) - np.asarray(offset, float)
    travel = np.asarray(flake.get("velocity", (0, 0, 0)), float) * flake.get("shutter", 0.0)
    ends = [-0.5, 0.5]
    depths = [p[2] + when * travel[2] for when in ends]
    if max(depths) < near:
        return None
    for k in (0, 1):
        if depths[k] < near:
            ends[k] = (near - p[2]) / travel[2]
    depth = p[2] + 0.5 * (ends[0] + ends[1]) * travel[2]
    sigma2 = (focal * flake["radius"] / (3 * depth)) ** 2
    effective = max(sigma2 + 1 / 12, 0.38)
    amplitude = flake["opacity"] * (ends[1] - ends[0]) * share(sigma2, effective)
    places = []
    for when in ends:
        x, y, z = p + when * travel
        z = max(z, near)
        places.append(np.array([center[0] + focal * x / z, center[1] + focal * y / z]))
    along = places[1] - places[0]
    length = float(np.hypot(*along))
    along = along / length if length > 1e-6 else np.array([1.0, 0.0])
    start = places[0] if length > 1e-6 else (places[0] + places[1]) / 2
    length = length if length > 1e-6 else 0.0
    return start, along, length, math.sqrt(effective), amplitude, depth


def splat(shape, flakes, focal, *, center=None, offset=(0, 0, 0), near=0.1, depth_map=None):
    height, width = shape
    center = (width / 2, height / 2) if center is None else center
    y, x = np.mgrid[:height, :width] + 0.5
    log = np.zeros(shape)
    for flake in flakes:
        seen = image(flake, focal, center, offset, near)
        if seen is None:
            continue
        start, along, length, sigma, amplitude, depth = seen
        dx, dy = (x - start[0]) / sigma, (y - start[1]) / sigma
        s, q = dx * along[0] + dy * along[1], dy * along[0] - dx * along[1]
        span = length / sigma
        alpha = amplitude * np.exp(-q * q / 2) * swept(s, span)
        if span < 1:
            # Hardly a direction: the footprint ends along the pixel axes.
            x_span, y_span = along * span
            alpha *= rim(np.abs(dx - x_span / 2) / math.sqrt(1 + x_span**2 / 12))
            alpha *= rim(np.abs(dy - y_span / 2) / math.sqrt(1 + y_span**2 / 12))
        else:
            alpha *= rim(np.abs(q)) * rim(np.maximum(-s, s - span))
        if depth_map is not None:
            alpha = np.where(depth_map < depth, 0, alpha)
        with np.errstate(divide="ignore"):
            log += np.log1p(-alpha)
    return -np.expm1(log)
