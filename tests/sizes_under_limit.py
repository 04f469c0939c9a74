"""Call every public function with large sizes in a process that may have little more memory.

    python tests/sizes_under_limit.py PART PARTS

Each function is called once as it should be, so that threads, tables and modules are there; then
with sizes below and far beyond what fits. Prints each name before its calls, and last how it went:
an abort says in which function it was. `python tests/sizes_under_limit.py abort` is the control.
"""

from __future__ import annotations

import ctypes
import resource
import sys
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

from public import Call, calls, methods

# For one number, and for the two of a shape. Answers of the first ones fit, just.
NUMBERS = (2**12, 2**20, 2**24, 2**28, 2**31 - 1, 2**40, 2**62)
SHAPES = (
    (1500, 1500), (3000, 3000), (2**20, 3), (3, 2**20), (2**14, 2**14), (2**16, 2**16),
    (2**31 - 1, 1), (1, 2**31 - 1), (2**31 - 1, 2**31 - 1), (2**40, 2**40), (2**63, 1),
)  # fmt: skip

# They order work, or more threads; what they make is as small as ever.
NO_SIZES = ("seed", "index", "n", "workers", "group")

MORE = 64 << 20


def limit() -> None:
    """Allow no more than `MORE` beyond what the process has now."""
    has = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (has + MORE, resource.getrlimit(resource.RLIMIT_AS)[1]))


def unlimited() -> None:
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (hard, hard))


def sizes(call: Call) -> list[tuple[str, Any]]:
    """Return arguments that are sizes, and sizes for them."""
    found: list[tuple[str, Any]] = []
    for name, value in call.given.items():
        if name in NO_SIZES or name in call.heavy:
            continue
        if isinstance(value, int) and not isinstance(value, bool):
            found += [(name, number) for number in NUMBERS]
        if isinstance(value, tuple) and len(value) == 2 and all(type(v) is int for v in value):
            found += [(name, shape) for shape in SHAPES]
    return found


def main() -> None:
    if sys.argv[1] == "abort":
        limit()
        ctypes.CDLL(None).abort()
    part, parts = int(sys.argv[1]), int(sys.argv[2])
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        table = {**calls(Path(folder)), **methods()}
        outcomes: Counter[str] = Counter(answered=0, refused=0, MemoryError=0)
        for name in sorted(table)[part::parts]:
            call = table[name]
            tried = sizes(call)
            if not tried:
                continue
            print(name, flush=True)
            call.of(**call.given)
            limit()
            for argument, value in tried:
                try:
                    call.of(**{**call.given, argument: value})
                    outcomes["answered"] += 1
                except MemoryError:
                    outcomes["MemoryError"] += 1
                except (TypeError, ValueError, OSError):
                    outcomes["refused"] += 1
            unlimited()
    print(*(f"{key}={count}" for key, count in outcomes.items()))


if __name__ == "__main__":
    main()
