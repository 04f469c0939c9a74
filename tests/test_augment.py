"""Weather for data sets: what comes back, how much there is of it, and that it can be had again."""

from __future__ import annotations

import copy
import json
import math
import pickle
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.augment import Fog, Ground, Rainfall, Snowfall, Weathered, contrast_loss, occlusion
from flurries.augment.air import Here
from flurries.augment.calibration import extinction
from flurries.augment.distance import SKY
from flurries.effects.looks import mean_square

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


# What comes back ---------------------------------------------------------------------------------


@EACH
@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("channels", [None, 1, 3])
def test_dtype_and_shape_stay_and_nothing_is_written(kind: str, dtype: str, channels: int | None):
    picture = DTYPES[dtype]
    picture = picture[..., 0] if channels is None else picture[..., :channels]
    before = picture.copy()
    seen = KINDS[kind](severity=4, seed=1)(picture, index=3)
    assert seen.shape == picture.shape and seen.dtype == picture.dtype
    assert np.array_equal(picture, before)
    assert not np.shares_memory(seen, picture)
    assert not np.array_equal(seen, picture)


@EACH
def test_dtypes_agree(kind: str):
    weather = KINDS[kind](severity=4, seed=1)
    exact = weather(DTYPES["f8"], index=3)
    # One rounding of the result, and of the half the picture's own.
    for name, step in (("u1", 0.5 / 255), ("u2", 0.5 / 65535), ("f4", 2e-7), ("f2", 2.0**-11)):
        seen = weather(DTYPES[name], index=3).astype(np.float64)
        seen /= {"u1": 255.0, "u2": 65535.0}.get(name, 1.0)
        assert np.abs(seen - exact).max() <= 1.01 * step + 3e-7, name


@EACH
def test_it_is_the_layer_over_the_picture(kind: str):
    weather = KINDS[kind](severity=4, seed=1)
    picture = DTYPES["f8"]
    seen, layer = weather(picture, index=3, return_layer=True)
    assert layer.shape == (48, 64, 4) and layer.dtype == np.float32
    want = layer[..., :3] + (1.0 - layer[..., 3:].astype(np.float64)) * picture
    assert np.abs(seen - want).max() < 1e-6
    assert np.array_equal(seen, weather(picture, index=3))


@EACH
def test_nothing_is_nothing(kind: str):
    for picture in DTYPES.values():
        assert np.array_equal(KINDS[kind](amount=0.0, seed=1)(picture, index=0), picture)


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


# More than one -----------------------------------------------------------------------------------


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
def test_a_clip_is_its_frames(kind: str):
    weather = KINDS[kind](severity=3, seed=1)
    frames = np.stack([PICTURE] * 3)
    seen = weather.clip(frames, index=5, fps=25.0, time=2.0)
    assert seen.shape == frames.shape
    for number in range(3):
        # At 25 frames a second, which is what a call takes for 30.
        one = weather.apply(PICTURE, index=5, time=2.0 + number / 25.0, fps=25.0).image
        assert np.array_equal(seen[number], one)
    assert not np.array_equal(seen[0], seen[1])
    grey = weather.clip(frames[..., 0], index=5)
    assert grey.shape == frames.shape[:3]


def test_a_depth_for_each():
    fog = Fog(visibility=50.0, patches=0.0, seed=1)
    images = np.stack([PICTURE] * 2)
    depth = np.stack([np.full((48, 64), d) for d in (5.0, 500.0)])
    for many in (fog.batch, fog.clip):
        seen = many(images, index=[0, 0] if many == fog.batch else 0, depth=depth)
        for number in range(2):
            one = fog(PICTURE, index=0, depth=depth[number])
            assert np.array_equal(seen[number], one)


def test_channels_that_come_first_are_named():
    with pytest.raises(ValueError, match="channels come last"):
        Snowfall()(np.zeros((3, 40, 50), np.uint8))
    with pytest.raises(ValueError, match=r"\.clip.*\.batch"):
        Snowfall()(np.zeros((2, 40, 50, 3), np.uint8))


