"""What a set in weather says of itself: planes and numbers of truth, shards, a table."""

import json
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from skimage import data

import flurries as fl
from flurries.augment.corrupt import corrupt
from flurries.augment.sets import TRUTH, Stored
from flurries.io import read_layers, read_picture
from flurries.io.annotations import read_label
from test_augment_corrupt import contents, lines

H, W = 40, 64
BOXES = [[8.0, 4.0, 40.0, 20.0], [16.0, 10.0, 32.0, 30.0]]
MASK = np.zeros((H, W), np.uint8)
MASK[4:20, 8:40], MASK[22:30, 16:32] = 1, 7


def written(path: Path, content: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content)


def picture_at(path: Path, top: int = 0) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(data.astronaut()[top : top + H, 100 : 100 + W]).save(path)


def yolo(folder: Path) -> str:
    rows = [(1, (a + c) / 2 / W, (b + d) / 2 / H, (c - a) / W, (d - b) / H) for a, b, c, d in BOXES]
    # The second one as a polygon.
    a, b, c, d = (side / size for side, size in zip(BOXES[1], (W, H, W, H), strict=True))
    rows[1] = (2, a, b, c, b, c, d, a, d)  # type: ignore[assignment]
    written(folder / "labels/a.txt", "\n".join(" ".join(map(str, row)) for row in rows))
    return "images/a.jpg"


def voc(folder: Path) -> str:
    each = "".join(
        f"<object><bndbox><xmin>{a + 1}</xmin><ymin>{b + 1}</ymin><xmax>{c}</xmax><ymax>{d}</ymax>"
        "</bndbox></object>" for a, b, c, d in BOXES
    )  # fmt: skip
    written(folder / "VOC/Annotations/a.xml", f"<annotation>{each}</annotation>")
    palette = Image.fromarray(np.where(MASK, MASK, 255).astype(np.uint8), "P")
    palette.putpalette(range(256))
    (folder / "VOC/SegmentationObject").mkdir()
    palette.save(folder / "VOC/SegmentationObject/a.png")
    return "VOC/JPEGImages/a.jpg"


def kitti(folder: Path) -> str:
    rows = [f"Car 0.00 0 -1.58 {' '.join(map(str, box))} 1 1 1 1 1 1 0" for box in BOXES]
    written(folder / "training/label_2/a.txt", "\n".join(rows))
    return "training/image_2/a.png"


def coco(folder: Path) -> str:
    table = {
        "images": [{"id": 5, "file_name": "a.jpg"}],
        "annotations": [{"image_id": 5, "bbox": [a, b, c - a, d - b]} for a, b, c, d in BOXES],
    }
    written(folder / "annotations/instances_val2017.json", json.dumps(table))
    picture_at(folder / "train2017/a.jpg", 99)
    return "val2017/a.jpg"


def cityscapes(folder: Path) -> str:
    (folder / "gtFine/val").mkdir(parents=True)
    Image.fromarray(MASK.astype(np.uint16)).save(folder / "gtFine/val/a_gtFine_instanceIds.png")
    return "leftImg8bit/val/a_leftImg8bit.png"


@pytest.mark.parametrize("make", [yolo, voc, kitti, coco, cityscapes])
def test_numbers_of_boxes_and_instances_are_those_of_the_transforms(make: Any, tmp_path: Path):
    """Labels are read as each layout has them; a picture without any has none."""
    source, out = tmp_path / "in", tmp_path / "out"
    name = make(source)
    picture_at(source / name)
    other = Path(name).with_stem(Path(name).stem.replace("a", "b", 1))
    picture_at(source / other, 50)
    how: dict[str, Any] = {"severity": 5, "profile": "hard", "workers": 1}
    wanted = [] if make is cityscapes else ["occlusion"]
    wanted += ["instances"] if make in (voc, cityscapes) else []
    made = corrupt(source, out, truth=wanted, **how)
    assert made.failed == {}
    record = lines(out)[f"snow/5/{name}"]["record"]
    seen = fl.augment.replay(record).apply(
        read_picture(source / name).pixels, boxes=BOXES, masks=MASK
    )
    rows = [json.loads(line) for line in (out / "metadata.jsonl").read_text().splitlines()]
    for plane in wanted:
        for each, empty in ((name, False), (other.as_posix(), True)):
            told = json.loads((out / f"snow/5-{plane}" / each).with_suffix(".json").read_bytes())
            assert told in [row[plane] for row in rows if row["source"] == each]
            for field in TRUTH[plane][1:]:
                want = np.empty(0) if empty else getattr(seen, field)
                assert np.allclose(told[field], want, atol=1e-9), (plane, field)


