"""A street of houses in perspective, by day under clouds and at night with lamps, and its depth.

The pictures are computed: rays meet the ground, two rows of houses, cars, trunks and lamp posts.
`make_looks.py --plates` writes them.
"""

from __future__ import annotations

import numpy as np

WIDTH, HEIGHT, FINE = 1280, 800, 2
FOCAL = 1.2 * WIDTH
EYE = 1.6  # Metres above the ground.
HALF = 5.5  # Metres from the middle of the street to the houses.
WALK = 3.6  # Metres to the pavement.
FAR = 130.0
LAMPS = tuple(
    (side * 3.3, 4.6, z) for z, side in ((7.0, -1), (14.0, 1), (22.0, -1), (31.0, 1), (42.0, -1))
)


def _hash(*numbers: np.ndarray | int) -> np.ndarray:
    """Return numbers from 0 to 1 that depend on whole numbers."""
    key: np.ndarray = np.zeros(np.broadcast_shapes(*(np.shape(n) for n in numbers)), np.uint64)
    for number in numbers:
        key = (
            key ^ (np.asarray(number).astype(np.int64).astype(np.uint64) + np.uint64(0x9E37))
        ) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    return (key >> np.uint64(40)) / float(1 << 24)


def _noise(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    """Return smooth noise from 0 to 1 at places."""
    i, j = np.floor(x), np.floor(y)
    u, v = (t * t * (3.0 - 2.0 * t) for t in (x - i, y - j))
    corner = [[_hash(i + a, j + b, seed) for a in (0, 1)] for b in (0, 1)]
    top, low = (c[0] + u * (c[1] - c[0]) for c in corner)
    return top + v * (low - top)


def _fractal(x: np.ndarray, y: np.ndarray, seed: int) -> np.ndarray:
    return sum(0.5 ** (k + 1) * _noise(x * 2**k, y * 2**k, seed + k) for k in range(4))


def _lit(x: np.ndarray, h: np.ndarray, z: np.ndarray, facing: str) -> np.ndarray:
    """Return the light of the street lamps on places, (..., 3)."""
    warm, found = np.array([1.0, 0.62, 0.3]), np.zeros((*x.shape, 3))
    for lx, lh, lz in LAMPS:
        square = (x - lx) ** 2 + (h - lh) ** 2 + (z - lz) ** 2
        cosine = {"up": lh - h, "in": np.abs(x - lx) + 0.0 * x}[facing] / np.sqrt(square)
        found += (
            5.0 * warm * (np.maximum(cosine, 0.0) / np.maximum(square, 0.05))[..., None] / np.pi
        )
    return found


def street(night: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return linear light (H, W, 3) and depth in metres (H, W), infinity in the sky."""
    rows, columns = np.indices((HEIGHT * FINE, WIDTH * FINE)).astype(float)
    dx = ((columns + 0.5) / FINE - WIDTH / 2) / FOCAL
    dy = ((rows + 0.5) / FINE - 0.56 * HEIGHT) / FOCAL
    sky = (0.015, 0.018, 0.028) if night else (0.66, 0.69, 0.73)
    clouds = 0.85 + 0.3 * _fractal(3.0 * dx + 5.0, 6.0 * dy + 3.0, 9)
    light = np.array(sky) * clouds[..., None]
    depth = np.full(dx.shape, np.inf)
    base = 0.035 if night else 0.62  # The sky's light on what lies below.

    def put(where: np.ndarray, z: np.ndarray, color: np.ndarray) -> None:
        nearer = where & (z < depth)
        depth[nearer] = z[nearer] if np.ndim(z) else z
        light[nearer] = color[nearer]

    # The ground: a wet road between two white pavements.
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(dy > 1e-6, EYE / np.maximum(dy, 1e-6), np.inf)
    x = dx * np.minimum(z, 1e4)
    wheel = np.exp(-(((np.abs(x) - 1.4) / 0.28) ** 2))
    white = np.clip(
        _fractal(0.9 * x, 0.5 * np.minimum(z, 1e4), 3) * 1.9 - 0.55 - 0.75 * wheel, 0.0, 1.0
    )
    white = np.where(np.abs(x) > WALK - 0.2, 0.93, 0.75 * white)
    tone = (0.07 + white * 0.75)[..., None] * np.array([0.97, 1.0, 1.04])
    ground = tone * (base + (_lit(x, 0.0 * x, z, "up") if night else 0.0))
    put(np.isfinite(z) & (z < FAR), z, ground)
    for side in (-1, 1):
        with np.errstate(divide="ignore"):
            z = np.where(side * dx > 1e-6, HALF / np.maximum(side * dx, 1e-6), np.inf)
        h = EYE - dy * np.minimum(z, 1e4)
        house = np.floor((z + (3.0 if side > 0 else 0.0)) / 9.0)
        along = np.mod(z + (3.0 if side > 0 else 0.0), 9.0)
        height = 7.5 + 4.5 * _hash(house, side + 5)
        tint = np.stack([0.16 + 0.2 * _hash(house, side + 7, c) for c in range(3)], -1)
        tint = 0.6 * tint.mean(-1, keepdims=True) + 0.4 * tint
        wall = tint * (0.8 + 0.4 * _fractal(2.0 * z, 3.0 * h, 21))[..., None]
        floor, bay = np.floor((h - 0.9) / 3.0), np.floor(along / 1.8)
        u, v = np.mod(along, 1.8) / 1.8, np.mod(h - 0.9, 3.0) / 3.0
        pane = (u > 0.28) & (u < 0.72) & (v > 0.12) & (v < 0.68) & (h > 0.9) & (h < height - 0.9)
        sill = (u > 0.22) & (u < 0.78) & (v > 0.05) & (v <= 0.12) & (h > 0.9) & (h < height - 0.9)
        shade = base * (0.55 if side < 0 else 0.75)
        color = wall * (shade + (_lit(np.full_like(z, side * HALF), h, z, "in") if night else 0.0))
        glass = np.array([0.05, 0.055, 0.06]) * base * (1.0 + 2.0 * v)[..., None]
        if night:
            on = _hash(house, floor, bay, side + 11) > 0.68
            glow = np.array([0.55, 0.36, 0.16]) * (0.5 + _hash(house, floor, bay, 13))[..., None]
            glass = np.where(on[..., None], glow, glass)
        color = np.where(pane[..., None], glass, color)
        color = np.where(
            (sill | (h > height - 0.35))[..., None], 0.85 * (shade + 0.1 * base), color
        )
        put(np.isfinite(z) & (z < FAR) & (h >= 0.0) & (h < height) & (along < 8.7), z, color)
    # Boxes that face the camera: cars, tree trunks, lamp posts, a person with an umbrella's width.
    cars = [
        (-2.6, 9.5, (0.03, 0.035, 0.05)),
        (2.65, 13.0, (0.12, 0.02, 0.02)),
        (-2.6, 19.0, (0.1, 0.1, 0.1)),
        (2.6, 26.0, (0.02, 0.04, 0.07)),
    ]
    for cx, cz, paint in cars:
        x, h = dx * cz - cx, EYE - dy * cz
        body = (np.abs(x) < 0.85) & (h > 0.25) & (h < 0.85 + 0.05 * (1 - (x / 0.85) ** 2))
        cabin = (np.abs(x) < 0.68 - 0.25 * (h - 0.85)) & (h >= 0.85) & (h < 1.42)
        snow = (np.abs(x) < 0.56) & (h >= 1.36) & (h < 1.5)
        shine = (0.6 + 0.6 * np.clip(h - 0.3, 0, 1))[..., None]
        own = base * np.array(paint) * 1.8 * shine
        if night:
            own = own + 0.25 * np.array(paint) * _lit(
                np.full_like(x, cx), h, np.full_like(x, cz - 1.0), "up"
            )
        put(body, np.full_like(x, cz), own)
        put(
            cabin,
            np.full_like(x, cz),
            np.broadcast_to(0.09 * base * np.array([0.8, 0.9, 1.0]), light.shape),
        )
        put(snow, np.full_like(x, cz), np.broadcast_to(0.75 * base * np.ones(3), light.shape))
        lamp = (np.abs(np.abs(x) - 0.68) < 0.12) & (np.abs(h - 0.72) < 0.06)
        put(
            lamp,
            np.full_like(x, cz - 0.01),
            np.broadcast_to(np.array([0.5, 0.02, 0.015]) * (1.0 if night else 0.4), light.shape),
        )
    for cx, cz in ((-4.2, 11.5), (4.3, 17.0), (-4.3, 27.0), (4.3, 36.0)):
        x, h = dx * cz - cx, EYE - dy * cz
        bend = 0.07 * np.sin(1.3 * h + cz)
        tree = (np.abs(x - bend) < 0.16 - 0.02 * h) & (h > 0) & (h < 5.5)
        for number in range(13):
            reach, start = 0.7 + 1.1 * _hash(number, int(cz)), 1.9 + 0.3 * number
            side = 1.0 if number % 2 else -1.0
            out = side * (x - bend)
            line = np.abs(h - start - 0.85 * out - 0.1 * np.sin(5 * out)) < 0.05 * (
                1.1 - out / reach
            )
            tree |= line & (out > 0.0) & (out < reach)
        bark = np.broadcast_to(base * np.array([0.045, 0.038, 0.032]), light.shape)
        put(tree, np.full_like(x, cz), bark)
    for cx, lh, cz in LAMPS:
        x, h = dx * cz - cx, EYE - dy * cz
        arm = np.sign(cx)
        post = (np.abs(x - 0.35 * arm) < 0.06) & (h > 0) & (h < lh + 0.25)
        post |= (np.abs(h - lh - 0.25) < 0.035) & (np.abs(x - 0.17 * arm) < 0.2)
        put(
            post,
            np.full_like(x, cz),
            np.broadcast_to(base * np.array([0.05, 0.05, 0.05]), light.shape),
        )
        away = np.hypot(x, h - lh)
        head = np.broadcast_to(
            np.array([9.0, 6.0, 3.0]) if night else base * np.full(3, 0.8), light.shape
        )
        put(away < 0.13, np.full_like(x, cz - 0.02), head)
    if night:
        for cx, lh, cz in LAMPS:
            px = WIDTH / 2 + FOCAL * cx / cz, 0.56 * HEIGHT + FOCAL * (EYE - lh) / cz
            square = ((columns + 0.5) / FINE - px[0]) ** 2 + ((rows + 0.5) / FINE - px[1]) ** 2
            light += (
                np.array([1.0, 0.62, 0.3])
                * (14.0 * (7.0 / cz) ** 2 / (square / 9.0 + 40.0))[..., None]
            )
    small = light.reshape(HEIGHT, FINE, WIDTH, FINE, 3).mean((1, 3))
    # A pixel's depth is that of one of its rays.
    return small, depth.reshape(HEIGHT, FINE, WIDTH, FINE)[:, 0, :, 0]
