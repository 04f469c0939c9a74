"""Hostile values for every argument that is no array, one after the other: what comes of them.

`python hostile.py NAME [ROUNDS SEED]` prints a JSON list of complaints and a count. It runs in a
process of its own with little memory: a value that is taken too seriously ends in an error.
"""

from __future__ import annotations

import inspect
import json
import math
import re
import resource
import signal
import sys
import time
import tracemalloc
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

MOST_MEMORY = 1 << 30
# Of a refusal.
MOST_SECONDS, MOST_BYTES = 0.05, 64 << 20
# Of a call that is not refused.
PATIENCE = 30

HOSTILE: list[Any] = [
    math.nan, math.inf, -math.inf, 0, -1, 0.5, 2**31 - 1, 2**31, 2**31 + 1, 2**63 - 1, 2**63,
    -(2**63), 2**80, 1e308, -1e308, 5e-324, "", "x" * 10**6, "\0", "nan", b"1", None, [], {}, (),
    True, 1j, object(), np.float64("nan"), np.array(3), np.array([1.0, 2.0]),
    (math.nan, math.nan),
    (1e308, -1e308), (0, 0), (2**31, 2**31), (-1, 5), (2**63, 1), ("a", "b"), [1.0] * 1000,
    range(3), (1,) * 7, {"a": 1}, int, np.int8(-7), np.array([], dtype="f8"),
]  # fmt: skip


def random_value(random: Any) -> Any:
    kind = int(random.integers(7))
    if kind == 0:
        return float(random.standard_normal() * 10.0 ** random.integers(-320, 308))
    if kind == 1:
        return int(random.integers(-(2**62), 2**62)) >> int(random.integers(0, 62))
    if kind == 2:
        return "".join(map(chr, random.integers(1, 0xD7FF, int(random.integers(0, 40)))))
    if kind == 3:
        return float(np.frombuffer(random.bytes(8), "f8")[0])
    if kind == 4:
        return random.bytes(int(random.integers(0, 20)))
    return tuple(random_value(random) for _ in range(int(random.integers(0, 4))))


def arguments(call: Any) -> list[str]:
    """Every argument that is no array."""
    words = list(call.rest)
    for name, parameter in inspect.signature(call.function).parameters.items():
        if parameter.kind is not inspect.Parameter.VAR_KEYWORD:
            words.append(name)
    return [w for w in dict.fromkeys(words) if w not in call.arrays and w not in ("out", "self")]


def complaints(call: Any, values: Any) -> Iterator[str]:
    every = arguments(call)
    for argument in every:
        for value in values():
            shown = repr(value)[:40]
            tracemalloc.reset_peak()
            before, started = tracemalloc.get_traced_memory()[0], time.process_time()
            signal.alarm(PATIENCE)
            try:
                call(**{argument: value})
            except (TypeError, ValueError) as error:
                text = str(error)
                # What does not go together may be told by the other one's name.
                if not any(re.search(rf"\b{word}\b", text) for word in [*call.arrays, *every]):
                    yield f"{argument}={shown}: not named: {text[:120]}"
                if len(text) > 2000:
                    yield f"{argument}={shown}: {len(text)} letters of message"
            except MemoryError:
                # What the system would not give was not taken.
                continue
            except TimeoutError:
                yield f"{argument}={shown}: more than {PATIENCE} s"
                continue
            except BaseException as error:
                yield f"{argument}={shown}: {type(error).__name__}: {str(error)[:120]}"
            else:
                signal.alarm(0)
                continue
            finally:
                signal.alarm(0)
            spent = time.process_time() - started
            peak = tracemalloc.get_traced_memory()[1] - before
            if spent > MOST_SECONDS:
                yield f"{argument}={shown}: refused after {1e3 * spent:.0f} ms"
            if peak > MOST_BYTES:
                yield f"{argument}={shown}: refused after {peak >> 20} MiB"


def main(name: str, rounds: int = 0, seed: int = 0) -> None:
    import flurries as fl
    from public_calls import CALLS, NUMBERS

    fl.set_threads(1)
    call = (CALLS | NUMBERS)[name]
    # What is prepared once is not part of a refusal.
    call()
    tried = 0

    def values() -> Iterator[Any]:
        nonlocal tried
        random = np.random.default_rng(seed)
        for value in HOSTILE if not rounds else (random_value(random) for _ in range(rounds)):
            tried += 1
            yield value

    def too_long(*_: Any) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, too_long)
    # Warnings are for the user; here they are neither good nor bad.
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    tracemalloc.start()
    found = list(complaints(call, values))
    print(json.dumps({"tried": tried, "complaints": found}))


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
