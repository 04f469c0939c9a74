"""Every hard case of every table, on float32 and float64."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from every import every
from hard import TABLES
from hard.case import Case

CASES = [(subject, case) for subject, cases in TABLES.items() for case in cases]


@pytest.mark.parametrize(("subject", "case"), CASES, ids=[f"{s}: {c.name}" for s, c in CASES])
@every("dtype", [np.float32, np.float64])
def test_hard_case(subject: str, case: Case, dtype: Any):
    measured = case.measure(dtype)
    assert abs(measured - case.expected) <= case.allowed(dtype), (
        f"{measured!r}, expected {case.expected!r} within {case.allowed(dtype):g}"
    )


def test_there_are_enough_and_each_has_a_name():
    names = [f"{subject}: {case.name}" for subject, case in CASES]
    assert len(names) >= 60 and len(set(names)) == len(names)


def test_a_wrong_answer_would_be_seen():
    """The control: a case that is off by more than its tolerance fails, NaN too."""
    for measured in (1.0 + 2e-3, float("nan"), float("inf")):
        case = Case("wrong", lambda dtype, m=measured: m, 1.0, 1e-3, "")
        with pytest.raises(AssertionError):
            test_hard_case(subject="control", case=case)
