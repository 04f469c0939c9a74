"""The double cone in plain float64 by matrices, unit vectors, differences and sums of texels."""

import math

import numpy as np
from scipy.spatial.transform import Rotation

DOWN = np.array([0.0, 1.0, 0.0])


def basis(axis):
    """Return axis, first, second: x and z turned as the default axis is to become the wanted."""
    a = np.asarray(axis, float) / np.linalg.norm(axis)
    normal = np.cross(DOWN, a)
    sine, cosine = np.linalg.norm(normal), DOWN @ a
    if sine < 1e-12:
        return (a, np.array([1.0, 0, 0]), np.array([0, 0, 1.0 if cosine > 0 else -1.0]))
    turn = Rotation.from_rotvec(normal / sine * math.atan2(sine, cosine))
    return a, turn.apply([1.0, 0.0, 0.0]), turn.apply([0.0, 0.0, 1.0])


def directions(points, camera, shape):
    cx, cy = camera.principal(shape)
    x, y = np.asarray(points, float).T
    local = np.stack([x - cx, y - cy, np.full_like(x, camera.focal)], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    return local @ Rotation.from_rotvec(camera.rotation).as_matrix().T


def hit(d, axis, slope):
    """Return azimuth in turns and height of unit rays that start in the cone's middle."""
    a, e1, e2 = basis(axis)
    s, p, q = d @ a, d @ e1, d @ e2
    ce = np.sqrt(p * p + q * q)
    turn = np.degrees(np.arctan2(q, p)) / 360.0
    return np.mod(turn, 1.0) % 1.0, s / (ce + slope * np.abs(s))


def fade(d, axis):
    s = d @ basis(axis)[0]
    ce = np.sqrt(np.maximum(1.0 - s * s, 0.0))
    t = np.clip((0.2 * abs(s) / (ce + 0.2 * abs(s)) - 0.6) / 0.35, 0.0, 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)


def centres(shape):
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    return np.stack([x.ravel(), y.ravel()], axis=1)


def steps(points, camera, shape, axis, slope, h=1e-4):
    """Return how much azimuth (turns) and height change per pixel, by central differences."""
    squares = np.zeros((2, len(points)))
    for move in (np.array([h, 0.0]), np.array([0.0, h])):
        ahead, behind = (
            hit(directions(points + sign * move, camera, shape), axis, slope) for sign in (1, -1)
        )
        turned = ahead[0] - behind[0]
        turned -= np.round(turned)
        squares += np.stack([turned, ahead[1] - behind[1]]) ** 2 / (2 * h) ** 2
    return np.sqrt(squares)


def box(tile, u, v, width, height):
    """Return the mean over a box of a repeated tile, texel by texel; coordinates in texels."""
    size = len(tile)

    def shares(middle, length):
        low, high = middle - length / 2, middle + length / 2
        cells = np.arange(math.floor(low), math.floor(high) + 1)
        part = np.minimum(high, cells + 1) - np.maximum(low, cells)
        weights = np.zeros(size)
        np.add.at(weights, cells % size, np.maximum(part, 0.0) / length)
        return weights

    return shares(v, height) @ tile @ shares(u, width)


def layer(shape, camera, tile, *, axis, phase, stretch=1.0, slope=0.0, repeats=4,
          offset=(0.0, 0.0), gain=1.0):  # fmt: skip
    tile = np.asarray(tile, float)
    points = centres(shape)
    rays = directions(points, camera, shape)
    azimuth, height = hit(rays, axis, slope)
    around, up = steps(points, camera, shape, axis, slope)
    size, along = len(tile), repeats / (2 * math.pi) / stretch
    alpha = np.zeros(len(points))
    shown = fade(rays, axis)
    for i in np.flatnonzero(shown):
        u = azimuth[i] * repeats + offset[0]
        v = height[i] * along - phase + offset[1]
        width = min(max(around[i] * repeats * size, 1.0), repeats * size)
        tall = max(up[i] * along * size, 1.0)
        alpha[i] = box(tile, u * size, v * size, width, tall)
    return np.clip(alpha * shown * gain / stretch, 0.0, 1.0).reshape(shape)


def point_alpha(points, shape, camera, tile, *, axis, phase, stretch=1.0, slope=0.0, repeats=4,
                offset=(0.0, 0.0)):  # fmt: skip
    """Return alpha at positions, without any filter: the texel that is hit, times the fade."""
    tile = np.asarray(tile, float)
    rays = directions(points, camera, shape)
    azimuth, height = hit(rays, axis, slope)
    size, along = len(tile), repeats / (2 * math.pi) / stretch
    u = np.floor((azimuth * repeats + offset[0]) * size).astype(int) % size
    v = np.floor((height * along - phase + offset[1]) * size).astype(int) % size
    return tile[v, u] * fade(rays, axis) / stretch


def supersampled(shape, camera, tile, *, per_side=10, **given):
    """Return alpha as the mean of per_side x per_side positions of each pixel."""
    total = np.zeros(shape[0] * shape[1])
    middle = centres(shape)
    for dy in (np.arange(per_side) + 0.5) / per_side - 0.5:
        for dx in (np.arange(per_side) + 0.5) / per_side - 0.5:
            total += point_alpha(middle + np.array([dx, dy]), shape, camera, tile, **given)
    return (total / per_side**2).reshape(shape)


def drops(size, rows):
    """Return a toroidal texture of (u, v, sigma, half length, opacity), texel by texel."""
    y, x = np.mgrid[:size, :size] + 0.5
    clear = np.ones((size, size))
    for u, v, sigma, half, opacity in rows:
        variance = max(sigma**2 + 1 / 12, 0.38)
        area = [
            2 * half * math.sqrt(2 * math.pi * s) + 2 * math.pi * s for s in (sigma**2, variance)
        ]
        du, dv = x - u, y - v
        du, dv = du - size * np.round(du / size), dv - size * np.round(dv / size)
        dv = np.maximum(np.abs(dv) - half, 0.0)
        clear *= 1 - opacity * area[0] / area[1] * np.exp(-(du**2 + dv**2) / (2 * variance))
    return 1 - clear
