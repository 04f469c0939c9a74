"""Weather on arrays: pictures, batches, films and pairs, draws and records, whoever makes them."""

import json
import math
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries import _core
from flurries.augment import Fog, Rainfall, Snowfall
from flurries.augment.air import Here
from flurries.augment.record import DRAWN
from measure import drawn_of

KINDS: dict[str, Callable[..., Any]] = {"snow": Snowfall, "rain": Rainfall, "fog": Fog}
EACH = pytest.mark.parametrize("kind", KINDS)
RNG = np.random.default_rng(0)
PICTURE = RNG.integers(0, 256, (48, 64, 3), dtype=np.uint8)
DTYPES = {
    "u1": PICTURE,
    "u2": (PICTURE.astype(np.uint16) * 257),
    "f2": (PICTURE / 255).astype(np.float16),
    "f4": (PICTURE / 255).astype(np.float32),
    "f8": PICTURE / 255,
}


@EACH
@pytest.mark.parametrize("name", DTYPES)
def test_it_is_the_layer_over_the_picture(kind: str, name: str):
    weather, picture = KINDS[kind](severity=4, seed=1), DTYPES[name]
    assert np.array_equal(KINDS[kind](amount=0.0)(picture), picture)
    full, step = {"u1": (255, 0.5), "u2": (65535, 0.5), "f2": (1, 2.0**-11)}.get(name, (1, 1e-6))
    seen, layer = weather(picture, index=3, return_layer=True)
    assert layer.shape == (48, 64, 4) and layer.dtype == np.float32
    want = full * layer[..., :3] + (1.0 - layer[..., 3:].astype(np.float64)) * picture
    assert seen.dtype == picture.dtype and np.abs(seen - want).max() <= 1.01 * step + 1e-6 * full
    assert np.array_equal(seen, weather(picture, index=3))


@EACH
def test_bad_pixels_stay_where_they_were(kind: str):
    picture = DTYPES["f4"].copy()
    bad = RNG.random(picture.shape) < 0.05
    picture[bad] = np.nan
    seen = KINDS[kind](severity=5, seed=1)(picture, index=0)
    assert np.array_equal(np.isnan(seen), bad)


@EACH
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (7, 1), (13, 17), (3, 400), (65, 63)])
def test_odd_sizes(kind: str, shape: tuple[int, int]):
    picture = np.full((*shape, 3), 0.25)
    seen = KINDS[kind](severity=5, seed=1)(picture, index=0)
    assert seen.shape == picture.shape
    assert ((seen >= 0.25 - 1e-9) & (seen <= 1.0)).all()


@EACH
def test_white_is_what_the_caller_says(kind: str):
    seen = KINDS[kind](severity=4, seed=1)(DTYPES["f8"], index=3)
    with pytest.warns(UserWarning, match="white=255"):
        KINDS[kind](severity=4, seed=1)(DTYPES["f8"] * 255.0, index=3)
    scaled = KINDS[kind](severity=4, seed=1, white=255.0)(DTYPES["f8"] * 255.0, index=3)
    assert np.allclose(scaled, 255.0 * seen, rtol=0.0, atol=1e-9)


@EACH
def test_a_batch_is_its_pictures(kind: str):
    weather = KINDS[kind](severity=(1, 5), seed=1)
    images = np.stack([PICTURE, PICTURE[::-1], PICTURE])
    seen, layers = weather.batch(images, index=40, return_layer=True)
    for number in range(3):
        one, layer = weather(images[number], index=40 + number, return_layer=True)
        assert np.array_equal(seen[number], one) and np.array_equal(layers[number], layer)
    assert not np.array_equal(seen[0], seen[2])
    assert np.array_equal(weather.batch(images, index=[40, 41, 42]), seen)
    with pytest.raises(ValueError, match="index"):
        weather.batch(images, index=[1, 2])