def test_two_eyes_see_one_snow():
    # A flake at z is displaced by focal * distance / z, and nothing else differs: rows agree.
    snow = Snowfall(amount=0.06, seed=3, veil=0.0)
    picture = np.zeros((256, 256), np.uint8)
    _, _, left, right = snow.pair(picture, picture, index=0, distance=0.1, return_layer=True)
    view = snow._view((256, 256), 0.0, 0.05)
    here = Here(snow._air(snow.record(index=0)), view, snow._distances(None, view), 0.0)
    assert here.flakes is not None
    x, y, z = here.flakes.points.T
    focal = view.camera.focal
    column, row = 128 + focal * x / z, 128 + focal * y / z
    shift = focal * 0.05 / z
    large = (focal * here.flakes.radius / z > 3.0) & (
        here.flakes.opacity > 0.9 * here.flakes.opacity.max()
    )
    inside = (column - shift > 2) & (column + shift < 254) & (row > 2) & (row < 254) & large
    at = [
        layer[row[inside].astype(int), (column + sign * shift)[inside].astype(int), 3]
        for layer, sign in ((left, 1.0), (right, -1.0))
    ]
    # Where a flake's middle is there is something, in both eyes, at its own disparity.
    assert inside.sum() >= 10 and min(values.min() for values in at) > 0.15
    assert left[..., 3].mean() < 0.03
    same = snow.pair(picture, picture, index=0, distance=0.0)
    assert np.array_equal(same[0], same[1])


@pytest.mark.parametrize("kind", ["snow", "rain"])
def test_every_flake_has_the_disparity_of_its_depth(kind: str):
    """Drawn one by one for each eye: the centers of their pixels are focal * distance / z apart."""
    weather, apart, shape = KINDS[kind](severity=2, seed=3, veil=0.0), 0.1, (192, 256)
    air = weather._air(weather.record(index=0))
    views = [weather._view(shape, side * apart, 0.5 * apart) for side in (-0.5, 0.5)]
    eyes = [Here(air, view, weather._distances(None, view), 0.0) for view in views]
    flakes = eyes[0].flakes
    assert flakes is not None and eyes[1].flakes is not None
    assert np.array_equal(flakes.points, eyes[1].flakes.points)
    columns = np.arange(shape[1]) + 0.5
    errors, depths = [], []
    for number in range(len(flakes.points)):
        one = flakes.part(np.arange(len(flakes.points)) == number)
        z = float(one.points[0, 2])
        places = []
        for eye in eyes:
            plane = eye.drawn(one).astype(np.float64)
            rim = plane[:, [0, 1, -2, -1]].sum() + plane[[0, 1, -2, -1]].sum()
            if plane.sum() > 0.05 and rim == 0.0:
                places.append(float((plane.sum(axis=0) * columns).sum() / plane.sum()))
        if len(places) == 2:
            errors.append(places[0] - places[1] - views[0].camera.focal * apart / z)
            depths.append(z)
    assert len(errors) >= 20 and np.ptp(depths) > 0.5
    # Centers of discs on whole pixels, whose parts of pixels are sampled.
    assert np.abs(errors).max() < 0.15 and abs(np.mean(errors)) < 0.02
    # What pair() gives is these flakes and the texture, each with its own disparity.
    picture = np.zeros(shape, np.uint8)
    _, _, *layers = weather.pair(picture, picture, index=0, distance=apart, return_layer=True)
    for eye, layer in zip(eyes, layers, strict=True):
        whole = np.empty(shape, np.float32)
        eye.join(whole)
        assert np.abs(whole - layer[..., 3]).max() < 1e-5


