"""Write docs/internals/severities.md: what each severity of each profile takes, measured.

python docs/make_severities.py

Wants `opencv-python-headless`, for corners and motion.
"""

from __future__ import annotations

import itertools
import math
import os
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from skimage import data
from skimage.metrics import structural_similarity

import flurries as fl

PAGE = Path(__file__).parent / "internals" / "severities.md"
KINDS = ("Snowfall", "Rainfall", "Fog")
PROFILES = ("natural", "hard")
NAMES = (
    "astronaut", "coffee", "chelsea", "rocket", "camera", "hubble_deep_field", "retina", "coins",
    "immunohistochemistry", "page", "moon", "clock",
)  # fmt: skip
MADE = 8  # Pictures of our own: leaves of all sizes that cover one another.
KEYPOINTS, NEAR = 300, 48  # Most corners, and bits in which two that are alike may differ.
SHIFT = (2, 1)
# Of each weather, by size: small pictures show few drops, by chance more or fewer of them.
DRAWS = {128: 12, 224: 4, 512: 1, 1024: 1}


def leaves(seed: int, size: int) -> np.ndarray:
    """Return discs and boxes of all sizes over one another, as things in a photograph are."""
    rng = np.random.default_rng(seed)
    picture = np.empty((size, size, 3))
    y, x = np.mgrid[:size, :size] / size
    picture[...] = rng.random(3)
    for _ in range(500):
        radius = 0.02 / (0.02 + 0.98 * rng.random())
        across, down = rng.random(2)
        near = np.hypot(x - across, y - down) if rng.random() < 0.5 else np.maximum(
            abs(x - across), abs(y - down)
        )  # fmt: skip
        grain = 0.06 * rng.standard_normal((size, size, 1))
        inside = near < 0.25 * radius
        picture[inside] = (rng.random(3) * (0.6 + 0.4 * x[..., None]) + grain)[inside]
    return np.rint(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8)


def photograph(number: int, size: int) -> np.ndarray:
    """Return one of them, (size, size, 3) uint8."""
    if number >= len(NAMES):
        return leaves(number, size)
    picture = getattr(data, NAMES[number])()
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    return np.asarray(fl.io.fit(np.ascontiguousarray(picture[..., :3]), (size, size)))


def described(grey: np.ndarray) -> np.ndarray | None:
    """Return the descriptors of the strongest corners; None where there are none."""
    return cv2.ORB_create(nfeatures=KEYPOINTS, fastThreshold=10).detectAndCompute(grey, None)[1]  # type: ignore[no-any-return]


def matches(one: np.ndarray | None, other: np.ndarray | None) -> int:
    """Return how many corners find one another."""
    if one is None or other is None:
        return 0
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(one, other)
    return sum(pair.distance <= NEAR for pair in pairs)


def followed(one: np.ndarray, other: np.ndarray) -> float:
    """Return how much of the motion is found: 1 less the error over its length, no less than 0."""
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM).calc(one, other, None)
    error = np.hypot(flow[..., 1] + SHIFT[0], flow[..., 0] + SHIFT[1])[16:-16, 16:-16]
    return float(np.maximum(1.0 - error / math.hypot(*SHIFT), 0.0).mean())


def measured(case: tuple[int, int]) -> dict[tuple[str, str, int], tuple[float, ...]]:
    """Return SSIM, matches, flow, and the veil's share of a photograph in each weather."""
    cv2.setNumThreads(1)
    number, size = case
    whole = photograph(number, size + 8)
    first, then = (
        np.ascontiguousarray(whole[4 + y : size + 4 + y, 4 + x : size + 4 + x])
        for y, x in ((0, 0), SHIFT)
    )
    greys = [cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in (first, then)]
    clear, found = described(greys[0]), {}
    found["", "", 0] = 1.0, matches(clear, clear), followed(*greys), 0.0, 0.0
    for kind, profile, severity in itertools.product(KINDS, PROFILES, range(1, 6)):
        draws = []
        for seed in range(11, 11 + DRAWS[size]):
            weather = getattr(fl.augment, kind)(severity=severity, profile=profile, seed=seed)
            seen = weather.apply(first, index=number)
            film = weather.clip(np.stack([first, then]), index=number)
            grey = cv2.cvtColor(seen.image, cv2.COLOR_RGB2GRAY)
            lost = float(seen.alpha.mean(dtype=np.float64))
            draws.append((
                structural_similarity(greys[0], grey), matches(clear, described(grey)),
                followed(*(cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY) for frame in film)), lost,
                float(np.quantile(seen.alpha, 0.1, axis=1).mean()) / lost,
            ))  # fmt: skip
        found[kind, profile, severity] = tuple(np.mean(draws, axis=0))
    return found


