"""Hard cases: what is asked at the edges, and the answer that mathematics gives.

Each file holds one subject's table of `Case`; `tests/test_hard_cases.py` judges them all, and
`tests/make_hard_cases.py` writes them with the measured values to ``docs/internals/hard-cases.md``.
"""

from hard import air, cone, gas, spectral

TABLES = {
    "Spectral texture": spectral.CASES,
    "Camera, flakes, compositing": air.CASES,
    "Gas": gas.CASES,
    "Double cone": cone.CASES,
}