def test_planes_are_those_of_the_transforms_and_shards_hold_them(tmp_path: Path):
    source, out = tmp_path / "in", tmp_path / "out"
    flow = np.random.default_rng(1).normal(0.0, 4.0, (H, W, 2)).astype("<f4")
    for number in range(3):
        picture_at(source / f"rgb/{number}.b.png", 9 * number)
        (source / "flow").mkdir(exist_ok=True)
        head = np.array([202021.25], "<f4").tobytes() + np.array([W, H], "<i4").tobytes()
        (source / f"flow/{number}.b.flo").write_bytes(head + flow.tobytes())
    planes = ("clean", "weather", "alpha", "layers", "motion", "flow")
    how: dict[str, Any] = {
        "severity": 5, "profile": "hard", "truth": planes, "labels": {"flow": ("rgb", "flow")},
        "shards": 2, "workers": 1,
    }  # fmt: skip
    made = corrupt(source, out, **how)
    assert made.failed == {} and len(made.written) == 3 * 7 + 2
    name = "rgb/1.b.png"
    picture = read_picture(source / name).pixels
    record = lines(out)[f"snow/5/{name}"]["record"]
    seen = fl.augment.replay(record).apply(picture, flow=flow, motion=True)
    assert (out / f"snow/5-clean/{name}").read_bytes() == (source / name).read_bytes()
    weather = read_picture(out / f"snow/5-weather/{name}")
    assert weather.alpha is not None
    color = weather.pixels / 65535.0 * weather.alpha[..., None]
    assert np.abs(color - seen.layer[..., :3]).max() < 5e-5
    for plane, field in (("layers", "falling"), ("motion", "motion"), ("flow", "flow")):
        found = read_layers((out / f"snow/5-{plane}" / name).with_suffix(".exr"))
        assert np.array_equal(found[field], getattr(seen, field))
    # Each sample of webdataset is what has one name up to its first dot.
    with tarfile.open(out / "snow/5-shards/000000.tar") as shard:
        held = {one.name: shard.extractfile(one).read() for one in shard}  # type: ignore[union-attr]
    kinds = {"png", "json", "clean.png", "weather.png", "alpha.png", "layers.exr", "motion.exr",
             "flow.exr", "flow.flo"}  # fmt: skip
    assert {key.partition(".")[0] for key in held} == {"rgb/0_b", "rgb/1_b"}
    assert {key.partition(".")[2] for key in held} == kinds
    assert held["rgb/1_b.png"] == (out / f"snow/5/{name}").read_bytes()
    assert json.loads(held["rgb/1_b.json"])["record"] == record
    before = contents(out)
    (out / "snow/5-shards/000001.tar").unlink()
    again = corrupt(source, out, **how)
    assert [path.name for path in again.written] == ["000001.tar"] and contents(out) == before
    picture_at(source / "rgb/1.b.jpg")
    with pytest.raises(ValueError, match="share one"):
        corrupt(source, out, **how)
    with pytest.raises(ValueError, match="truth needs boxes"):
        corrupt(source, tmp_path / "none", truth="occlusion", workers=1)


def test_motion_of_kitti_is_read(tmp_path: Path):
    levels = np.random.default_rng(2).integers(1, 65536, (H, W, 3)).astype(np.uint16)
    levels[3, 5, 2] = 0
    fl.io.write_picture(tmp_path / "a.png", levels)
    found = read_label("flow", tmp_path / "a.png", (H, W))
    want = (levels[..., :2] - 32768.0) / 64.0
    assert np.isnan(found[3, 5]).all() and np.nanmax(np.abs(found - want)) == 0.0
    for name, broken in (("a.flo", b"none of it at all"), ("a.npy", b"")):
        (tmp_path / name).write_bytes(broken)
        with pytest.raises(ValueError, match=f"{name}: holds no flow"):
            read_label("flow", tmp_path / name, (H, W))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_vectors_are_turned_with_their_picture(orientation: int):
    """A step along the vector as stored goes as far, as seen, as the vector said."""
    stored = Stored(None, orientation, False, None, None)  # type: ignore[arg-type]
    rows, columns = np.mgrid[:H, :W]
    seen = stored.turned(np.stack([columns, rows], axis=-1))
    across, down = stored.turned(np.full((H, W, 2), (3, 2)), vectors=True)[0, 0]
    assert (seen[20 + down, 20 + across] - seen[20, 20] == (3, 2)).all()
