"""Rotations in their three forms: matrices, vectors of axis times angle, and unit quaternions."""

import math
from collections.abc import Iterable

import numpy as np

from flurries._contract import Float64


def rotation_matrix(rotation: Iterable[float]) -> Float64:
    """Return the matrix (3, 3) of a rotation vector (3,), radians (Rodrigues' formula)."""
    x, y, z = rotation
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-8:
        # sin(a)/a and (1 - cos a)/a^2 at 0, right to a^2.
        small: Float64 = np.eye(3) + cross + 0.5 * cross @ cross
        return small
    half = math.sin(0.5 * angle) / angle
    matrix: Float64 = np.eye(3) + math.sin(angle) / angle * cross + 2.0 * half**2 * cross @ cross
    return matrix


def rotation_vector(matrix: Float64) -> Float64:
    """Return axis times angle, (3,), of a rotation matrix; the angle is from 0 to pi."""
    w, *xyz = quaternions_of(matrix[None])[0]
    axis = np.array(xyz)
    if w < 0.0:
        w, axis = -w, -axis
    length = float(np.linalg.norm(axis))
    # The limit of 2 atan2(s, c) / s.
    factor = 2.0 / w if length < 1e-150 else 2.0 * float(np.arctan2(length, w)) / length
    return np.asarray(factor * axis)


def quaternions_of(matrices: Float64) -> Float64:
    """Return (n, 4), (w, x, y, z), of rotation matrices; each from its largest part."""
    result = np.empty((len(matrices), 4))
    for k, m in enumerate(matrices):
        turn, (x, y, z) = m - m.T, np.diag(m)
        # 4 q q^T: each row is the quaternion times one of its parts.
        products = np.zeros((4, 4))
        products[1:, 1:] = m + m.T
        products[0, 1:] = products[1:, 0] = turn[2, 1], turn[0, 2], turn[1, 0]
        np.fill_diagonal(products, (1 + x + y + z, 1 + x - y - z, 1 - x + y - z, 1 - x - y + z))
        result[k] = products[np.diag(products).argmax()]
    return np.asarray(result / np.linalg.norm(result, axis=1, keepdims=True))


def matrices_of(q: Float64) -> Float64:
    """Return (n, 3, 3) of unit quaternions (w, x, y, z)."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))
