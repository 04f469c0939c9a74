"""Vector levels: the two with fused multiply-adds give the same bits, the portable one all but."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

PROGRAM = """
import sys
import numpy as np
import flurries as fl
dtype = sys.argv[2]
common = dict(drift=(3.0, -9.0), velocity=(1.0, 4.0), seed=5, dtype=dtype)
soft = dict(shutter=0.5, alias="soft")
odd = fl.spectral.Texture(tile=33, overlap=7, jitter=True, **soft)
parts = [
    fl.spectral.alpha((200, 150), preserve_mean=True, **common),
    fl.spectral.field((90, 70), texture=odd, **common),
    fl.spectral.optical_depth(
        (90, 70), fl.spectral.flake_patterns(32, counts=[9], diameters=[[1, 2]], shear=0.3, seed=1),
        drift=[(3.0, -9.0)], velocity=[(1.0, 4.0)], shutter=0.5, shear=0.3, seed=5, dtype=dtype,
    ),
    fl.composite.snow(np.full((9, 8, 3), 0.3, dtype), np.linspace(0, 1, 72).reshape(9, 8)).ravel(),
]
np.save(sys.argv[1], np.concatenate([part.ravel() for part in parts]))
"""


@pytest.mark.parametrize("dtype, limit", [("float32", 2e-6), ("float64", 4e-15)])
def test_levels_agree(dtype: str, limit: float, tmp_path: Path):
    results = {}
    for level in ("", "avx2", "portable"):
        file = tmp_path / f"{level}.npy"
        environment = {**os.environ, "FLURRIES_SIMD": level}
        subprocess.run([sys.executable, "-c", PROGRAM, file, dtype], env=environment, check=True)
        results[level] = np.load(file)
    assert results[""].tobytes() == results["avx2"].tobytes()
    difference = np.abs(results[""] - results["portable"]).max()
    assert difference <= limit
    fused = sys.platform == "linux" and "fma" in Path("/proc/cpuinfo").read_text()
    if dtype == "float32" and fused:
        # The switch does switch: a fused product rounds once.
        assert difference > 0.0
