"""The transforms of other libraries: ``make test-hosts``, in an environment that has them."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

import albumentations as A
import numpy as np
import pytest
import torch
from kornia.augmentation import AugmentationSequential, RandomHorizontalFlip, VideoSequential
from PIL import Image
from snowed import PHOTOGRAPH, Snowed
from torch.utils.data import DataLoader
from torchvision import tv_tensors
from torchvision.transforms import v2

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


def test_kornia_weather_moves_in_clips_unless_it_is_the_same():
    torch.manual_seed(3)
    clips = torch.zeros(2, 3, 3, 48, 64)
    snow = flk.Snowfall(severity=5, p=1.0, fps=24.0)
    seen = VideoSequential(snow, data_format="BTCHW", same_on_frame=True)(clips)
    for clip, drawn in zip(seen, snow.records[::3], strict=True):
        frames = clips[0].permute(0, 2, 3, 1).numpy()
        wanted = fl.augment.replay(drawn).clip(frames, fps=24.0)
        assert np.array_equal(clip.permute(0, 2, 3, 1).numpy(), wanted)
        assert not np.array_equal(wanted[0], wanted[1])
    still = flk.Snowfall(severity=5, p=1.0, same=True)
    seen = VideoSequential(still, data_format="BTCHW", same_on_frame=True)(clips)
    assert (seen == seen[:, :1]).all() and not (seen[0] == seen[1]).all()


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


SHAPE = PHOTOGRAPH.shape[:2]
BOXES = [[10.0, 20.0, 60.0, 80.0]]


@pytest.mark.parametrize("kind", KINDS)
def test_albumentations_gives_alpha_and_record(kind: str):
    transform = getattr(fla, kind)(
        severity=4, depth_key="depth", alpha_key="alpha", record_key="records", p=1.0
    )
    pipeline = A.Compose(
        [transform, A.HorizontalFlip(p=1.0)], seed=3,
        additional_targets={"alpha": "mask", "depth": "mask"},
    )  # fmt: skip
    clear = np.zeros(SHAPE, np.float32)
    depth = np.tile(np.linspace(3.0, 40.0, SHAPE[1], dtype=np.float32), (SHAPE[0], 1))
    # AlbumentationsX takes additional masks beside a mask only.
    seen = pipeline(image=PHOTOGRAPH, mask=clear, alpha=clear, depth=depth, records=[])
    (record,) = seen["records"]
    want = fl.augment.replay(record).apply(PHOTOGRAPH, depth=depth, boxes=BOXES)
    assert np.array_equal(seen["image"], want.image[:, ::-1])
    assert np.allclose(seen["alpha"], want.alpha[:, ::-1], atol=1e-6)
    assert not seen["mask"].any()
    assert np.array_equal(seen["depth"], depth[:, ::-1])
    turned = [[SHAPE[1] - 60.0, 20.0, SHAPE[1] - 10.0, 80.0]]
    assert fl.augment.occlusion(seen["alpha"], turned) == pytest.approx(want.occlusion, abs=1e-5)
    # Two weathers add up as layers do; without the placeholders nothing is given.
    twice = A.Compose([transform, transform], additional_targets={"alpha": "mask"}, seed=3)
    seen = twice(image=PHOTOGRAPH, mask=clear, alpha=clear, depth=depth, records=[])
    alphas = [
        fl.augment.replay(r).apply(PHOTOGRAPH, depth=depth).alpha.astype(float)
        for r in seen["records"]
    ]
    assert np.allclose(seen["alpha"], 1.0 - (1.0 - alphas[0]) * (1.0 - alphas[1]), atol=1e-5)
    assert set(twice(image=PHOTOGRAPH, depth=depth)) == {"image", "depth"}


@pytest.mark.parametrize("kind", KINDS)
def test_torchvision_gives_alpha_and_records(kind: str):
    planes = tv_tensors.Image(torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous())
    depth = flt.Depth(torch.linspace(3.0, 40.0, SHAPE[1]).expand(SHAPE).clone())
    transform = getattr(flt, kind)(severity=4)
    pipeline = v2.Compose([transform, v2.RandomHorizontalFlip(p=1.0)])
    boxes = tv_tensors.BoundingBoxes(BOXES, format="XYXY", canvas_size=SHAPE)
    sample = {
        "image": planes, "depth": depth, "alpha": flt.Alpha.before(planes), "boxes": boxes,
        "records": flt.Records(),
    }  # fmt: skip
    seen = pipeline(sample)
    assert isinstance(seen["alpha"], flt.Alpha) and len(seen["records"]) == 1
    want = fl.augment.replay(seen["records"][0]).apply(PHOTOGRAPH, depth=depth.numpy(), boxes=BOXES)
    assert np.allclose(seen["alpha"].numpy(), want.alpha[:, ::-1], atol=1e-6)
    hidden = fl.augment.occlusion(seen["alpha"], seen["boxes"])
    assert hidden == pytest.approx(want.occlusion, abs=1e-5)
    assert not sample["records"] and not sample["alpha"].any()
    never = getattr(flt, kind)(p=0.0)(sample)
    assert not never["records"] and not never["alpha"].any()
    film = tv_tensors.Video(planes[None].repeat(3, 1, 1, 1))
    moving, alpha, records = transform(film, flt.Alpha.before(film), flt.Records())
    frames = np.stack([PHOTOGRAPH] * 3)
    want, layers = fl.augment.replay(records[0]).clip(frames, return_layer=True)
    assert np.array_equal(moving.permute(0, 2, 3, 1).numpy(), want)
    assert np.allclose(alpha.numpy(), layers[..., 3], atol=1e-6)
    picture = Image.fromarray(PHOTOGRAPH)
    assert transform(picture, flt.Alpha.before(picture))[1].any()


@pytest.mark.parametrize("kind", KINDS)
def test_kornia_has_depth_alpha_and_records(kind: str):
    colors = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).float()[None] / 255.0
    depth = torch.linspace(3.0, 40.0, SHAPE[1]).expand(1, 1, *SHAPE)
    batch = torch.cat([colors, depth, torch.zeros(1, 1, *SHAPE)], dim=1).repeat(2, 1, 1, 1)
    snow = getattr(flk, kind)(severity=4, depth_channel=3, alpha_channel=4, p=1.0)
    seen = AugmentationSequential(snow, RandomHorizontalFlip(p=1.0))(batch).flip(-1)
    assert torch.equal(seen[:, 3], batch[:, 3])
    for number, record in enumerate(snow.records):
        picture = colors[0].permute(1, 2, 0).numpy()
        want = fl.augment.replay(record).apply(picture, depth=depth[0, 0].numpy())
        assert np.allclose(seen[number, :3].permute(1, 2, 0).numpy(), want.image, atol=1e-6)
        assert np.allclose(seen[number, 4].numpy(), want.alpha, atol=1e-6)
    assert getattr(flk, kind)(p=0.5, severity=2)(colors.repeat(9, 1, 1, 1)).shape[0] == 9
    with pytest.raises(ValueError, match="channel 7"):
        getattr(flk, kind)(depth_channel=7, p=1.0)(batch)
    with pytest.raises(ValueError, match="alpha_channel"):
        getattr(flk, kind)(depth_channel=3, alpha_channel=3)


@pytest.mark.parametrize("module", [flt, flk], ids=["torchvision", "kornia"])
@pytest.mark.parametrize("kind", KINDS)
def test_gradients_are_what_shows(module: object, kind: str):
    given = torch.rand(1, 3, 40, 50, dtype=torch.float64).requires_grad_()
    torch.manual_seed(4)
    transform = getattr(module, kind)(severity=4, p=1.0)
    seen = transform(given)
    seen.sum().backward()
    torch.manual_seed(4)
    assert torch.equal(transform(given.detach()), seen.detach())
    torch.manual_seed(4)
    black = transform(torch.zeros_like(given))
    torch.manual_seed(4)
    shows = transform(torch.ones_like(given)) - black
    assert torch.allclose(given.grad, shows, atol=1e-6)
    # Weather of a tensor whose gradient nobody wants has none.
    with torch.no_grad():
        assert not transform(given).requires_grad


@pytest.mark.parametrize("module", [flt, flk], ids=["torchvision", "kornia"])
def test_what_is_no_picture_is_refused_in_a_sentence(module: object):
    transform = module.Snowfall(p=1.0)  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="1 or 3 channels"):
        transform(torch.rand(2, 4, 40, 50))
    if module is flt:
        with pytest.raises(TypeError, match="uint8, uint16 or float"):
            transform(torch.zeros(3, 40, 50, dtype=torch.int64))
