"""Data sets of each layout, and planes of truth beside their pictures."""

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

# By layout: pictures and what each shares its weather with, and others, which are copied.
SETS: dict[str, tuple[dict[str, str], list[str]]] = {
    "kitti": (
        {"training/image_2/000001.png": "1", "training/image_3/000001.png": "1",
         "training/image_2/000002.png": "2", "training/image_2/000007_10.png": "flow",
         "training/image_2/000007_11.png": "flow",
         "2011/drive_1/image_02/data/0000000000.png": "drive",
         "2011/drive_1/image_02/data/0000000001.png": "drive",
         "2011/drive_1/image_03/data/0000000001.png": "drive"},
        ["training/label_2/000001.txt", "training/disp_occ_0/000001_10.png",
         "training/semantic/000001_10.png", "2011/drive_1/velodyne/0000000000.bin"],
    ),
    "cityscapes": (
        {"leftImg8bit/val/aachen/aachen_000000_000019_leftImg8bit.png": "a",
         "rightImg8bit/val/aachen/aachen_000000_000019_rightImg8bit.png": "a",
         "leftImg8bit_sequence/val/aachen/aachen_000000_000018_leftImg8bit.png": "a",
         "leftImg8bit/val/aachen/aachen_000001_000019_leftImg8bit.png": "b"},
        ["gtFine/val/aachen/aachen_000000_000019_gtFine_color.png",
         "gtFine/val/aachen/aachen_000000_000019_gtFine_polygons.json",
         "disparity/val/aachen/aachen_000000_000019_disparity.png"],
    ),
    "nuscenes": (
        {"samples/CAM_FRONT/n1__CAM_FRONT__1532402927612460.jpg": "front",
         "sweeps/CAM_FRONT/n1__CAM_FRONT__1532402927695000.jpg": "front",
         "samples/CAM_BACK/n1__CAM_BACK__1532402927612460.jpg": "back"},
        ["v1.0-mini/sample.json", "samples/LIDAR_TOP/n1.pcd.bin", "maps/basemap.png"],
    ),
    "coco": (
        {"train2017/000000000009.jpg": "9", "val2017/000000000010.jpg": "10"},
        ["annotations/instances_train2017.json", "annotations/panoptic_train2017/000000000009.png",
         "stuff_masks/000000000009.png"],
    ),
    "yolo": (
        {"train/images/a.jpg": "a", "train/images/b.jpg": "b"},
        ["data.yaml", "train/labels/a.txt", "train/labels/empty.txt", "cover.png"],
    ),
    "voc": (
        {"VOC2012/JPEGImages/2007_000027.jpg": "27", "VOC2012/JPEGImages/2007_000032.jpg": "32"},
        ["VOC2012/Annotations/2007_000027.xml", "VOC2012/SegmentationClass/2007_000032.png"],
    ),
    "plain": (
        {"walk/frame_0001.png": "walk", "walk/frame_0002.png": "walk", "left/7.png": "7",
         "right/7.png": "7", "photo1.jpg": "p1", "photo2.jpg": "p2"},
        ["masks/photo1.png", "depth/walk/frame_0001.png", "notes.csv"],
    ),
}  # fmt: skip


def make_set(folder: Path, kind: str) -> Path:
    pictures, others = SETS[kind]
    for name in (*pictures, *others):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix in (".png", ".jpg"):
            top = sum(name.encode()) % 200
            Image.fromarray(data.astronaut()[top : top + H, 100 : 100 + W]).save(path)
        else:
            path.write_bytes(b"" if path.stem == "empty" else name.encode())
    return folder


@pytest.mark.parametrize("kind", SETS)
def test_a_set_of_each_layout(kind: str, tmp_path: Path):
    source, out = make_set(tmp_path / "in", kind), tmp_path / "out"
    pictures, others = SETS[kind]
    plan = corrupt(source, out, severity=4, seed=2, workers=1, dry_run=True)
    assert plan.layout == kind and sum(plan.found.values()) == len(pictures) + len(others)
    assert not out.exists()
    made = corrupt(source, out, severity=4, seed=2, workers=1)
    base = out / "snow" / "4"
    assert {path.relative_to(base).as_posix() for path in made.written} == set(pictures)
    before, after = contents(source), contents(base)
    assert after.keys() == before.keys()
    # Labels are equal by their bytes, empty ones too; no picture is.
    assert all(after[name] == before[name] for name in others)
    assert all(after[name] != before[name] for name in pictures)
    # Pictures of one film or pair have one weather, and no others.
    said = lines(out)
    seeds: dict[str, set[int]] = {}
    for name, group in pictures.items():
        seeds.setdefault(group, set()).add(said[f"snow/4/{name}"]["record"]["weather_seed"])
    assert all(len(found) == 1 for found in seeds.values())
    assert len({*map(frozenset, seeds.values())}) == len(seeds)
    again = corrupt(source, out, severity=4, seed=2, workers=1)
    assert again.written == [] and len(again.kept) == len(pictures)


