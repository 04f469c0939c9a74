"""The benchmark: one set for everybody, told by its hashes, and scores that are known by hand."""

import itertools
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flurries.augment.benchmark import CLEAR, NAME, make, score
from flurries.cli import main
from flurries.io import write_picture

NAMES = ("cat/a.png", "cat/b.png", "dog/c.png", "dog/d.png")
PARTS = 2 * 3 * 5
MOTION = (3.0, -4.0)  # How far each picture's content moves until the next: x and y.


def table(classes: Iterable[str]) -> str:
    return "".join(f"{name},{one}\n" for name, one in zip(NAMES, classes, strict=True))


def pictures(folder: Path) -> Path:
    random = np.random.default_rng(1)
    for name in NAMES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_picture(folder / name, random.integers(0, 256, (24, 32, 3), np.uint8))
    boxes = [(1, 1, [2, 2, 10, 8]), (2, 1, [4, 4, 8, 10]), (3, 2, [0, 0, 20, 20])]
    (folder / "boxes.json").write_text(json.dumps({
        "images": [{"id": n + 1, "file_name": name[4:]} for n, name in enumerate(NAMES)],
        "categories": [{"id": 1, "name": "cat"}, {"id": 2, "name": "dog"}],
        "annotations": [
            {"id": n + 1, "image_id": image, "category_id": kind, "bbox": box, "iscrowd": 0,
             "area": box[2] * box[3]} for n, (image, kind, box) in enumerate(boxes)],
    }))  # fmt: skip
    (folder / "classes.csv").write_text(table("xyxy"))
    (folder / "flow").mkdir()
    flow = np.full((24, 32, 2), MOTION, np.float32)
    flow[:12] = 2e9  # Not known.
    head = np.array([202021.25], np.float32).tobytes() + np.array([32, 24], np.int32).tobytes()
    (folder / "flow" / "a.flo").write_bytes(head + flow.tobytes())
    return folder


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return pictures(tmp_path_factory.mktemp("of") / "in")


@pytest.fixture(scope="module")
def benchmark(folder: Path) -> Path:
    out = folder.parent / "out"
    assert make(folder, out, workers=1) == ([], {})
    return out


def test_a_set_is_made_once_and_told_from_others(benchmark: Path, folder: Path, tmp_path: Path):
    ((_, hashes),) = json.loads((benchmark / NAME).read_text())["hashes"].items()
    assert len(hashes) == len(set(hashes.values())) == PARTS + 1
    assert all((benchmark / CLEAR / n).read_bytes() == (folder / n).read_bytes() for n in NAMES)
    seen = [(benchmark / "hard" / "snow" / k / "cat" / "a.png").read_bytes() for k in "123"]
    assert len(set(seen)) == 3 and (benchmark / "hard/rain/5/boxes.json").exists()
    # The same pictures elsewhere give the same set; one more level of one pixel another one, whose
    # clear pictures and every part differ.
    same = pictures(tmp_path / "same")
    how = {"workers": 1, "include": "*.png"}
    assert make(same, tmp_path / "1", like=benchmark / NAME, **how) == ([], {})
    changed = np.random.default_rng(1).integers(0, 256, (24, 32, 3), np.uint8)
    changed[3, 4, 0] ^= 1
    write_picture(same / NAMES[0], changed)
    differs, _ = make(same, tmp_path / "2", like=benchmark / NAME, **how)
    # What flakes hide of one level rounds away in a few parts.
    assert CLEAR in differs and len(differs) > PARTS // 2
    with pytest.raises(ValueError, match="made over other pictures"):
        make(same, tmp_path / "1", **how)


def write(part: Path, answers: str) -> None:
    part.parent.mkdir(parents=True, exist_ok=True)
    part.write_text(answers)


