"""Looks of a version stay what they are: a change of any number needs another version."""

import hashlib
from dataclasses import asdict

from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.effects.checks import LOOKS
from flurries.effects.mist import Mist

KEPT = {"v1": "3a05f3713e29d59b"}


def digest(version: str) -> str:
    kinds = TentSnow, TentRain, ConeSnow, ConeRain, Mist
    looks = [asdict(kind(name, look=version)) for kind in kinds for name in kind.PRESETS]
    numbers = repr([sorted(look.items()) for look in looks])
    return hashlib.sha256(numbers.encode()).hexdigest()[:16]


def test_a_look_is_as_it_was():
    assert {version: digest(version) for version in LOOKS} == KEPT