@EACH
def test_films_and_pairs_are_their_pictures(kind: str):
    weather = KINDS[kind](severity=4, seed=1)
    frames = np.stack([PICTURE] * 3)
    walls = np.stack([np.full((48, 64), d) for d in (5.0, 9.0, 500.0)])
    how = {"index": 5, "fps": 25.0, "depth": walls}
    seen = weather.clip(frames, time=1e5, **how)
    film = weather.apply(frames, time=1e5, boxes=[[[5, 5, 40, 30]]] * 3, **how)
    for number, image in enumerate(seen):
        # A call takes them for 30 frames a second.
        own = {**how, "time": 1e5 + number / 25.0, "depth": how["depth"][number]}
        one = weather.apply(PICTURE, **own).image
        assert np.array_equal(image, one) and np.array_equal(film[number].image, one)
        del own["fps"]
        assert np.array_equal(weather(PICTURE, **own), one)
        assert film[number].occlusion == pytest.approx([film[number].alpha[5:30, 5:40].mean()])
    # And so are all their labels.
    flows, masks = [RNG.standard_normal((48, 64, 2)) for _ in frames], list(frames[..., 0] % 3)
    film = weather.apply(frames, flow=flows, masks=masks, motion=True, eye="left", **how)
    for number, seen in enumerate(film):
        own = {**how, "time": number / 25.0, "depth": walls[number], "eye": "left"}
        one = weather.apply(PICTURE, flow=flows[number], masks=masks[number], motion=True, **own)
        for name in ("flow", "depth", "motion", "disparity", "weather_disparity", "instances",
                     "instance_visibility"):  # fmt: skip
            assert np.array_equal(getattr(seen, name), getattr(one, name)), name
    assert weather.clip(frames[..., 0], index=5).shape == frames.shape[:3]
    both, how = (PICTURE, PICTURE[::-1]), {"index": 3, "time": 0.5, "distance": 0.3}
    truth, pair = weather.apply(both, **how), weather.pair(*both, **how)
    for k, eye in enumerate(("left", "right")):
        assert np.array_equal(truth[k].image, pair[k])
        lone = weather.apply(both[k], eye=eye, **how)
        assert np.array_equal(lone.image, pair[k]) and lone.weather_disparity is not None
    with pytest.raises(ValueError, match="boxes must be one or 3"):
        weather.apply(frames, boxes=[[]])


@pytest.mark.parametrize("shape, words", [
    ((3, 40, 50), "channels come last"), ((2, 40, 50, 3), r"\.clip.*\.batch"),
])  # fmt: skip
def test_channels_that_come_first_are_named(shape: tuple[int, ...], words: str):
    with pytest.raises(ValueError, match=words):
        Snowfall()(np.zeros(shape, np.uint8))


def seen_by_eyes(weather: Any, shape: tuple[int, int], apart: float) -> list[Here]:
    """The air before both eyes."""
    both = [np.empty(shape)] * 2, [weather.record(index=0)] * 2, None, [0.0] * 2, None
    return list(weather._airs(*both, apart, (-1, 1)))


@pytest.mark.parametrize("kind", ["snow", "rain"])
def test_every_flake_has_the_disparity_of_its_depth(kind: str):
    """Both eyes see the same flakes, focal * distance / z apart, and draw them there."""
    weather, apart, shape = KINDS[kind](severity=4, seed=3, profile="hard"), 0.1, (192, 256)
    eyes = seen_by_eyes(weather, shape, apart)
    both = [drawn_of(eye) for eye in eyes]
    common = [(both[0][number], both[1][number]) for number in both[0] if number in both[1]]
    assert len(common) >= 20
    for left, right in common:
        assert np.array_equal(left[:3], right[:3])
        wanted = eyes[0].view.focal * apart / left[2]
        assert left[3] - right[3] == pytest.approx(wanted, abs=1e-9) and left[4] == right[4]
    # What pair() gives is these flakes and the sheets: in the middle of a large one there is snow.
    picture = np.zeros(shape, np.uint8)
    _, _, *layers = weather.pair(picture, picture, index=0, distance=apart, return_layer=True)
    for eye, flakes, layer in zip(eyes, both, layers, strict=True):
        large = [
            layer[int(row[4]), int(row[3]), 3] for row in flakes.values()
            if 2 < row[3] < 254 and 2 < row[4] < 190 and row[7] == 1.0
            and eye.view.focal * row[6] / row[2] > 2.5
        ]  # fmt: skip
        assert kind == "rain" or (len(large) >= 5 and min(large) > 0.15)
    # However near the eyes are to one another: not at 0 alone.
    truth, _ = weather.apply((picture, picture), index=0, distance=1e-7, depth=4.0)
    assert truth.disparity == pytest.approx(1.2 * 256 * 1e-7 / truth.depth)
    same = weather.pair(picture, picture, index=0, distance=0.0)
    assert np.array_equal(same[0], same[1])


def test_sheets_before_two_eyes_have_their_disparity():
    """By correlation: what one eye sees, moved by a layer's disparity, is what the other sees."""
    eyes = seen_by_eyes(Snowfall(severity=5, seed=3, profile="hard"), (256, 256), 0.1)
    assert len(eyes[0].layers) > 3
    for number, layer in enumerate(eyes[0].sheets[1]):
        planes = []
        for eye in eyes:
            plane = np.empty((256, 256), np.float32)
            _core.sheet_read(plane, (0, 0), [eye.layers[number]], None, False)
            planes.append(plane - plane.mean())
        left, right = planes
        wanted = eyes[0].view.focal * 0.1 / (eyes[0].near * math.sqrt(layer[1] * layer[2]))
        best = max(range(40), key=lambda d: float((left[:, d:] * right[:, : 256 - d]).mean()))
        assert abs(best - wanted) <= 1.0, (number, wanted, best)


