"""Looks of a version stay what they are: a change of any number needs another version."""

import dataclasses
import hashlib

from flurries.effects import ConeRain, ConeSnow, TentRain, TentSnow
from flurries.effects.checks import LOOKS
from flurries.effects.mist import Mist

# Of all numbers of all looks; that a number has its meaning is for other tests.
KEPT = {"v1": "02bb011f048f4291"}


def digest(version: str) -> str:
    kinds = TentSnow, TentRain, ConeSnow, ConeRain, Mist
    looks = [kind(name, look=version) for kind in kinds for name in kind.PRESETS]
    return hashlib.sha256(repr(list(map(dataclasses.asdict, looks))).encode()).hexdigest()[:16]


def test_a_look_is_as_it_was():
    assert {version: digest(version) for version in LOOKS} == KEPT