def test_the_texture_of_two_eyes_has_its_disparity():
    """By correlation: what one eye sees, moved by a layer's disparity, is what the other sees."""
    snow = Snowfall(severity=5, seed=3, veil=0.0)
    air = snow._air(snow.record(index=0))
    both = []
    for side in (-0.5, 0.5):
        view = snow._view((256, 256), side * 0.1, 0.05)
        here = Here(air, view, snow._distances(None, view), 0.0)
        texture = here.texture
        assert texture is not None
        plane = np.empty((256, 256), np.float32)
        both.append([
            texture.drawn(layer, opacity=False, out=plane, add=False).copy()
            for layer in texture.layers(here.request(texture))
        ])  # fmt: skip
    for depth, left, right in zip(texture.patterns.depths, *both, strict=True):
        wanted = view.camera.focal * 0.1 / depth
        # The tiles' own share of the plane stays where it is; so columns near their middles.
        best = max(range(40), key=lambda d: float((left[:, d:] * right[:, : 256 - d]).mean()))
        assert abs(best - wanted) <= 1.0, (depth, wanted, best)


# Random numbers, records -------------------------------------------------------------------------


@EACH
def test_a_seed_and_an_index_are_all(kind: str):
    one, two = KINDS[kind](seed=7), KINDS[kind](seed=7)
    want = [one(PICTURE, index=k) for k in range(4)]
    # In another order, from another object.
    for k in (2, 0, 3, 1):
        assert np.array_equal(two(PICTURE, index=k), want[k])
    assert len({image.tobytes() for image in want}) == 4
    assert not np.array_equal(KINDS[kind](seed=8)(PICTURE, index=0), want[0])


@EACH
def test_without_an_index(kind: str):
    seeded = KINDS[kind](seed=7)
    assert np.array_equal(seeded(PICTURE), seeded(PICTURE.copy()))
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
    for again in (fl.augment.replay(json.loads(text)), KINDS[kind].replay(json.loads(text))):
        assert type(again) is type(weather)
        for index in (None, 5):
            assert np.array_equal(again(PICTURE, index=index), seen.image)
        assert again.record(index=9) == json.loads(text) | {"color": again.color}


@pytest.mark.parametrize("change", [
    {"transform": "Hail"}, {"version": 1}, {"version": None}, {"amount": 2.0}, {"amount": "much"},
    {"weather_seed": 1.5}, {"profile": "easy"}, {"veil": 2.0}, {"more": 1}, {"ground": 3},
    {"ground": {"horizon": math.nan}},
])  # fmt: skip
def test_a_record_that_is_none_is_refused(change: dict[str, Any]):
    record = Snowfall().apply(PICTURE).record
    with pytest.raises((TypeError, ValueError)):
        fl.augment.replay({**record, **change})
    for wrong in (None, [], "snow", 3):
        with pytest.raises(TypeError, match="record"):
            fl.augment.replay(wrong)  # type: ignore[arg-type]
    record.pop("color")
    with pytest.raises(ValueError, match="color"):
        fl.augment.replay(record)


@EACH
def test_draws_fill_their_ranges(kind: str):
    weather = KINDS[kind](amount=(0.1, 0.9), seed=3)
    records = [weather.record(index=k) for k in range(400)]
    for name in ("amount", *weather.DRAWN):
        low, high = getattr(weather, name)
        values = np.array([record[name] for record in records])
        assert values.min() >= low and values.max() <= high
        # The mean of 400 uniform numbers, five standard errors.
        assert abs((values.mean() - low) / (high - low) - 0.5) < 5.0 / math.sqrt(12 * 400), name
    levels = {KINDS[kind](severity=(2, 4), seed=3).record(index=k)["amount"] for k in range(60)}
    assert levels == {0.4, 0.6, 0.8}


@EACH
def test_objects_pickle_small(kind: str):
    weather = KINDS[kind](severity=(1, 4), seed=7)
    text = pickle.dumps(weather)
    assert len(text) <= 4096
    want = weather(PICTURE, index=7)
    for again in (pickle.loads(text), copy.copy(weather), copy.deepcopy(weather)):
        assert again == weather and np.array_equal(again(PICTURE, index=7), want)


