"""A gas in plain float64 from the equations, every pixel of every particle: the kernels' judge."""

import math

import numpy as np
from scipy.special import erf, ndtr

RIM = math.exp(-4.5)
TAPER = 2 * math.pi - 9 * math.pi * RIM / (1 - RIM)
SQUARE = 2 * math.pi * math.erf(3 / math.sqrt(2)) ** 2


def taper(g):
    """Return a footprint lowered so that it ends at three sigma."""
    return np.maximum((g - RIM) / (1 - RIM), 0)


def box(edges, middle, radius):
    """Return the mean over each pixel of exp(-u^2/2), |u| <= 3, along one axis."""
    u = np.clip(3 * (edges - middle) / radius, -3, 3)
    return math.sqrt(math.pi / 2) * np.diff(erf(u / math.sqrt(2))) * radius / 3


def eq2(count, middle, radius, size=65):
    """Return Eq. 2 along one axis: a table laid over whole pixels, nearest entry."""
    width = max(1, math.floor(2 * radius + 0.5))
    left = math.floor(middle - width / 2 + 0.5)
    result = np.zeros(count)
    for j in range(max(left, 0), min(left + width, count)):
        entry = math.floor((j - left) * (size - 1) / (width - 1) + 0.5) if width > 1 else size // 2
        x = -3 + 6 * entry / (size - 1)
        result[j] = math.exp(-x * x / 2)
    return result


def opacity(shape, place, radius, density, focal, center, *, footprint="viewplane_c", edge="taper",
            near=0.1, near_mode="fade", depth=None, occlusion="soft"):  # fmt: skip
    height, width = shape
    x, y, z = place
    sigma = radius / 3
    if near_mode == "exact" and z < 4 * radius:
        footprint = "volume"
    sy, sx = (np.mgrid[:height, :width] + 0.5 - np.array(center)[::-1, None, None]) / focal
    d2 = sx**2 + sy**2 + 1
    if footprint != "volume":
        if near_mode == "cull":
            if z < near:
                return np.zeros(shape)
        elif near_mode == "fade" or z - near < radius:
            if z <= near:
                return np.zeros(shape)
            share = min(max((z - near) / sigma, 0.0), 1.0)
            density = density * share * share * (3 - 2 * share)
    size = math.inf
    if z > 0:
        size = focal * radius / z
        px, py = center[0] + focal * x / z, center[1] + focal * y / z
        if footprint not in ("viewplane", "table"):
            limits = [1.3 * max(abs(c), abs(n - c)) / focal
                      for c, n in zip(center, (width, height), strict=True)]  # fmt: skip
            slopes = [min(max(s, -m), m) for s, m in zip((x / z, y / z), limits, strict=True)]
            size *= (1 + slopes[0] ** 2 + slopes[1] ** 2) ** 0.25
    by_ray = footprint in ("viewpoint", "volume")
    if footprint == "table":
        g = np.outer(eq2(height, py, size), eq2(width, px, size))
        g = taper(g) if edge == "taper" else g
    elif size < 2 and (z > radius or not by_ray):
        g = np.outer(box(np.arange(height + 1), py, size), box(np.arange(width + 1), px, size))
        g = g * TAPER / SQUARE if edge == "taper" else g
    elif by_ray:
        cross = (y - z * sy) ** 2 + (z * sx - x) ** 2 + (x * sy - y * sx) ** 2
        dot = x * sx + y * sy + z
        if footprint == "volume":
            q2 = cross / d2 / sigma**2
        else:
            with np.errstate(divide="ignore"):
                q2 = np.where(dot > 0, cross * (x * x + y * y + z * z) / dot**2 / sigma**2, np.inf)
        g = np.exp(-q2 / 2)
        g = taper(g) if edge == "taper" else np.where(q2 <= 9, g, 0)
    else:
        u = 3 * (np.arange(width) + 0.5 - px) / size
        v = 3 * (np.arange(height) + 0.5 - py) / size
        g = np.outer(np.exp(-v * v / 2), np.exp(-u * u / 2))
        g = taper(g) if edge == "taper" else g * np.outer(np.abs(v) <= 3, np.abs(u) <= 3)
    alpha = density * g
    if footprint == "volume":
        length = np.sqrt(d2)
        along = (x * sx + y * sy + z) / length
        a = (near * length - along) / sigma
        ends = np.full(shape, np.inf) if depth is None or occlusion == "hard" else depth
        b = (ends * length - along) / sigma
        share = np.where(a > 0, ndtr(-a) - ndtr(-b), ndtr(b) - ndtr(a))
        alpha = alpha * np.clip(share, 0, 1)
    if depth is not None:
        if footprint == "viewpoint":
            # At the ray's closest approach: Phi((depth |d| - C . d / |d|) / sigma), hard its sign.
            clear = depth * np.sqrt(d2) - (x * sx + y * sy + z) / np.sqrt(d2)
            alpha = alpha * (clear > 0 if occlusion == "hard" else ndtr(clear / sigma))
        elif occlusion == "hard":
            alpha = np.where(z < depth, alpha, 0)
        elif footprint != "volume":
            alpha = alpha * ndtr((depth - z) / sigma)
    return alpha


def transmittance(shape, centers, radius, density, focal, *, center=None, offset=(0, 0, 0), **look):
    """Return T (H, W) and the particles' alphas in the order of their indices."""
    center = (shape[1] / 2, shape[0] / 2) if center is None else center
    each = np.broadcast_arrays(radius, density, np.zeros(len(centers)))[:2]
    alphas = [
        opacity(shape, np.subtract(place, offset), r, p, focal, center, **look)
        for place, r, p in zip(centers, *each, strict=True)
    ]
    through = np.ones(shape)
    for alpha in alphas:
        through = through * (1 - alpha)
    return through, alphas


def layer(shape, centers, radius, density, color, focal, **options):
    """Return premultiplied RGBA, back to front: the other way round than the kernel."""
    _, alphas = transmittance(shape, centers, radius, density, focal, **options)
    places = np.asarray(centers) - np.asarray(options.get("offset", (0, 0, 0)))
    by_ray = options.get("footprint", "viewplane_c") in ("viewpoint", "volume")
    key = np.sqrt((places**2).sum(axis=1)) if by_ray else places[:, 2]
    color = np.broadcast_to(color, (len(places), 3))
    result = np.zeros((*shape, 4))
    # Of equals the one with the lower index is in front.
    for i in sorted(range(len(places)), key=lambda i: (key[i], i), reverse=True):
        alpha = alphas[i][..., None]
        result = result * (1 - alpha) + alpha * np.append(color[i], 1)
    return result


def light(centers, radius, density, direction, forward):
    centers = np.asarray(centers, float)
    count = len(centers)
    radius, density = np.broadcast_to(radius, count), np.broadcast_to(density, count)
    way = np.asarray(direction, float) / np.linalg.norm(direction)
    beam = np.ones(count)
    order = np.argsort(centers @ way, kind="stable")
    for n, k in enumerate(order):
        for j in order[n + 1 :]:
            apart = centers[j] - centers[k]
            q = np.linalg.norm(apart - way * (apart @ way)) / (radius[k] / 3)
            a = density[k] * float(taper(math.exp(-q * q / 2)))
            beam[j] = beam[j] * (1 - a) + a * forward * beam[k]
    return beam
