"""How long a soak is: FLURRIES_SOAK is a share of the full length."""

import os

SHARE = float(os.environ.get("FLURRIES_SOAK", "1"))


def times(full: int, least: int = 2) -> int:
    return max(round(SHARE * full), least)
