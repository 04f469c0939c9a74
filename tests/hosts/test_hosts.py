"""The transforms of other libraries: ``make test-hosts``, in an environment that has them."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import subprocess
import sys
from pathlib import Path

import albumentations as A
import numpy as np
import pytest
import torch
from kornia.augmentation import AugmentationSequential, RandomGaussianNoise
from PIL import Image
from snowed import PHOTOGRAPH, Snowed
from torch.utils.data import DataLoader
from torchvision import tv_tensors

import flurries as fl
from flurries.augment import albumentations as fla
from flurries.augment import kornia as flk
from flurries.augment import torchvision as flt

pytestmark = [
    pytest.mark.timeout(900),
    # More workers than cores are what is tested; a pipeline may have nothing that moves boxes; and
    # torch forks beside its own threads.
    pytest.mark.filterwarnings("ignore:This DataLoader will create"),
    pytest.mark.filterwarnings("ignore:Got processor for bboxes"),
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("with_*.py"))
KINDS = ("Snowfall", "Rainfall", "Fog")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path: Path, tmp_path: Path):
    done = subprocess.run(
        [sys.executable, str(path), str(tmp_path)], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    for picture in pictures:
        assert np.asarray(Image.open(picture)).std() > 10.0


def test_there_is_an_example_for_each():
    assert [path.stem for path in EXAMPLES] == ["with_albumentations", "with_kornia",
                                                "with_torchvision"]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_albumentations_is_seeded_by_its_pipeline(kind: str):
    def made(seed: int) -> list[np.ndarray]:
        pipeline = A.Compose([getattr(fla, kind)(severity=(2, 4), p=1.0)], seed=seed)
        return [pipeline(image=PHOTOGRAPH)["image"] for _ in range(3)]

    first, again, other = made(7), made(7), made(8)
    for one, two in zip(first, again, strict=True):
        assert np.array_equal(one, two)
    assert not np.array_equal(first[0], first[1])
    assert not np.array_equal(first[0], other[0])


@pytest.mark.parametrize("kind", KINDS)
def test_albumentations_replays(kind: str):
    pipeline = A.ReplayCompose([getattr(fla, kind)(severity=4, p=1.0)])
    seen = pipeline(image=PHOTOGRAPH)
    again = A.ReplayCompose.replay(seen["replay"], image=PHOTOGRAPH)
    assert np.array_equal(seen["image"], again["image"])


def test_albumentations_takes_a_depth():
    near = np.full(PHOTOGRAPH.shape[:2], 1.0)
    far = np.full(PHOTOGRAPH.shape[:2], 500.0)
    pipeline = A.Compose(
        [fla.Fog(visibility=100.0, patches=0.0, color=1.0, depth_key="depth", p=1.0)], seed=1
    )
    thin, thick = (pipeline(image=PHOTOGRAPH, depth=d)["image"].mean() for d in (near, far))
    assert thin < PHOTOGRAPH.mean() + 10.0 and thick > 250.0


def test_albumentations_leaves_labels_alone():
    boxes = [[10.0, 20.0, 60.0, 80.0]]
    mask = (PHOTOGRAPH[..., 0] > 100).astype(np.uint8)
    pipeline = A.Compose(
        [fla.Snowfall(p=1.0)], bbox_params=A.BboxParams("pascal_voc", label_fields=["labels"])
    )
    seen = pipeline(image=PHOTOGRAPH, mask=mask, bboxes=boxes, labels=[1])
    assert np.array_equal(seen["mask"], mask)
    assert np.allclose(seen["bboxes"], boxes)


@pytest.mark.parametrize("kind", KINDS)
def test_torchvision_keeps_types(kind: str):
    transform = getattr(flt, kind)(severity=3)
    planes = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous()
    before = planes.clone()
    for given in (
        planes, tv_tensors.Image(planes), planes.float() / 255.0, planes[None],
        tv_tensors.Video(planes[None].repeat(3, 1, 1, 1)), Image.fromarray(PHOTOGRAPH),
    ):  # fmt: skip
        seen = transform(given)
        assert type(seen) is type(given)
        if isinstance(given, torch.Tensor):
            assert seen.shape == given.shape and seen.dtype == given.dtype
            assert not torch.equal(seen, given)
    assert torch.equal(planes, before)
    mask = tv_tensors.Mask(torch.ones(planes.shape[-2:], dtype=torch.bool))
    _, kept = transform(tv_tensors.Image(planes), mask)
    assert kept is mask
    size = tuple(planes.shape[-2:])
    boxes = torch.tensor([[1.0, 2.0, 30.0, 40.0]])
    labels = [tv_tensors.BoundingBoxes(boxes, format="XYXY", canvas_size=size)]
    if hasattr(tv_tensors, "KeyPoints"):
        labels.append(tv_tensors.KeyPoints(boxes.reshape(2, 2), canvas_size=size))
    for label in labels:
        assert transform(tv_tensors.Image(planes), label)[1] is label


def test_torchvision_is_the_plain_weather():
    planes = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous()
    transform = flt.Snowfall(severity=3)
    torch.manual_seed(5)
    seen = transform(planes)
    torch.manual_seed(5)
    torch.rand(())
    index = int(torch.randint(0, 2**62, ()))
    want = fl.augment.Snowfall(severity=3)
    want = fl.augment.replay(want.record(index=index))(PHOTOGRAPH)
    assert np.array_equal(seen.permute(1, 2, 0).numpy(), want)


def test_torchvision_probability():
    planes = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous()
    never = flt.Snowfall(p=0.0)
    assert torch.equal(never(planes), planes)
    torch.manual_seed(0)
    half = flt.Snowfall(p=0.5, severity=5)
    changed = sum(not torch.equal(half(planes), planes) for _ in range(40))
    # Within four standard deviations of 20.
    assert 7 <= changed <= 33


@pytest.mark.parametrize("kind", KINDS)
def test_kornia_pictures_are_the_plain_weather(kind: str):
    batch = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).float()[None].repeat(3, 1, 1, 1) / 255.0
    transform = getattr(flk, kind)(severity=3, p=1.0)
    seen = transform(batch)
    indices = transform._params["index"].tolist()
    weather = getattr(fl.augment, kind)(severity=3)
    for number, index in enumerate(indices):
        want = weather(batch[number].permute(1, 2, 0).numpy(), index=index)
        assert np.array_equal(seen[number].permute(1, 2, 0).numpy(), want)
    assert len(set(indices)) == 3


def test_kornia_replays_its_parameters():
    batch = torch.rand(2, 3, 40, 50)
    pipeline = AugmentationSequential(flk.Rainfall(p=1.0), data_keys=["input"])
    seen = pipeline(batch)
    assert torch.equal(pipeline(batch, params=pipeline._params), seen)


@pytest.mark.parametrize("module", [fla, flt, flk], ids=["albumentations", "torchvision", "kornia"])
@pytest.mark.parametrize("kind", KINDS)
def test_transforms_pickle_small(module: object, kind: str):
    transform = getattr(module, kind)(severity=3)
    text = pickle.dumps(transform)
    # Beside what every transform of the library carries: hooks, generators of random numbers.
    bare = {fla: A.NoOp(), flt: torch.nn.Identity(), flk: RandomGaussianNoise()}[module]
    assert len(text) <= 4096 + len(pickle.dumps(bare)), len(text)
    again = pickle.loads(text)
    assert type(again) is type(transform)
    copy.deepcopy(transform)


@pytest.mark.parametrize("module", [fla, flt, flk], ids=["albumentations", "torchvision", "kornia"])
def test_a_seed_of_its_own_is_refused(module: object):
    with pytest.raises(TypeError, match="seed"):
        module.Snowfall(seed=3)  # type: ignore[attr-defined]


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_loaders_give_one_set_whatever_their_workers(method: str):
    context = multiprocessing.get_context(method)
    fl.augment.Snowfall()(PHOTOGRAPH)  # the parent has used its threads before it forks
    alone = torch.cat(list(DataLoader(Snowed(True), batch_size=3)))
    for workers in (1, 2, 4):
        loader = DataLoader(
            Snowed(True), batch_size=3, num_workers=workers, multiprocessing_context=context,
            timeout=300,
        )  # fmt: skip
        assert torch.equal(torch.cat(list(loader)), alone)
    assert len(torch.unique(alone, dim=0)) == 12


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_workers_do_not_repeat_each_other(method: str):
    loader = DataLoader(
        Snowed(False), batch_size=3, num_workers=3, timeout=300,
        multiprocessing_context=multiprocessing.get_context(method),
    )  # fmt: skip
    assert len(torch.unique(torch.cat(list(loader)), dim=0)) == 12


def test_torchvision_takes_a_depth():
    planes = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous()
    fog = flt.Fog(visibility=100.0, patches=0.0, color=1.0)
    means = []
    for metres in (1.0, 500.0):
        depth = flt.Depth(torch.full(PHOTOGRAPH.shape[:2], metres))
        seen, behind = fog(tv_tensors.Image(planes), depth)
        assert isinstance(behind, flt.Depth) and torch.equal(behind, depth)
        means.append(float(seen.float().mean()))
    assert means[0] < PHOTOGRAPH.mean() + 10.0 and means[1] > 250.0
    with pytest.raises(ValueError, match="one Depth"):
        fog(tv_tensors.Image(planes), depth, depth)


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "RGB", "RGBA"])
def test_torchvision_keeps_what_pillow_has(mode: str):
    picture = Image.fromarray(PHOTOGRAPH).convert(mode)
    if mode in ("LA", "RGBA"):
        picture.putalpha(77)
    seen = flt.Snowfall(severity=4)(picture)
    assert seen.mode == {"1": "L", "P": "RGB"}.get(mode, mode) and seen.size == picture.size
    if "A" in mode:
        assert seen.getchannel("A").getextrema() == (77, 77)


def test_what_is_empty_or_short_stays_so():
    transform = flt.Rainfall(severity=3)
    empty = torch.zeros(0, 3, 32, 32)
    assert transform(empty).shape == empty.shape
    assert flk.Rainfall(severity=3, p=1.0)(empty).shape == empty.shape
    half = torch.rand(3, 32, 32).to(torch.bfloat16).requires_grad_()
    seen = transform(half)
    assert seen.dtype == torch.bfloat16 and not seen.requires_grad


@pytest.mark.parametrize("module", [fla, flt, flk])
@pytest.mark.parametrize("kind", KINDS)
def test_names_that_nobody_knows_are_answered(module: object, kind: str):
    with pytest.raises(TypeError, match="did you mean severity"):
        getattr(module, kind)(severty=3)
    with pytest.raises(TypeError, match="seed belongs to the pipeline"):
        getattr(module, kind)(seed=3)
