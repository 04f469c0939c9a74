"""What weather does to detectors that come inside packages: ours and that of other libraries.

    pip install "opencv-python-headless<5" albumentations==2.0.8 imagecorruptions matplotlib
    pip install scikit-image "setuptools<81"
    python benches/detectors.py --write    # docs/internals/detectors.md and its plot

OpenCV's cascade of faces, ORB and SIFT, ArUco markers and Farneback's dense flow, on photographs of
scikit-image. Each score is 1 in the clear and 0 where nothing is found. OpenCV's detector of
people finds nobody in these photographs with a margin, so it is left out. OpenCV 5 has no cascades.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from skimage import data

import flurries as fl

ROOT = Path(__file__).resolve().parents[1]
PAGE, PLOT = ROOT / "docs/internals/detectors.md", ROOT / "docs/images/detectors.webp"
SIZES, DRAWS, SEVERITIES = (256, 512), 3, (1, 2, 3, 4, 5)
OURS = {"snow": "Snowfall", "rain": "Rainfall", "fog": "Fog"}
# What is found in clear pictures, by detector and picture.
CLEAR: dict[tuple[str, int], Any] = {}
Weather = Callable[[np.ndarray, int], np.ndarray]


# Tasks: what is found of what is found in the clear ----------------------------------------------


def overlap(a: Any, b: Any) -> float:
    """Return intersection over union of boxes (x, y, w, h)."""
    x, y = max(a[0], b[0]), max(a[1], b[1])
    w, h = min(a[0] + a[2], b[0] + b[2]) - x, min(a[1] + a[3], b[1] + b[3]) - y
    both = max(w, 0) * max(h, 0)
    return float(both / (a[2] * a[3] + b[2] * b[3] - both))


def faces(picture: np.ndarray) -> list[Any]:
    found = cascade().detectMultiScale(grey(picture), 1.1, 5)
    return list(found)


def once(detect: Callable[[np.ndarray], Any], clear: np.ndarray, name: str = "") -> Any:
    """Return what is found in a clear picture; these are kept, so each is searched once."""
    key = name or detect.__name__, id(clear)
    if key not in CLEAR:
        CLEAR[key] = detect(clear)
    return CLEAR[key]


def found_again(detect: Callable[[np.ndarray], list[Any]], clear: Any, seen: Any) -> float:
    """Return the share of boxes of the clear picture that are found in the other."""
    wanted, got = once(detect, clear), detect(seen)
    return float(np.mean([any(overlap(a, b) > 0.4 for b in got) for a in wanted]))


def matched(kind: str, clear: np.ndarray, seen: np.ndarray) -> float:
    """Return the share of key points whose nearest likeness is where they were, within 3 px."""
    finder = cv2.SIFT_create(500) if kind == "SIFT" else cv2.ORB_create(500)
    norm = cv2.NORM_L2 if kind == "SIFT" else cv2.NORM_HAMMING
    before, one = once(lambda p: finder.detectAndCompute(grey(p), None), clear, kind)
    after, two = finder.detectAndCompute(grey(seen), None)
    if two is None or not len(after):
        return 0.0
    pairs = cv2.BFMatcher(norm).match(one, two)
    near = [
        np.hypot(*np.subtract(before[m.queryIdx].pt, after[m.trainIdx].pt)) < 3.0 for m in pairs
    ]
    return float(np.sum(near) / len(before))


def markers(clear: np.ndarray, seen: np.ndarray) -> float:
    """Return the share of sixteen markers that are read."""
    detector = cv2.aruco.ArucoDetector(dictionary(), cv2.aruco.DetectorParameters())
    _, numbers, _ = detector.detectMarkers(grey(seen))
    return 0.0 if numbers is None else len(set(numbers.ravel()) & set(range(16))) / 16.0


def flow(clear: np.ndarray, seen: np.ndarray, then: np.ndarray) -> float:
    """Return the share of pixels whose motion of (3, 2) px is found within a pixel."""
    found = cv2.calcOpticalFlowFarneback(grey(seen), grey(then), None, 0.5, 3, 21, 2, 7, 1.5, 0)
    inner = found[16:-16, 16:-16] - np.array([3.0, 2.0])
    return float((np.hypot(inner[..., 0], inner[..., 1]) < 1.0).mean())


@lru_cache(maxsize=1)
def cascade() -> Any:
    return cv2.CascadeClassifier(cv2.data.haarcascades + "haarcascade_frontalface_default.xml")


def dictionary() -> Any:
    return cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)


def grey(picture: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY))


# Pictures ----------------------------------------------------------------------------------------


@lru_cache(maxsize=64)
def photograph(name: str, size: int) -> np.ndarray:
    picture = getattr(data, name)()
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    return fl.io.fit(np.ascontiguousarray(picture[..., :3]), (size, size))


@lru_cache(maxsize=8)
def board(size: int) -> np.ndarray:
    """Sixteen markers on a photograph."""
    picture = photograph("coffee", size).copy()
    side, step = size // 8, size // 4
    for number in range(16):
        marker = cv2.aruco.generateImageMarker(dictionary(), number, side)
        edge = cv2.copyMakeBorder(marker, *[size // 64] * 4, cv2.BORDER_CONSTANT, value=255)
        row, column = divmod(number, 4)
        y, x = row * step + size // 32, column * step + size // 32
        picture[y : y + len(edge), x : x + len(edge)] = edge[..., None]
    return picture


def scores(weather: Weather, size: int) -> dict[str, float]:
    """Return what each detector still finds, the mean of several draws."""
    found: dict[str, list[float]] = {}
    for draw in range(DRAWS):
        face, marked = photograph("astronaut", size), board(size)
        busy = photograph(("coffee", "chelsea", "astronaut", "camera")[draw % 4], size)
        moved = np.roll(busy, (2, 3), axis=(0, 1))
        seen = weather(busy, draw)
        each = {
            "faces": found_again(faces, face, weather(face, draw)),
            "ORB": matched("ORB", busy, seen),
            "SIFT": matched("SIFT", busy, seen),
            "markers": markers(marked, weather(marked, draw)),
            # Weather of two moments: what is drawn anew for each frame.
            "flow": flow(busy, seen, weather(moved, draw + 100)),
        }
        for name, value in each.items():
            found.setdefault(name, []).append(value)
    return {name: float(np.mean(values)) for name, values in found.items()}


# Weathers ----------------------------------------------------------------------------------------


def weathers(kind: str, severity: int) -> dict[str, tuple[Weather, int]]:
    """Return by name a weather and the size of its pictures."""
    import albumentations as A
    import imagecorruptions

    found: dict[str, tuple[Weather, int]] = {}
    for profile in ("natural", "hard"):
        ours = getattr(fl.augment, OURS[kind])(severity=severity, profile=profile, seed=1)
        for size in SIZES if profile == "natural" else SIZES[1:]:
            name = f"flurries, {profile}, {size} px"
            found[name] = (lambda p, k, w=ours: w(p, index=k)), size
    level = severity / 5.0
    theirs = {
        "snow": lambda: A.RandomSnow(
            snow_point_range=(level / 2, level / 2), method="texture", p=1
        ),
        "rain": lambda: A.RandomRain(
            rain_type=("drizzle", "drizzle", "default", "heavy", "torrential")[severity - 1], p=1
        ),
    }  # fmt: skip

    def drawn(picture: np.ndarray, draw: int) -> np.ndarray:
        pipeline = A.Compose([theirs[kind]()], seed=draw)
        return np.asarray(pipeline(image=picture)["image"])

    if kind in theirs:
        found["albumentations, 512 px"] = drawn, 512
    if kind != "rain":

        def corrupted(picture: np.ndarray, draw: int) -> np.ndarray:
            np.random.seed(draw)  # noqa: NPY002 - the generator that it draws from
            vars(np)["float_"] = np.float64  # gone in NumPy 2
            seen = imagecorruptions.corrupt(picture, corruption_name=kind, severity=severity)
            return np.asarray(seen, np.uint8)

        found["imagecorruptions, 512 px"] = corrupted, 512
    return found


def measure() -> dict[str, dict[str, dict[str, list[float]]]]:
    """Return scores by kind, weather and detector, over the severities."""
    found: dict[str, dict[str, dict[str, list[float]]]] = {}
    for kind in OURS:
        for severity in SEVERITIES:
            for name, (weather, size) in weathers(kind, severity).items():
                for task, value in scores(weather, size).items():
                    by = found.setdefault(kind, {}).setdefault(name, {})
                    by.setdefault(task, []).append(value)
            print(kind, severity, flush=True)
    return found


def plot(found: dict[str, dict[str, dict[str, list[float]]]]) -> None:
    import matplotlib

    matplotlib.use("agg")
    from matplotlib import pyplot

    tasks = list(next(iter(found["snow"].values())))
    figure, axes = pyplot.subplots(
        len(OURS), len(tasks), figsize=(13, 6.2), sharex=True, sharey=True
    )
    styles = ["C0--", "C0-", "C3-", "C1:", "C2:"]
    for row, kind in zip(axes, OURS, strict=True):
        for axis, task in zip(row, tasks, strict=True):
            for name, values in found[kind].items():
                style = styles[list(found["snow"]).index(name)]
                axis.plot(SEVERITIES, values[task], style, label=name)
            axis.set_ylim(-0.03, 1.03)
            axis.set_title(f"{kind}: {task}", fontsize=9)
    lines, names = axes[0, 0].get_legend_handles_labels()
    figure.legend(lines, names, loc="lower center", ncols=5, fontsize=8, frameon=False)
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(PLOT, dpi=85)


def page(found: dict[str, dict[str, dict[str, list[float]]]]) -> str:
    lines = [
        "# What weather does to detectors\n",
        "Made by `python benches/detectors.py --write`, whose first lines say what it needs."
        " Scores of detectors that come inside OpenCV, 1 in the clear: a face found"
        " again, key points of ORB and SIFT found at their places, ArUco markers read, and pixels"
        " whose flow between two moments is right within a pixel. Means of"
        f" {DRAWS} draws at the severities 1 to 5; one face is little, so that goes in steps"
        " of a third. In our weather of 256 and of 512 px severities are to cost as"
        " much; other libraries have no severity of rain, so theirs are drizzle twice, default,"
        " heavy and torrential; albumentations' fog takes seconds for a picture and is left out.\n",
        "![Scores over severities](../images/detectors.webp)\n",
    ]  # fmt: skip
    for kind, by in found.items():
        tasks = list(next(iter(by.values())))
        lines += [f"\n## {kind.capitalize()}\n", "| weather | " + " | ".join(tasks) + " |",
                  "| --- " * (len(tasks) + 1) + "|"]  # fmt: skip
        for name, values in by.items():
            cells = [" ".join(f"{v:.2f}" for v in values[task]) for task in tasks]
            lines.append(f"| {name} | " + " | ".join(cells) + " |")
    rises, apart = [], {}
    for kind, by in found.items():
        ours = {n: v for n, v in by.items() if n.startswith("flurries")}
        for name, values in ours.items():
            for task, v in values.items():
                if max(np.diff(v)) > 0.02:
                    rises.append(f"{kind}, {name.removeprefix('flurries, ')}: {task}")
        small, large = (ours[f"flurries, natural, {size} px"] for size in SIZES)
        apart[kind] = max(
            float(np.abs(np.subtract(small[task], large[task])).max())
            for task in ("ORB", "SIFT", "markers")
        )
    lines += [
        "\n## What is not as it should be\n",
        "Our scores that rise by more than 0.02 from one severity to the next: "
        + ("; ".join(rises) or "none") + ".\n",
        f"ORB, SIFT and markers at 256 and 512 px differ by {max(apart.values()):.2f} at most. Our"
        f" fog, which has one opacity at all sizes, differs by {apart['fog']:.2f} too: key points"
        " of smaller pictures are fewer and fainter, and fall below detectors' thresholds first."
        " Similarity to the clear picture is even over sizes within .05"
        " (tests/test_augment_similarity.py), and a law that evened these scores would undo that.",
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="What weather does to detectors.")
    parser.add_argument("--write", action="store_true", help="write the page and the plot")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    cv2.setNumThreads(1)
    found = measure()
    text = page(found)
    print(text)
    if options.write:
        plot(found)
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