def test_films_and_pairs_are_those_of_the_transforms(tmp_path: Path):
    source, out = make_set(tmp_path / "in", "kitti"), tmp_path / "out"
    corrupt(source, out, severity=5, workers=1, truth=("alpha", "motion"))
    record = lines(out)["snow/5/training/image_2/000007_10.png"]["record"]
    names = [f"training/image_2/000007_{k}.png" for k in (10, 11)]
    frames = [read_picture(source / name).pixels for name in names]
    want = fl.augment.replay(record).clip(np.stack(frames), fps=10.0, time=1.0)
    for name, frame in zip(names, want, strict=True):
        assert np.array_equal(read_picture(out / "snow/5" / name).pixels, frame)
    pair = [f"training/image_{k}/000001.png" for k in (2, 3)]
    eyes = [read_picture(source / name).pixels for name in pair]
    record = lines(out)[f"snow/5/{pair[1]}"]["record"]
    both = fl.augment.replay(record).apply(tuple(eyes), motion=True, fps=10.0, distance=0.54)
    for name, seen in zip(pair, both, strict=True):
        assert np.array_equal(read_picture(out / "snow/5" / name).pixels, seen.image)
        alpha = Image.open(out / "snow/5-alpha" / name)
        assert np.abs(np.asarray(alpha) / 65535.0 - seen.alpha).max() < 1e-5
        layer = read_layers((out / "snow/5-motion" / name).with_suffix(".exr"))["motion"]
        assert np.array_equal(layer, seen.motion)


def test_a_set_s_depth_and_unit_are_used(tmp_path: Path):
    source = make_set(tmp_path / "in", "plain")
    far = np.linspace(2.0, 60.0, H * W).reshape(H, W)
    Image.fromarray((far * 100).astype(np.uint16)).save(source / "depth/walk/frame_0001.png")
    with pytest.raises(ValueError, match="depths"):
        corrupt(source, tmp_path / "out", depths=("walk",), workers=1)  # type: ignore[arg-type]
    how = {"depths": ("walk/", "depth/walk/"), "depth_unit": 0.01, "severity": 5, "weather": "fog"}
    made = corrupt(source, tmp_path / "out", include="walk/*", workers=1, **how)  # type: ignore[arg-type]
    # The second frame has no depth: that is said, and nothing is made up.
    assert list(made.failed) == ["walk/frame_0002.png"] and "depth" in made.failed.popitem()[1]
    entry = lines(tmp_path / "out")["fog/5/walk/frame_0001.png"]
    picture = read_picture(source / "walk/frame_0001.png").pixels
    fog = fl.augment.replay(entry["record"])
    want = fog(picture, depth=np.floor(far * 100) / 100, time=1 / 30)
    assert np.abs(read_picture(made.written[0]).pixels.astype(int) - want.astype(int)).max() <= 1


@pytest.mark.parametrize("orientation", range(1, 9))
def test_the_orientation_a_camera_noted_and_grey_stay(orientation: int, tmp_path: Path):
    tags = Image.Exif()
    tags[0x0112] = orientation
    (tmp_path / "in").mkdir()
    stored = Image.fromarray(data.camera()[100 : 100 + H, 180 : 180 + W])
    stored.save(tmp_path / "in" / "a.jpg", exif=tags, quality=98)
    corrupt(tmp_path / "in", tmp_path / "out", severity=1, weather="fog", workers=1)
    found = Image.open(tmp_path / "out/fog/1/a.jpg")
    assert found.size == stored.size and found.mode == "L"
    assert found.getexif().get(0x0112, 1) == orientation
    # The same scene lies where it lay: it is its own picture more than any turned one.
    before, after = (np.asarray(one, float) for one in (stored, found))
    assert np.corrcoef(before.ravel(), after.ravel())[0, 1] > 0.9
    seen = read_picture(tmp_path / "out/fog/1/a.jpg").pixels
    want = fl.augment.replay(lines(tmp_path / "out")["fog/1/a.jpg"]["record"])(
        read_picture(tmp_path / "in/a.jpg").pixels
    )
    # Weather comes from above as it is seen.
    assert np.abs(seen.astype(int) - want.astype(int)).mean() < 3.0


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
    stored = Stored(None, orientation, False, None)  # type: ignore[arg-type]
    rows, columns = np.mgrid[:H, :W]
    seen = stored.turned(np.stack([columns, rows], axis=-1))
    across, down = stored.turned(np.full((H, W, 2), (3, 2)), vectors=True)[0, 0]
    assert (seen[20 + down, 20 + across] - seen[20, 20] == (3, 2)).all()
