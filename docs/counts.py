"""Instructions and bytes of the paper's kernels, which no busy machine changes.

    python docs/counts.py

Valgrind's counts of one call on one thread of the AVX2 level, the most that it knows: the
difference of a process with 12 calls and one with 2. A line is 64 bytes that the first cache
(32 KB) has not. Some minutes.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

BENCHES = Path(__file__).parents[1] / "benches"
TOOL = ["valgrind", "--tool=cachegrind", "--cache-sim=yes", "--cachegrind-out-file=/dev/null"]
COUNTERS = r"(?:I +refs|D +refs|D1 +misses): +([\d,]+)"
START = """
import sys
import numpy as np
import flurries as fl
sys.path.append(sys.argv[1])
import rivals
shape = (1024, 1024)
source, out = np.ones(shape, np.float32), np.empty(shape, np.float32)
drift = np.random.default_rng(3).normal(0.0, 5.0, (19, 19, 2))
points, radius = rivals.cloud(150_000, 1024, 1000.0)
camera = fl.Camera(1000.0)
for _ in range(int(sys.argv[2])):
    """
CALLS = {
    "copy of the alpha": "np.copyto(out, source)",
    "texture": "fl.spectral.alpha(shape, drift=drift, seed=1, out=out)",
    "150,000 discs": "fl.particles.splat(shape, points, radius, camera, opacity=0.5, out=out)",
}


def counted(call: str, runs: int) -> list[int]:
    """Return instructions, reads and writes, and lines of a whole process."""
    program = [*TOOL, sys.executable, "-c", START + call, str(BENCHES), str(runs)]
    threads = dict.fromkeys(("FLURRIES_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    done = subprocess.run(
        program, env={**os.environ, **threads}, check=True, capture_output=True, text=True
    )
    return [int(number.replace(",", "")) for number in re.findall(COUNTERS, done.stderr)]


if __name__ == "__main__":
    print(
        "| millions a call | instructions | reads and writes | lines |\n| --- | --- | --- | --- |"
    )
    for name, call in CALLS.items():
        pairs = zip(counted(call, 12), counted(call, 2), strict=True)
        cells = " | ".join(f"{(many - few) / 1e7:.2f}" for many, few in pairs)
        print(f"| {name} | {cells} |")
