"""Does it transfer? A small network that removes snow, trained on one kind of it, tested on others.

    .venv-peers/bin/python docs/make_transfer.py --page docs/internals/transfer.md [--pairs FOLDER]

Runs where `make peers` has installed the libraries (and flurries); ten minutes of one core. FOLDER
has `clear` and `snow` with pictures of the same names. What is learned and measured says the page.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from skimage import data
from torch import nn

import flurries as fl

LEARNED = ("coffee", "chelsea", "rocket", "retina")
TESTED = ("astronaut", "immunohistochemistry")
SEEDS, STEPS, BATCH, CROP, SIZE = 3, 300, 8, 48, 256
# The all-flakes scenes and their times; crops of each kind that is tested.
RATES, CROPS = (2.5, 10.0), 64

Array = np.ndarray
Kind = Callable[[Array, np.random.Generator], Array]


def ours(
    clear: Array, random: np.random.Generator, profiles: tuple[Any, ...] = ("natural", "hard")
) -> Array:
    profile = profiles[int(random.integers(len(profiles)))]
    made = fl.augment.Snowfall(severity=(1, 5), profile=profile)
    return made(clear, index=int(random.integers(2**40)))


def albumentations(clear: Array, random: np.random.Generator) -> Array:
    import albumentations as A

    made = A.Compose([A.RandomSnow(method="texture", p=1.0)], seed=int(random.integers(2**31)))
    return np.asarray(made(image=clear)["image"])


def of_imgaug(clear: Array, random: np.random.Generator) -> Array:
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benches"))
    from peers import imgaug as peer

    next(peer([clear]))
    import imgaug

    imgaug.seed(int(random.integers(2**31)))
    return np.asarray(next(peer([clear]))[2][0]())


def dots(clear: Array, random: np.random.Generator) -> Array:
    """Return it with white discs: what one writes in five minutes."""
    y, x = np.mgrid[: clear.shape[0], : clear.shape[1]]
    seen = clear.copy()
    for across, down, radius in random.random((int(random.integers(40, 400)), 3)):
        near = np.hypot(x - across * clear.shape[1], y - down * clear.shape[0]) < 0.5 + 2 * radius
        seen[near] = 250
    return seen


def all_flakes(clear: Array, random: np.random.Generator) -> Array:
    """Return it under every flake of a population, drawn one by one."""
    snow = fl.Snow(rate=float(random.choice(RATES)), method="simulated")
    scene = fl.Scene(clear, effects=[snow], seed=int(random.integers(2**31)))
    return np.asarray(scene.render(0))


def by_hand(clear: Array, random: np.random.Generator) -> Array:
    """Return it in snow of another law: soft ovals, all as slanted, of two sizes, and a haze."""
    y, x = np.mgrid[: clear.shape[0], : clear.shape[1]]
    left = np.full(clear.shape[:2], 1.0 - 0.2 * random.random())
    turn = random.normal(0.0, 0.4)
    for size, count in ((0.8, 500), (2.5, 60)):
        for across, down, part in random.random((int(count * random.random()), 3)):
            u, v = x - across * clear.shape[1], y - down * clear.shape[0]
            u, v = u * np.cos(turn) + v * np.sin(turn), v * np.cos(turn) - u * np.sin(turn)
            left *= 1.0 - (0.4 + 0.5 * part) * np.exp(-((u / size) ** 2) - (v / size / 2) ** 2)
    return np.rint(clear * left[..., None] + 225.0 * (1.0 - left[..., None])).astype(np.uint8)


TRAINED: dict[str, Kind] = {
    "flurries": ours, "albumentationsX": albumentations, "imgaug": of_imgaug, "dots": dots,
}  # fmt: skip


def photographs(names: tuple[str, ...]) -> list[Array]:
    return [np.ascontiguousarray(fl.io.fit(getattr(data, n)(), (SIZE, SIZE))) for n in names]


def crops(pairs: list[tuple[Array, Array]], count: int, random: np.random.Generator) -> list[Array]:
    """Return places of pairs, (n, 3, CROP, CROP) from 0 to 1: clear ones, and in snow."""
    found = []
    for _ in range(count):
        pair = pairs[int(random.integers(len(pairs)))]
        top, left = (int(random.integers(n - CROP + 1)) for n in pair[0].shape[:2])
        found.append([p[top : top + CROP, left : left + CROP].transpose(2, 0, 1) for p in pair])
    return [np.stack(side).astype(np.float32) / 255.0 for side in zip(*found, strict=True)]


def network() -> nn.Module:
    layers: list[nn.Module] = [nn.Conv2d(3, 16, 3, padding=1)]
    for step in (1, 2, 4, 2, 1):
        layers += [nn.ReLU(), nn.Conv2d(16, 16, 3, padding=step, dilation=step)]
    last = nn.Conv2d(16, 3, 3, padding=1)
    # It begins as one that changes nothing.
    nn.init.zeros_(last.weight)
    return nn.Sequential(*layers, nn.ReLU(), last)


def trained(kind: Kind, seed: int) -> nn.Module:
    """Return a network that has learned what to add to a picture in snow."""
    random, plates = np.random.default_rng(seed), photographs(LEARNED)
    pairs = [(plate, kind(plate, random)) for plate in plates for _ in range(16)]
    torch.manual_seed(seed)
    net = network()
    optimizer = torch.optim.Adam(net.parameters(), 2e-3)
    slower = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    for _ in range(STEPS):
        clear, snow = (torch.from_numpy(side) for side in crops(pairs, BATCH, random))
        optimizer.zero_grad()
        misfit(clear, snow + net(snow)).backward()
        optimizer.step()
        slower.step()
    return net


def misfit(clear: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
    """Return the mean square error after the best gain and offset of each channel of each crop."""
    one, other = clear.flatten(2), seen.flatten(2)
    one, other = (side - side.mean(-1, keepdim=True) for side in (one, other))
    gain = (one * other).sum(-1, keepdim=True) / ((other**2).sum(-1, keepdim=True) + 1e-6)
    return ((one - gain * other) ** 2).mean()


def quality(clear: Array, seen: Array) -> float:
    """Return the PSNR of all crops by `misfit`, dB."""
    sides = (torch.from_numpy(side).double() for side in (clear, seen))
    return float(-10.0 * torch.log10(misfit(*sides)))


def main() -> None:
    parser = argparse.ArgumentParser(description="Does removal of snow transfer?")
    parser.add_argument("--pairs", type=Path, help="folder with clear/ and snow/")
    parser.add_argument("--page", type=Path, help="Markdown to write")
    options = parser.parse_args()
    torch.set_num_threads(1)
    fl.set_threads(1)
    random, tests = np.random.default_rng(99), {}
    for name, kind in {**TRAINED, "all flakes": all_flakes, "by hand": by_hand}.items():
        pairs = [(p, kind(p, random)) for p in photographs(TESTED) for _ in RATES]
        tests[name] = crops(pairs, CROPS, random)
    if options.pairs:
        names = sorted(path.name for path in (options.pairs / "clear").iterdir())
        read = [[fl.io.read_picture(options.pairs / side / name).pixels for side in
                 ("clear", "snow")] for name in names]  # fmt: skip
        tests["your pairs"] = crops([(one, two) for one, two in read], CROPS, random)
    rows = [["as it is", *(f"{quality(*test):.2f}" for test in tests.values())]]
    natural = {"flurries, natural": partial(ours, profiles=("natural",))}
    for name, kind in {**TRAINED, **natural}.items():
        gains = []
        for seed in range(SEEDS):
            net = trained(kind, seed)
            with torch.no_grad():
                seen = {key: snow + net(torch.from_numpy(snow)).numpy()
                        for key, (_, snow) in tests.items()}  # fmt: skip
            gains.append([quality(clear, seen[key]) - quality(clear, snow)
                          for key, (clear, snow) in tests.items()])  # fmt: skip
            print(name, seed, np.round(gains[-1], 2), flush=True)
        mean, spread = np.mean(gains, 0), np.std(gains, 0, ddof=1) / np.sqrt(SEEDS)
        rows.append([name, *(f"{m:+.2f} ± {s:.2f}" for m, s in zip(mean, spread, strict=True))])
    table = [["trained on", *tests], ["---"] * (len(tests) + 1), *rows]
    text = "\n".join(f"| {' | '.join(row)} |" for row in table)
    print(text)
    if options.page:
        head, _, tail = options.page.read_text("utf-8").partition("| trained on")
        rest = tail.partition("\n\n")[2]
        options.page.write_text(f"{head}{text}\n\n{rest}", "utf-8")


if __name__ == "__main__":
    main()