@pytest.mark.parametrize("name, nearest", [
    ("severty", "severity"), ("profil", "profile"), ("colour", "color"), ("wnd", "wind"),
])  # fmt: skip
def test_an_unknown_field_is_answered_with_the_nearest(name: str, nearest: str):
    for kind in KINDS.values():
        with pytest.raises(TypeError, match=f"no argument {name}; did you mean '{nearest}'"):
            kind(**{name: 1})
    with pytest.raises(TypeError, match="it has amount"):
        Snowfall(xyz=1)  # type: ignore[call-arg]


# How much ----------------------------------------------------------------------------------------


def test_the_scale_of_severities():
    assert [round(contrast_loss(n / 5), 3) for n in range(6)] == [0, 0.06, 0.14, 0.25, 0.38, 0.55]
    for kind, hardest in (("snow", 0.267), ("rain", 0.368), ("fog", 0.6)):
        hard = [contrast_loss(n / 5, profile="hard", weather=kind) for n in range(6)]  # type: ignore[arg-type]
        assert hard[0] == 0.0 and hard[5] == hardest and (np.diff(hard) > 0.0).all()
        # It begins harder.
        assert hard[1] > contrast_loss(0.2)
    for wrong in (-0.1, 1.1, math.nan, "x"):
        with pytest.raises((TypeError, ValueError), match="amount"):
            contrast_loss(wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="profile"):
        contrast_loss(0.5, profile="easy")  # type: ignore[arg-type]


def boxed(plane: np.ndarray, cells: int = 64) -> np.ndarray:
    """Means over cells of equal area, parts of pixels as parts."""
    size = plane.shape[0]
    edges = np.arange(cells + 1) * size / cells
    sums = np.zeros(size + 1)

    def along(values: np.ndarray) -> np.ndarray:
        sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
        first = np.minimum(edges.astype(int), size - 1)
        at = sums[first] + (edges - first)[:, None] * (sums[first + 1] - sums[first])
        return np.diff(at, axis=0) * cells / size

    assert sums.shape == (size + 1,)
    return along(along(plane.astype(np.float64)).T).T


@EACH
@pytest.mark.parametrize("severity", [1, 3, 5])
def test_a_severity_is_the_same_at_every_size(kind: str, severity: int):
    """Three statistics, box-filtered to cells, agree within 5 % at 64 to 2160 px.

    Flakes differ from size to size, so many pictures are taken. Below 512 px they are fewer and
    denser on purpose, so that their structure counts for as much (test_augment_similarity.py): by
    the power 0.6 of the size. The unevenness of what is rarer by n is sqrt(n) times as large, at
    most; at 64 px cells are no wider than flakes are drawn, and it is not compared.
    """
    weather = KINDS[kind](severity=severity, seed=5)
    found = {}
    sizes = ((512, 6), (64, 6), (224, 6)) if kind == "fog" else ((512, 6), (64, 12), (224, 8))
    if severity == 3:
        # Large ones once: a law of sizes and one of severities.
        sizes = (*sizes, (2160, 1 if kind == "fog" else 2))
    cells = 64 if kind == "fog" else 32
    for size, count in sizes:
        values = []
        for index in range(count):
            dark, bright = np.zeros((size, size)), np.ones((size, size))
            low, high = (boxed(weather(p, index=index), cells) for p in (dark, bright))
            alpha = 1.0 - (high - low)
            # The contrast of two pictures that is lost; the light that is added; its unevenness.
            values.append([alpha.mean(), low.mean(), alpha.std()])
        found[size] = np.array(values)
    for size, values in found.items():
        # Fog is the same at every size; what falls has other flakes, so its deviations are known
        # to three standard errors.
        same = found[512][: len(values) if kind == "fog" else None]
        want, error = same.mean(axis=0), np.zeros(3)
        most = np.full(3, 1.05)
        if kind != "fog":
            for some in (values, same):
                error += 3.0 * some.std(axis=0) / np.sqrt(len(some))
            most[2] = {64: np.inf, 224: 1.05 * (512 / 224) ** 0.3}.get(size, 1.05)
        got = values.mean(axis=0)
        assert (got <= most * want + error).all(), size
        least = np.array([0.95, 0.95, 0.0 if kind != "fog" and size == 64 else 0.95])
        assert (got >= least * want - error).all(), size
        assert values[:, 0].mean() == pytest.approx(contrast_loss(severity / 5), rel=0.05)


