"""Bad arguments: a clear refusal that names the argument, never a panic or a silent picture."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import flurries as fl

S = fl.spectral
ONES = np.ones((16, 16))
NAN, INF = float("nan"), float("inf")


def repr_of_type(value: object) -> str:
    return type(value).__name__


# Right arguments of every function, and how many of them go by position.
GOOD: dict[str, tuple[Callable[..., Any], int, dict[str, Any]]] = {
    "tent_rate": (
        S.tent_rate, 2, {"shape": (16, 16), "velocity": (1.0, 2.0), "wavelength_max": 32.0}
    ),
    "velocity_from_paper": (
        S.velocity_from_paper, 2, {"C": 4.0, "theta": 1.0, "period": 64.0, "wavelength_max": 32.0}
    ),
    "band_amplitude": (
        S.band_amplitude, 1, {"shape": (32, 32), "wavelengths": (4.0, 32.0), "exponent": 1.0}
    ),
    "random_phase": (S.random_phase, 1, {"shape": (16, 16), "seed": 1, "tile": (0, 0)}),
    "advance_phase": (
        S.advance_phase, 2,
        {"phase": ONES, "drift": (1.0, 2.0), "shift": (0.0, 0.0), "wavelength_max": 32.0},
    ),
    "temporal_filter": (
        S.temporal_filter, 2,
        {"amplitude": ONES, "velocity": (1.0, 2.0), "shift_rate": (0.0, 1.0), "alias": "soft",
         "soft_from": 0.4, "shutter": 1.0, "renormalise": False, "wavelength_max": 32.0},
    ),
    "inverse_transform": (S.inverse_transform, 2, {"amplitude": ONES, "phase": ONES}),
    "tile_starts": (S.tile_starts, 1, {"length": 100, "tile": 64, "overlap": 10}),
    "blend_tiles": (
        S.blend_tiles, 2,
        {"tiles": np.ones((2, 1, 16, 16)), "shape": (20, 16), "overlap": 10, "blend": "power"},
    ),
    "field": (
        S.field, 1,
        {"shape": (40, 30), "drift": (1.0, 2.0), "shift": (1.0, 1.0), "seed": 1, "tile": 32,
         "overlap": 10, "wavelengths": (4.0, 32.0), "exponent": 1.0, "velocity": (1.0, 2.0),
         "shift_rate": (0.1, 0.1), "alias": "soft", "soft_from": 0.4, "shutter": 0.5,
         "jitter": True, "shortest": np.full((2, 1), 5.0), "blend": "power"},
    ),
    "field rings": (
        S.field, 1,
        {"shape": (40, 30), "drift": [(1.0, 2.0)] * 2, "seed": 1, "tile": 32,
         "ring_edges": (4.0, 8.0, 32.0)},
    ),
    "field gains": (
        S.field, 1,
        {"shape": (40, 30), "drift": (1.0, 2.0), "seed": 1, "tile": 32,
         "ring_edges": (4.0, 8.0, 32.0), "ring_gains": (0.5, 2.0)},
    ),
    "volume": (
        S.volume, 3,
        {"frames": 12, "size": 32, "velocity": (3.0, 4.0), "seed": 1, "wavelengths": (4.0, 32.0),
         "cells": "overlap"},
    ),
    "loop": (
        S.loop, 3,
        {"frames": 12, "shape": (32, 40), "velocity": (3.0, 4.0), "seed": 1, "time": (1.0, 2.5),
         "wavelengths": (4.0, 32.0), "exponent": 1.0, "alias": "soft", "soft_from": 0.4,
         "shutter": 0.5, "jitter": True},
    ),
    "opacity": (
        S.opacity, 1, {"field": ONES, "mean": 0.5, "spread": 3.0, "power": 2.0, "amount": 1.0}
    ),
    "alpha": (
        S.alpha, 1,
        {"shape": (40, 30), "drift": (1.0, 2.0), "seed": 1, "tile": 32, "mean": 0.5, "spread": 3.0,
         "power": 2.0, "amount": 1.0, "exponent": 1.0, "preserve_mean": False},
    ),
}  # fmt: skip
EVERY = [(name, key) for name, (_, _, good) in GOOD.items() for key in good]
NUMBERS = [(n, k) for n, k in EVERY if not isinstance(GOOD[n][2][k], (str, bool))]
OPTIONAL = {"velocity", "shift_rate", "shortest", "ring_edges", "ring_gains"}


def call(name: str, **changes: Any) -> Any:
    """Call with the good arguments, some of them changed."""
    function, by_position, good = GOOD[name]
    arguments = {**good, **changes}
    leading = [arguments.pop(key) for key in list(good)[:by_position]]
    return function(*leading, **arguments)


@pytest.mark.parametrize("name", GOOD)
def test_the_good_arguments_are_good(name: str):
    # Without this every refusal below might be for another reason.
    assert call(name) is not None


@pytest.mark.parametrize("bad", [NAN, INF, -INF])
@pytest.mark.parametrize(("name", "key"), NUMBERS)
def test_not_finite_is_refused_by_name(name: str, key: str, bad: float):
    value = GOOD[name][2][key]
    changed: Any = bad
    if np.ndim(value):
        changed = np.array(value, dtype=np.float64)
        changed.reshape(-1)[-1] = bad
        changed = changed if isinstance(value, np.ndarray) else changed.tolist()
    # Where an int is wanted, a float is refused for its type.
    kinds = (TypeError, ValueError) if np.asarray(value).dtype.kind == "i" else ValueError
    with pytest.raises(kinds, match=key):
        call(name, **{key: changed})


@pytest.mark.parametrize("bad", ["x", b"1", 1j, {}, [[]], object()], ids=repr_of_type)
@pytest.mark.parametrize(("name", "key"), EVERY)
def test_wrong_types_are_refused_by_name(name: str, key: str, bad: Any):
    with pytest.raises((TypeError, ValueError), match=key):
        call(name, **{key: bad})


@pytest.mark.parametrize(("name", "key"), EVERY)
def test_none_is_not_a_number(name: str, key: str):
    if key in OPTIONAL and name.startswith("field"):
        key = "drift"  # None is the default there
    if (name, key) == ("loop", "time"):
        key = "velocity"
    with pytest.raises((TypeError, ValueError), match=key):
        call(name, **{key: None})


# One wrong value each; the message names the argument.
WRONG: list[tuple[str, dict[str, Any], str]] = [
    *[(n, {"shape": s}, "shape") for n in ("tent_rate", "band_amplitude", "random_phase", "field")
      for s in [(0, 8), (8, 0), (-1, 8), (8,), (8, 8, 8), (2**40, 2**40)]],
    ("field", {"shape": (8.0, 8.0)}, "shape"),
    ("tent_rate", {"velocity": (1.0,)}, "velocity"),
    ("tent_rate", {"velocity": (1.0, 2.0, 3.0)}, "velocity"),
    ("tent_rate", {"velocity": 1.0}, "velocity"),
    ("tent_rate", {"wavelength_max": 0.0}, "wavelength_max"),
    ("tent_rate", {"wavelength_max": -32.0}, "wavelength_max"),
    ("advance_phase", {"wavelength_max": 0.0}, "wavelength_max"),
    ("temporal_filter", {"wavelength_max": 0.0}, "wavelength_max"),
    ("velocity_from_paper", {"period": 0.0}, "period"),
    *[(n, {"wavelengths": w}, "wavelengths") for n in ("band_amplitude", "field")
      for w in [(1.9, 32.0), (0.0, 32.0), (-4.0, 32.0), (8.0, 8.0), (9.0, 8.0), (4.0,), 4.0,
                (4.0, 8.0, 16.0)]],
    *[(n, {"seed": s}, "seed") for n in ("random_phase", "field", "alpha")
      for s in [2**63, -(2**63) - 1, 1.0, 1.5, "1", [1]]],
    ("random_phase", {"tile": (0,)}, "tile"),
    ("random_phase", {"tile": (0.5, 0)}, "tile"),
    ("random_phase", {"tile": (2**63, 0)}, "tile"),
    ("advance_phase", {"phase": np.ones(16)}, "phase"),
    ("advance_phase", {"phase": np.ones((2, 2, 2))}, "phase"),
    ("advance_phase", {"phase": np.ones((0, 4))}, "phase"),
    ("advance_phase", {"drift": (1.0, 2.0, 3.0)}, "drift"),
    ("advance_phase", {"shift": (1.0,)}, "shift"),
    ("temporal_filter", {"amplitude": np.ones(16)}, "amplitude"),
    ("temporal_filter", {"velocity": np.ones((2, 2))}, "velocity"),
    ("temporal_filter", {"alias": "Cut"}, "alias"),
    ("temporal_filter", {"soft_from": -0.1}, "soft_from"),
    ("temporal_filter", {"soft_from": 0.6}, "soft_from"),
    ("temporal_filter", {"shutter": -1.0}, "shutter"),
    ("inverse_transform", {"amplitude": np.ones((16, 15))}, "phase"),
    ("inverse_transform", {"phase": np.ones(16)}, "phase"),
    ("inverse_transform", {"dtype": np.float16}, "dtype"),
    ("inverse_transform", {"dtype": np.int32}, "dtype"),
    ("inverse_transform", {"dtype": "nonsense"}, "dtype"),
    ("inverse_transform", {"dtype": None}, "dtype"),
    *[("tile_starts", c, next(iter(c))) for c in
      [{"length": 0}, {"length": -5}, {"length": 10.0}, {"tile": 0}, {"tile": -1},
       {"tile": 64.0}, {"overlap": -1}, {"overlap": 64}, {"overlap": 65}, {"overlap": 1.5}]],
    ("blend_tiles", {"tiles": np.ones((16, 16))}, "tiles"),
    ("blend_tiles", {"tiles": np.ones((1, 1, 16, 16))}, "tiles"),
    ("blend_tiles", {"tiles": np.ones((2, 2, 16, 16))}, "tiles"),
    ("blend_tiles", {"tiles": np.ones((2, 1, 0, 16))}, "tiles"),
    ("blend_tiles", {"overlap": 16}, "overlap"),
    ("blend_tiles", {"blend": "smooth"}, "blend"),
    ("field", {"tile": 0}, "tile"),
    ("field", {"overlap": 32}, "overlap"),
    ("field", {"overlap": -1}, "overlap"),
    ("field", {"alias": "none"}, "alias"),
    ("field", {"blend": "sqrt"}, "blend"),
    ("field", {"shutter": -0.5}, "shutter"),
    ("field", {"soft_from": 0.6}, "soft_from"),
    ("field", {"velocity": None}, "velocity"),
    ("field", {"velocity": None, "alias": "keep"}, "velocity"),
    ("field", {"velocity": None, "alias": "cut", "shutter": 0.0}, "velocity"),
    ("field", {"shortest": np.full((2, 2), 5.0)}, "shortest"),
    ("field", {"shortest": 5.0}, "shortest"),
    ("field", {"dtype": np.float16}, "dtype"),
    *[("field", {key: np.ones(wrong)}, key) for key in ("drift", "shift", "velocity", "shift_rate")
      for wrong in [(3,), (1, 2, 2), (2, 1, 3), (2, 1), (3, 1, 2), (2, 1, 1, 2)]],
    ("field", {"drift": np.ones((3, 2))}, "drift"),
    ("field rings", {"drift": np.ones((3, 2))}, "drift"),
    ("field rings", {"drift": np.ones((2, 1, 3, 2))}, "drift"),
    ("field rings", {"ring_edges": (4.0, 8.0)}, "drift"),
    ("field rings", {"ring_edges": (4.0, 4.0, 32.0)}, "ring_edges"),
    ("field rings", {"ring_edges": (8.0, 4.0, 32.0)}, "ring_edges"),
    ("field rings", {"ring_edges": (4.0,)}, "ring_edges"),
    ("field gains", {"ring_gains": (1.0, 1.0, 1.0)}, "ring_gains"),
    ("field gains", {"ring_gains": (0.0, 0.0)}, "ring_gains"),
    ("field gains", {"ring_gains": (1.0, -1.0)}, "ring_gains"),
    ("field gains", {"ring_edges": None}, "ring_gains"),
    ("opacity", {"field": np.ones(16)}, "field"),
    ("opacity", {"field": np.ones((0, 4))}, "field"),
    ("opacity", {"spread": 0.0}, "spread"),
    ("opacity", {"spread": -3.0}, "spread"),
    ("alpha", {"spread": 0.0}, "spread"),
    ("alpha", {"dtype": int}, "dtype"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "changes", "argument"), WRONG)
def test_wrong_values_are_refused_by_name(name: str, changes: dict[str, Any], argument: str):
    with pytest.raises((TypeError, ValueError), match=argument):
        call(name, **changes)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
@pytest.mark.parametrize("name", ["band_amplitude", "field", "alpha"])
def test_a_band_without_waves_is_refused(name: str, size: int):
    # The message names the size of the tile and the argument to change.
    where = {"shape": (size, size)} if name == "band_amplitude" else {"tile": size, "overlap": 0}
    if name == "field":
        where["shortest"] = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        with pytest.raises(ValueError, match="wavelengths") as refusal:
            call(name, **where)
    assert str(size) in str(refusal.value)


def test_a_band_between_two_lattice_waves_is_refused():
    # |k|^2 = 8 and 9 are neighbours on the lattice: 64/|k| is 22.63 and 21.33 px.
    with pytest.raises(ValueError, match="wavelengths"):
        fl.spectral.band_amplitude((64, 64), wavelengths=(21.4, 22.6))


@pytest.mark.parametrize("name", ["field", "alpha"])
def test_a_band_longer_than_the_tile_warns(name: str):
    with pytest.warns(UserWarning, match="wavelengths") as warned:
        call(name, tile=24, **({"shortest": None} if name == "field" else {}))
    # shown at the caller's line, not somewhere inside
    assert [w.filename for w in warned] == [__file__]


def test_arguments_after_the_arrays_are_keyword_only():
    for name, (function, by_position, good) in GOOD.items():
        leading = list(good.values())[: by_position + 1]
        if len(leading) > by_position:
            with pytest.raises(TypeError):
                function(*leading)
            assert call(name) is not None


FRAME: dict[str, Any] = {"drift": (1.0, 1.0), "seed": 1, "tile": 32}
HUGE = 1.7e308
EXTREME: dict[str, Callable[[], Any]] = {
    **{f"drift {v}": lambda v=v: S.field((40, 30), **{**FRAME, "drift": (v, -v)})
       for v in (1e-310, 1e15, 1e100, HUGE)},
    "drift and shift": lambda: S.field((40, 30), **{**FRAME, "drift": (HUGE, HUGE)},
                                       shift=(HUGE, HUGE)),
    "velocity, cut": lambda: S.field((40, 30), **FRAME, velocity=(HUGE, HUGE), alias="cut"),
    "velocity": lambda: S.field((40, 30), **FRAME, velocity=(HUGE, HUGE), shutter=1.0),
    "shift_rate": lambda: S.field((40, 30), **FRAME, velocity=(1.0, 1.0),
                                  shift_rate=(HUGE, -HUGE), shutter=1.0),
    "shutter": lambda: S.field((40, 30), **FRAME, velocity=(1.0, 1.0), shutter=HUGE),
    "velocity times shutter": lambda: S.field((40, 30), **FRAME, velocity=(1e200, 1e200),
                                              shutter=1e200),
    "tent_rate": lambda: S.tent_rate((16, 16), (HUGE, HUGE), wavelength_max=1e-300),
    "tent_rate, tiny": lambda: S.tent_rate((16, 16), (1.0, 1.0), wavelength_max=5e-324),
    "advance_phase": lambda: S.advance_phase(ONES, (1e300, 1.0), wavelength_max=1e-10),
    "advance_phase of many turns": lambda: S.advance_phase(1e308 * ONES, (1.0, 1.0)),
    "temporal_filter": lambda: S.temporal_filter(1e200 * ONES, (9.0, 9.0), renormalise=True),
    "inverse_transform": lambda: S.inverse_transform(1e39 * ONES, 0 * ONES),
    "velocity_from_paper": lambda: S.velocity_from_paper(1e308, 0.0, period=1e-10),
    "exponent": lambda: S.band_amplitude((32, 32), exponent=1e308),
    "opacity": lambda: S.opacity(np.array([[HUGE, -HUGE]]), spread=1e-300),
    "tile_drift": lambda: fl.camera.tile_drift(
        (64, 64), (1e308, 0.0, 1e308), fl.camera.Camera(600.0), near_depth=1e-10
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", EXTREME)
def test_extreme_but_finite_numbers_never_give_nan(name: str):
    # Where a phase has lost all its digits the picture is another one; where a product leaves the
    # range of the numbers a refusal is as good. NaN in the picture is not.
    with warnings.catch_warnings():
        # That a drift is too far to hold its phases is said by a warning; see the next test.
        warnings.simplefilter("ignore", UserWarning)
        try:
            result = EXTREME[name]()
        except ValueError:
            return
    assert np.isfinite(result).all()


@pytest.mark.parametrize("cycles, warned", [(0.9e12, 0), (1.1e12, 1)])
def test_a_drift_that_loses_its_phases_is_warned_of(cycles: float, warned: int):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        S.field((40, 30), **{**FRAME, "drift": (0.0, cycles * 32.0)})
        S.advance_phase(ONES, (cycles * 32.0, 0.0))
    assert [w.filename for w in caught] == [__file__] * (2 * warned)


def test_a_vanishing_spread_is_a_threshold():
    # z/(2 spread) at z = 0 is 0 for any spread above 0, so the opacity there stays mean^2.
    got = fl.spectral.opacity(np.array([[-1.0, 0.0, 1.0]]), spread=5e-324)
    assert np.array_equal(got, [[0.0, 0.25, 1.0]])