HEAD = """# What a severity takes

Written by `python docs/make_severities.py`: means over {count} pictures, {photographs} photographs
of scikit-image and {made} made of leaves that cover one another, in {draws} draws of each weather.

- lost: the mean opacity, which is the share of contrast that is lost, at 512 px.
- SSIM: that of the picture with itself in weather.
- ORB: how many of {keypoints} corners find one another in the clear and the weathered picture.
- flow: how much of a motion of {shift} px between two frames of a film in weather is found (DIS):
  1 less the error over the motion's length, no less than 0 at any pixel.
- veil: the 10 % quantile of the opacity's rows over their mean: what no pixel is without. Pictures
  of few pixels show no single flake far away, so natural snow and rain are mostly a veil: {small}

{verdict}
"""


def page(results: dict[int, list[dict[tuple[str, str, int], tuple[float, ...]]]]) -> str:
    """Return the page."""
    mean = {
        size: {key: np.mean([one[key] for one in found], axis=0) for key in found[0]}
        for size, found in results.items()
    }
    steps = []
    for size, found in results.items():
        for kind, (column, name) in itertools.product(KINDS, enumerate(("SSIM", "ORB", "flow"))):
            natural, hard = (
                np.array([[one[kind, p, s][column] for one in found] for s in range(1, 6)])
                for p in PROFILES
            )
            clear = np.array([[one["", "", 0][column] for one in found]])
            steps += [
                (f"{name} of {kind}, {profile}, {size} px at {s + 1}", *pair)
                for profile, scale in zip(PROFILES, (natural, hard), strict=True)
                for s, pair in enumerate(itertools.pairwise([*clear, *scale]))
            ] + [
                (f"{name} of hard {kind} at {s + 1}, {size} px", *pair)
                for s, pair in enumerate(zip(natural, hard, strict=True))
            ]  # fmt: skip
    rising, unsure = [], []
    for what, above, below in steps:
        step = float((below - above).mean())
        error = float((below - above).std(ddof=1)) / math.sqrt(len(above))
        if step > -2.0 * error and above.mean() > 0.0:
            (rising if step >= 0.0 else unsure).append(f"{what} ({step:+.2g} ± {error:.1g})")
    veil = ", ".join(
        f"{max(table[kind, 'natural', s][4] for s in range(1, 6)):.2f} ({kind}, {size} px)"
        for kind in KINDS[:2] for size, table in mean.items()
    )  # fmt: skip
    hard = max(
        table[kind, "hard", s][4]
        for kind in KINDS[:2] for table in mean.values() for s in range(1, 6)
    )  # fmt: skip
    verdict = (
        "All three fall at every step, and hard weather is below natural weather at every step and"
        f" size, but for: {'; '.join(rising) or 'none'}. Within two standard errors over the"
        f" pictures of no step at all: {'; '.join(unsure) or 'none'}."
    )
    small = f"at most {veil}. In hard weather it is at most {hard:.2f}, at every size."
    text = [HEAD.format(
        count=len(NAMES) + MADE, photographs=len(NAMES), made=MADE, keypoints=KEYPOINTS,
        shift=SHIFT, small=small, verdict=verdict,
        draws=", ".join(f"{draws} (at {size} px)" for size, draws in DRAWS.items()),
    )]  # fmt: skip
    for kind in KINDS:
        text += [
            f"## {kind}\n",
            "| profile, severity | weather | lost | " + " | ".join(
                f"{name} at {size}" for name in ("SSIM", "ORB", "flow", "veil") for size in mean
            ) + " |",
            "| --- | --- | --- |" + " --- |" * (4 * len(mean)),
        ]  # fmt: skip
        for profile in PROFILES:
            for severity in range(1, 6):
                said, _ = getattr(fl.augment, kind)(severity=severity, profile=profile).strength()
                rows = {size: table[kind, profile, severity] for size, table in mean.items()}
                numbers = [f"{rows[512][3]:.3f}"]
                numbers += [
                    f"{row[column]:{'.0f' if column == 1 else '.2f'}}"
                    for column in (0, 1, 2, 4) for row in rows.values()
                ]  # fmt: skip
                weather = str(said).rpartition(", ")[0]
                text.append(f"| {profile} {severity} | {weather} | {' | '.join(numbers)} |")
        text.append("")
    clear = ", ".join(
        f"{table['', '', 0][1]:.0f} and {table['', '', 0][2]:.2f} at {size} px"
        for size, table in mean.items()
    )  # fmt: skip
    return "\n".join([*text, f"Clear pictures have ORB and flow of {clear}.\n"])


def main() -> None:
    numbers = range(len(NAMES) + MADE)
    cases = [(number, size) for size in reversed(DRAWS) for number in numbers]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = dict(zip(cases, pool.map(measured, cases), strict=True))
    text = page({size: [found[number, size] for number in numbers] for size in DRAWS})
    PAGE.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