def test_accuracy(benchmark: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    for part, right in {"clear": 4, "hard/snow/1": 3, "hard/snow/5": 1, "natural/fog/2": 2}.items():
        classes = [name[:3] if n < right else "cow" for n, name in enumerate(NAMES)]
        write(tmp_path / f"{part}.csv", table(classes))
    line = ["benchmark", str(benchmark), "--predictions", str(tmp_path)]
    assert main([*line, "--plot", str(tmp_path / "curves.png")]) == 0
    head, *lines = (row.split("\t") for row in capsys.readouterr().out.splitlines())
    assert head == ["accuracy", "clear", "1", "2", "3", "4", "5"] and len(lines) == 6
    found = {row[0]: row[1:] for row in lines}
    assert found["hard/snow"] == ["1.0000", "0.7500", "", "", "", "0.2500"]
    assert found["natural/fog"] == ["1.0000", "", "0.5000", "", "", ""]
    assert (tmp_path / "curves.png").stat().st_size > 10_000
    # Classes of a file: a and c are x.
    assert score(benchmark, tmp_path, truth="classes.csv").values["clear"] == 0.0
    called = score(benchmark, lambda picture: "x", task="accuracy", truth="classes.csv").values
    assert set(called.values()) == {0.5} and len(called) == PARTS + 1
    for text, why in {
        "cat/a.png,cat": "of cat/b.png (so with 2 more)",
        "a.png": "rows must",
    }.items():
        write(tmp_path / "clear.csv", text)
        assert main(line) == 2 and why in capsys.readouterr().err


def test_mean_average_precision(benchmark: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    # Of two cats one is found: precision 1 at 51 of the 101 recalls. The dog's box has 16.6 of 20
    # rows, an overlap of .83, which is enough at 7 of the 10 thresholds.
    boxes = {1: (2, 2, 10, 8, 0.9, 1), 3: (0, 0, 20, 16.6, 0.9, 2)}
    results = [
        {"image_id": number, "category_id": box[5], "score": box[4], "bbox": box[:4]}
        for number, box in boxes.items()
    ]
    want = pytest.approx((51 / 101 + 0.7) / 2)
    write(tmp_path / "hard" / "fog" / "4.json", json.dumps(results))
    write(tmp_path / "clear.json", "[]")
    found = score(benchmark, tmp_path)
    assert found.task == "mAP" and found.values == {"clear": 0.0, "hard/fog/4": want}
    turn = itertools.cycle([[boxes[1]], [], [boxes[3]], []])
    called = score(benchmark, lambda picture: next(turn), task="mAP").values
    assert all(value == want for value in called.values()) and len(called) == PARTS + 1
    monkeypatch.setitem(sys.modules, "pycocotools.coco", None)
    with pytest.raises(ImportError, match="pip install pycocotools"):
        score(benchmark, tmp_path)


def test_end_point_error(benchmark: Path, tmp_path: Path):
    still = np.zeros((24, 32, 2), np.float32)
    for part, flow in {"clear": still + MOTION, "natural/snow/3": still}.items():
        (tmp_path / part / "cat").mkdir(parents=True)
        np.save(tmp_path / part / "cat" / "a.npy", flow)
    # KITTI's: steps of 1/64 px around 2^15, and which are known.
    stored = np.full((24, 32, 3), 2**15, np.uint16) + np.array([128, 0, 0], np.uint16)
    (tmp_path / "hard" / "rain" / "2" / "cat").mkdir(parents=True)
    write_picture(tmp_path / "hard" / "rain" / "2" / "cat" / "a.png", stored)
    found = score(benchmark, tmp_path, truth="cat:flow")
    want = {"clear": 0.0, "natural/snow/3": 5.0, "hard/rain/2": pytest.approx(np.hypot(1, 4))}
    assert found.task == "EPE" and found.values == want
    shapes = []

    def predict(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        shapes.append((first.shape, bool((first != second).any())))
        return np.add(still, (3.0, 0.0))

    assert set(score(benchmark, predict, task="EPE", truth="cat:flow").values.values()) == {4.0}
    assert shapes == [((24, 32, 3), True)] * (PARTS + 1)
    np.save(tmp_path / "clear" / "cat" / "a.npy", still[1:])
    with pytest.raises(ValueError, match=r"a\.png: its flow must be finite and \(24, 32, 2\)"):
        score(benchmark, tmp_path, truth="cat:flow")


@pytest.mark.parametrize(("given", "named"), [
    ({"predictions": len}, "task must be"), ({"predictions": len, "task": "speed"}, "task must be"),
    ({"predictions": "none"}, "Has no predictions like hard/snow/3"),
    ({"predictions": len, "task": "EPE"}, "truth must be two texts"),
    ({"predictions": len, "task": "EPE", "truth": "cat:x"}, "leads from no picture"),
    ({"predictions": len, "task": "mAP", "truth": "no.json"}, "no.json"),
])  # fmt: skip
def test_mistakes_are_named(benchmark: Path, given: dict[str, Any], named: str):
    with pytest.raises((TypeError, ValueError, OSError), match=named):
        score(benchmark, **given)


def test_sets_that_are_none(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / NAME).write_text("{}")
    with pytest.raises(ValueError, match="no file of hashes of version 1"):
        make(folder, tmp_path / "out", like=tmp_path / NAME)
    with pytest.raises(ValueError, match="no file of hashes"):
        score(tmp_path, len, task="mAP")
    assert main(["benchmark", str(tmp_path)]) == 2 and "--of" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