@EACH
def test_without_an_index(kind: str):
    seeded = KINDS[kind](seed=7)
    assert np.array_equal(seeded(PICTURE), seeded(PICTURE.copy()))
    # With one the seed counts.
    assert not np.array_equal(seeded(PICTURE, index=0), KINDS[kind](seed=8)(PICTURE, index=0))
    other = PICTURE.copy()
    other[0, 0] ^= 255
    assert seeded.record(PICTURE) != seeded.record(other)
    free = KINDS[kind]()
    assert not np.array_equal(free(PICTURE), free(PICTURE))
    with pytest.raises(ValueError, match="index"):
        free.record(PICTURE)
    with pytest.raises(ValueError, match="index"):
        seeded.record()


@EACH
def test_a_record_makes_it_again(kind: str):
    weather = KINDS[kind]()
    seen = weather.apply(PICTURE)
    text = json.dumps(seen.record)
    again = fl.augment.replay(json.loads(text))
    assert type(again) is type(weather)
    for index in (None, 5):
        assert np.array_equal(again(PICTURE, index=index), seen.image)
    assert again.record(index=9) == json.loads(text) | {"color": again.color}


@pytest.mark.parametrize("change", [
    {"transform": "Hail"}, {"version": 1}, {"version": None}, {"amount": 2.0}, {"amount": "much"},
    {"weather_seed": 1.5}, {"profile": "easy"}, {"veil": 2.0}, {"more": 1}, {"ground": 3},
    {"ground": {"horizon": math.nan}}, None, [], "snow", 3,
])  # fmt: skip
def test_a_record_that_is_none_is_refused(change: Any):
    record = Snowfall().apply(PICTURE).record
    with pytest.raises((TypeError, ValueError), match="must"):
        fl.augment.replay({**record, **change} if isinstance(change, dict) else change)
    record.pop("color")
    with pytest.raises(ValueError, match="color"):
        fl.augment.replay(record)


@EACH
def test_draws_fill_their_ranges(kind: str):
    weather = KINDS[kind](amount=(0.1, 0.9), shade=(0.0, 500.0), drops=(1.0, 9.0), seed=3)
    records = [weather.record(index=k) for k in range(400)]
    for name in ("amount", *DRAWN.keys() & vars(weather)):
        low, high = getattr(weather, name)
        values = np.array([record[name] for record in records])
        assert values.min() >= low and values.max() <= high
        # The mean of 400 uniform numbers, five standard errors.
        assert abs((values.mean() - low) / (high - low) - 0.5) < 5.0 / math.sqrt(12 * 400), name
    levels = {KINDS[kind](severity=(2, 4), seed=3).record(index=k)["amount"] for k in range(60)}
    assert levels == {0.4, 0.6, 0.8}


# From 3.12 on Python warns of any fork beside threads; the test is that it works.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

LARGE = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
JOBS = [(kind(severity=(2, 4), seed=7), index) for kind in KINDS.values() for index in range(6)]


def made(job: tuple[Any, int]) -> bytes:
    weather, index = job
    return bytes(weather(LARGE, index=index))


@pytest.fixture(scope="module")
def want() -> list[bytes]:
    # The parent has used its threads before anybody forks.
    return [made(job) for job in JOBS]


def by_processes(method: str, workers: int) -> list[bytes]:
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        futures = [pool.submit(made, job) for job in reversed(JOBS)]
        return [future.result(timeout=120) for future in futures][::-1]


def by_threads() -> list[bytes]:
    with ThreadPoolExecutor(8) as pool:
        return list(pool.map(made, JOBS))


def by_joblib() -> list[bytes]:
    import joblib

    many = joblib.Parallel(n_jobs=2, backend="loky", timeout=120)
    return list(many(joblib.delayed(made)(job) for job in JOBS))


@pytest.mark.parametrize("way", [
    partial(by_processes, "fork", 3), partial(by_processes, "spawn", 2),
    partial(by_processes, "forkserver", 1), by_threads, by_joblib,
])  # fmt: skip
def test_whoever_makes_them_pictures_are_the_same(way: Callable[[], Any], want: list[bytes]):
    assert way() == want and len(set(want)) == len(JOBS)


def test_without_a_seed_forked_workers_never_share_a_draw():
    with multiprocessing.get_context("fork").Pool(3) as pool:
        seeds = pool.map_async(drawn, [fl.augment.Snowfall()] * 60, chunksize=1).get(120)
    assert len(set(seeds)) == 60


def drawn(weather: Any) -> int:
    return int(weather.apply(LARGE[:8, :8]).record["weather_seed"])
