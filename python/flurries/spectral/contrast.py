"""How much of the field's power and of its mean opacity is left, by short integrals."""

from __future__ import annotations

import math

import numpy as np

from flurries._contract import Float64
from flurries.spectral.tables import temporal_gain

_ANGLES = 4096

# Deviations and values of a table of mean opacities.
_TABLE = (129, 1801)


def kept_power(cycles: float, alias: str, *, shutter: float = 0.0) -> float:
    """Return the share of the power of a large tile that aliasing and the shutter leave."""
    # A wave whose direction makes an angle b with the motion turns at c cos b cycles a frame,
    # whatever its wavelength; `cycles` is c, so that the share is a mean over b. For the cut alone
    # it is (2/pi) asin(1/(2c)) from c = 1/2 on.
    if cycles <= 0.0:
        return 1.0
    # Equal steps of the rate's angle, only where something is kept: fast motion keeps little.
    most = 1.0 if alias == "keep" else min(0.5 / cycles, 1.0)
    angle = math.asin(most) * (np.arange(_ANGLES) + 0.5) / _ANGLES
    rate = cycles * np.sin(angle)
    kept = temporal_gain(rate, alias=alias, shutter=shutter) ** 2
    return float(kept.mean() * math.asin(most) / (0.5 * np.pi))


def mean_opacity(variance: Float64, mean: float, spread: float, power: float) -> Float64:
    """Return the mean of clip(mean + z / (2 spread), 0, 1)^power for fields of variances (n,)."""
    deviation = np.sqrt(np.maximum(variance, 0.0)) / (2.0 * spread)
    # On a table: frames have a variance for every pixel.
    table = np.linspace(0.0, max(float(deviation.max()), 1e-12), _TABLE[0])
    z = np.linspace(-9.0, 9.0, _TABLE[1])
    weight = np.exp(-0.5 * z * z)
    weight /= weight.sum()
    base = table[:, None] * z
    # In place: it is larger than many a window.
    base += mean
    np.clip(base, 0.0, 1.0, out=base)
    base **= power
    return np.asarray(np.interp(deviation, table, base @ weight))