@EACH
def test_severities_without_a_ground_and_with_depths(kind: str):
    rng = np.random.default_rng(1)
    depth = np.exp(rng.uniform(np.log(3.0), np.log(300.0), (256, 256)))
    for arguments, given in (({"ground": None}, None), ({}, depth), ({}, 40.0)):
        weather = KINDS[kind](severity=3, seed=2, **arguments)
        black = np.zeros((256, 256))
        loss = [
            1.0 - (weather(black + 1.0, index=k, depth=given)
                   - weather(black, index=k, depth=given)).mean()
            for k in range(6)
        ]  # fmt: skip
        assert np.mean(loss) == pytest.approx(contrast_loss(0.6), rel=0.05)


def test_the_control_of_the_sizes_notices_a_texture_in_pixels():
    # The same tile of pixels at every size: what the usual libraries do. The statistic sees it.
    spread = []
    for size in (64, 512):
        alpha = fl.spectral.alpha((size, size), drift=(0.0, 0.0), seed=1, mean=0.2, spread=2.0)
        spread.append(boxed(alpha).std())
    assert abs(spread[1] / spread[0] - 1.0) > 0.4


@pytest.mark.parametrize("mean", [-0.4, -0.1, 0.0, 0.14, 0.5, 1.2])
@pytest.mark.parametrize("deviation", [0.05, 0.25, 1.0])
def test_mean_square_is_the_integral(mean: float, deviation: float):
    z = np.linspace(-10.0, 10.0, 400_001)
    weight = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) * (z[1] - z[0])
    want = (np.clip(mean + deviation * z, 0.0, 1.0) ** 2 * weight).sum()
    assert mean_square(mean, deviation) == pytest.approx(want, rel=1e-6, abs=1e-12)


def test_extinction_is_the_root():
    rng = np.random.default_rng(2)
    for _ in range(50):
        depth = rng.uniform(0.5, 200.0, 100)
        clear = rng.uniform(0.9, 1.0, (100, 1))
        density = np.maximum(1.0 + 0.3 * rng.standard_normal(7), 0.05)
        loss = rng.uniform(0.12, 0.6)
        found = extinction(loss, depth, clear, density)
        left = (clear * np.exp(-found * depth[:, None] * density)).mean()
        assert left == pytest.approx(1.0 - loss, rel=1e-6)
    assert extinction(0.05, depth, np.full((100, 1), 0.9), np.ones(1)) == 0.0


# Depth -------------------------------------------------------------------------------------------


def test_fog_is_koschmieder():
    depth = np.random.default_rng(3).uniform(1.0, 300.0, (40, 50))
    depth[:5] = np.inf
    picture = np.random.default_rng(4).random((40, 50, 3))
    fog = Fog(visibility=80.0, patches=0.0, color=(0.7, 0.8, 0.9))
    clear = np.exp(-depth * math.log(20.0) / 80.0)[..., None]
    clear[:5] = np.exp(-max(SKY, 2.0 * depth[5:].max()) * math.log(20.0) / 80.0)
    want = picture * clear + np.array([0.7, 0.8, 0.9]) * (1.0 - clear)
    assert np.abs(fog(picture, depth=depth) - want).max() < 1e-6


def test_flakes_stay_behind_what_is_nearer():
    snow = Snowfall(severity=5, seed=1)
    air, view = snow._air(snow.record(index=0)), snow._view((128, 128))
    far = air.alpha(view, snow._distances(200.0, view), time=0.0, veil=0.0)
    near = air.alpha(view, snow._distances(2.0, view), time=0.0, veil=0.0)
    nothing = air.alpha(view, snow._distances(0.3, view), time=0.0, veil=0.0)
    # Four times as dense, at most, so that near pictures have their flakes too.
    assert far.mean() > near.mean() > 0.0 and nothing.max() == 0.0
    # A wall in the left half hides there what it hides everywhere, and nothing in the right half.
    wall = np.full((128, 128), 200.0)
    wall[:, :64] = 2.0
    half = air.alpha(view, snow._distances(wall, view), time=0.0, veil=0.0)
    # There are so many more flakes that the picture loses as much: half of it sees few of them.
    assert air.falling is not None
    reach = air.falling.far - air.falling.near
    depths = snow._distances(wall, view).quantiles
    more = 1.0 / np.clip((depths - air.falling.near) / reach, 0.0, 1.0).mean()
    assert more == pytest.approx(1.0 / (0.5 + 0.5 * 1.3 / 9.3), rel=0.02)
    many = replace(air, falling=replace(air.falling, depth=more * air.falling.depth))
    dense = many.alpha(view, snow._distances(200.0, view), time=0.0, veil=0.0)
    assert np.allclose(half[:, 66:], dense[:, 66:], rtol=0.0, atol=1e-5)
    assert half[:, :62].mean() < 0.5 * dense[:, :62].mean()


def filled(depth: np.ndarray) -> np.ndarray:
    """Holes filled pixel by pixel, as the page says."""
    result = depth.copy()
    known = ~(np.isnan(depth) | (depth == 0.0))
    rows = [i for i in range(len(depth)) if known[i].any()]
    for i, j in np.ndindex(depth.shape):
        row = min(rows, key=lambda k: (abs(k - i), k))
        column = min(np.flatnonzero(known[row]), key=lambda k: (abs(k - j), k))
        result[i, j] = depth[row, column]
    return result


@EACH
def test_holes_in_a_depth_are_filled_from_their_row(kind: str):
    rng = np.random.default_rng(9)
    depth = rng.uniform(3.0, 60.0, (48, 64))
    holes = rng.random((48, 64)) < 0.4
    holes[:7] = holes[20:29] = holes[-1] = True
    depth[0, 3] = depth[30, 5] = np.inf
    holes[0, 3] = holes[30, 5] = False
    depth[holes] = np.where(rng.random(int(holes.sum())) < 0.5, np.nan, 0.0)
    weather = KINDS[kind](severity=4, seed=1)
    whole = filled(depth)
    assert np.array_equal(
        weather(PICTURE, index=2, depth=depth), weather(PICTURE, index=2, depth=whole)
    )
    # The label has holes where the depth had them and no flake is, and nothing is made up.
    seen = weather.apply(PICTURE, index=2, depth=depth)
    plain = weather.apply(PICTURE, index=2, depth=whole)
    nearer = plain.depth < KINDS[kind](amount=0.0).apply(PICTURE, depth=whole).depth
    label = np.where(nearer, plain.depth, depth.astype(np.float32))
    assert np.array_equal(seen.depth[holes], label[holes], equal_nan=True)
    assert np.array_equal(seen.depth[~holes], plain.depth[~holes])
    assert np.array_equal(seen.soft_depth[holes], depth[holes].astype(np.float32), equal_nan=True)


@pytest.mark.parametrize("ground", [Ground(), Ground(horizon=0.3, height=3.0, far=80.0)])
def test_a_ground_is_found_in_a_depth(ground: Ground):
    rng = np.random.default_rng(3)
    rows = np.repeat(ground.rows((240, 320), 1.2 * 320), 320, axis=1).astype(np.float64)
    depth = rows * np.exp(0.03 * rng.standard_normal((240, 320)))
    depth[60:200, 40:90] = 6.0  # what stands there
    depth[rng.random((240, 320)) < 0.2] = 0.0
    depth[:20] = np.inf
    found = Ground.from_depth(depth, focal=1.2)
    assert found.horizon == pytest.approx(ground.horizon, abs=0.03)
    assert found.height == pytest.approx(ground.height, rel=0.05)
    below = slice(150, 240)
    got = found.rows((240, 320), 1.2 * 320)[below]
    assert np.allclose(got, ground.rows((240, 320), 1.2 * 320)[below], rtol=0.05)
    for none in (rng.uniform(2.0, 9.0, (64, 64)), np.full((64, 64), 5.0), np.zeros((64, 64))):
        with pytest.raises(ValueError, match="depth must"):
            Ground.from_depth(none)


def test_a_ground_comes_from_files():
    ground = {"horizon": 0.3, "height": 2.0}
    for kind in KINDS.values():
        weather = kind(ground=ground, severity=3, seed=1)
        assert weather.ground == Ground(**ground)
        record = json.loads(json.dumps(weather.record(index=2)))
        assert fl.augment.replay(record).record(index=2) == weather.record(index=2)
    with pytest.raises(TypeError, match="ground must be a Ground, a dict of far, height, horizon"):
        Snowfall(ground={"horizont": 0.3})


def test_relative_depths_become_metres():
    greys = np.random.default_rng(5).integers(0, 256, (48, 64), dtype=np.uint8)
    painted = fl.DepthMap(greys, near=2.0, far=80.0, law="inverse")
    fog = Fog(visibility=50.0, seed=1)
    metres = painted.depth_of(greys / 255.0)
    assert np.allclose(
        fog(DTYPES["f8"], index=0, depth=painted), fog(DTYPES["f8"], index=0, depth=metres),
        atol=1e-6,
    )  # fmt: skip


def test_the_ground_is_a_plane_with_a_horizon():
    rows = Ground(horizon=0.5, height=2.0, far=50.0).rows((100, 100), 120.0)[:, 0]
    assert (np.diff(rows) < 0.0).all() and rows[0] == pytest.approx(50.0, rel=0.02)
    # Far below the horizon the rounding is gone: 1 / (y / (f h) + 1 / far).
    assert rows[99] == pytest.approx(1.0 / (49.5 / 240.0 + 1.0 / 50.0), rel=0.02)


# Labels ------------------------------------------------------------------------------------------


def test_occlusion_is_the_mean_opacity():
    alpha = np.random.default_rng(6).random((30, 40)).astype(np.float32)
    boxes = [[0, 0, 40, 30], [3, 4, 17, 9], [2.5, 3.25, 2.75, 7.0], [-5, -5, 10, 10],
             [50, 50, 60, 60], [4, 4, 4, 9]]  # fmt: skip
    found = occlusion(alpha, boxes)
    # Each pixel cut into 8 x 8 parts: exact for eighths.
    fine = np.kron(alpha.astype(np.float64), np.ones((8, 8)))
    for (x0, y0, x1, y1), value in zip(boxes, found, strict=True):
        columns = slice(max(int(8 * x0), 0), max(int(8 * x1), 0))
        part = fine[max(int(8 * y0), 0) : max(int(8 * y1), 0), columns]
        if part.size == 0:
            assert math.isnan(value)
        else:
            assert value == pytest.approx(part.mean(), abs=1e-12)
    assert occlusion(alpha, []).shape == (0,)


@EACH
def test_labels_come_along(kind: str):
    rng = np.random.default_rng(7)
    shape = (384, 512)
    boxes, masks = np.array([[1.0, 2.0, 30.0, 40.0]]), [rng.random(shape) > 0.5]
    depth = rng.uniform(6.0, 60.0, shape)
    flow = rng.standard_normal((*shape, 2)).astype(np.float32)
    kept = flow.copy(), depth.copy()
    # So short an exposure that drops hide what is behind them.
    sharp = {} if kind == "fog" else {"exposure": 1e-4}
    seen = KINDS[kind](severity=5, seed=1, **sharp).apply(
        np.zeros(shape), index=0, boxes=boxes, masks=masks, depth=depth, flow=flow, motion=True
    )
    assert isinstance(seen, Weathered)
    assert seen.boxes is boxes and seen.masks is masks
    assert np.array_equal(flow, kept[0]) and np.array_equal(depth, kept[1])
    assert seen.occlusion == pytest.approx([seen.alpha[2:40, 1:30].mean()], rel=1e-6)
    metres = depth.astype(np.float32)
    covered = seen.depth < metres
    # Fog hides, but is nowhere in particular.
    assert covered.any() == (kind != "fog")
    assert np.array_equal(seen.depth[~covered], metres[~covered])
    assert (seen.alpha[covered] > 0.5).all()
    changed = (seen.flow != flow).any(axis=-1)
    assert changed[covered].all()
    assert np.array_equal(seen.flow[changed], seen.motion[changed])
    assert np.array_equal(seen.layer[..., 3], seen.alpha)


@EACH
def test_soft_labels_are_means_by_what_is_seen(kind: str):
    rng = np.random.default_rng(8)
    shape = (96, 128)
    depth, flow = rng.uniform(6.0, 60.0, shape), rng.standard_normal((*shape, 2))
    boxes = [[4.0, 5.0, 60.0, 80.0], [0.0, 0.0, 128.0, 96.0]]
    seen = KINDS[kind](severity=4, seed=1).apply(
        np.zeros(shape), index=0, depth=depth, flow=flow, boxes=boxes, motion=True
    )
    way, nearness, alpha = seen.falling[..., :2], seen.falling[..., 2], seen.falling[..., 3]
    assert seen.falling.shape == (*shape, 4) and seen.falling.dtype == np.float32
    # Something falls in rain and snow; and the veil is over it.
    assert (alpha.max() > 0.2) == (kind != "fog") and (alpha <= seen.alpha + 1e-4).all()
    left = 1.0 - alpha[..., None]
    assert np.allclose(seen.soft_flow, left * flow + way, atol=1e-4)
    assert np.allclose(1.0 / seen.soft_depth, left[..., 0] / depth + nearness, atol=1e-5)
    assert (seen.soft_depth <= depth * 1.001).all()
    if kind != "fog":
        # Its own depth is between the nearest flake's and the farthest's.
        some = alpha > 0.05
        metres = alpha[some] / nearness[some]
        assert metres.min() > 0.4 and metres.max() < 12.0
        assert (way[..., 1][some] > 0.0).all()
    for number, (x0, y0, x1, y1) in enumerate(np.array(boxes, int)):
        part = seen.alpha[y0:y1, x0:x1]
        assert seen.occlusion[number] == pytest.approx(part.mean(), rel=1e-5)
        assert seen.visibility[number] == pytest.approx((part < 0.5).mean(), abs=1e-6)
        wanted = alpha[y0:y1, x0:x1].mean()
        assert seen.coverage[number] == pytest.approx(wanted, rel=1e-5, abs=1e-6)


@pytest.mark.parametrize("kind", ["snow", "rain"])
@pytest.mark.parametrize("profile, size", [
    ("natural", 224), ("natural", 1024), ("hard", 512),
])  # fmt: skip
def test_structure_grows_with_every_severity(kind: str, profile: str, size: int):
    """The deviation of what is finer than 8 px; and a veil holds at most a third."""
    fine = []
    for severity in range(1, 6):
        weather = KINDS[kind](severity=severity, seed=3, profile=profile)
        alphas = [weather.apply(np.zeros((size, size)), index=k).alpha for k in range(2)]
        rows = np.stack(alphas)[:, : size // 8 * 8, : size // 8 * 8].astype(np.float64)
        cells = rows.reshape(2, size // 8, 8, size // 8, 8)
        fine.append((cells - cells.mean(axis=(2, 4), keepdims=True)).std())
        loss = contrast_loss(severity / 5, profile=profile, weather=kind)
        assert np.mean([alpha.min() for alpha in alphas]) <= loss / 3.0
    assert (np.diff(fine) > 0.0).all(), fine
