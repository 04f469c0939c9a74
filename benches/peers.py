"""Time our weather for data sets against that of the usual libraries, all in one run.

    python benches/peers.py             # makes .venv-peers, installs everyone and us, measures
    python benches/peers.py --here      # measures in the environment that runs it

One thread each; uint8 RGB, for kornia the float tensor that it wants, made beforehand; variants
interleaved; minimum and median of many runs. Ratios within one run are what counts. Whoever cannot
be installed or run is reported.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HOME = ROOT / ".venv-peers"
# imagecorruptions asks setuptools for pkg_resources, which newer ones do not have.
PEERS = ["albumentationsx", "imgaug", "imagecorruptions", "kornia", "setuptools<81"]
SIZES = (512, 1024)

Call = Callable[[], Any]


def main() -> None:
    parser = argparse.ArgumentParser(description="Weather of the usual libraries, and ours.")
    parser.add_argument("--here", action="store_true", help="measure in this environment")
    parser.add_argument("--runs", type=int, default=15)
    options = parser.parse_args()
    if options.here:
        measure(options.runs)
        return
    python = environment()
    threads = dict.fromkeys(
        ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "FLURRIES_NUM_THREADS"), "1"
    )
    command = [str(python), __file__, "--here", "--runs", str(options.runs)]
    sys.exit(subprocess.run(command, env={**os.environ, **threads}, check=False).returncode)


def environment() -> Path:
    """Make the environment once, each peer by itself, and put this checkout into it."""
    python = HOME / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(HOME)], check=True)
        for name in PEERS:
            done = subprocess.run([*pip, name], check=False)
            if done.returncode:
                print(f"{name} cannot be installed here", flush=True)
    subprocess.run([*pip, "--upgrade", str(ROOT)], check=True)
    return python


def measure(runs: int) -> None:
    warnings.simplefilter("ignore")
    one_thread()
    for size in SIZES:
        for kind, calls in classes(size).items():
            times = {name: [] for name in calls}
            # Each once to warm up; then in turns, so that a slow moment is everybody's.
            for turn in range(runs + 1):
                for name, call in calls.items():
                    start = time.perf_counter()
                    call()
                    if turn:
                        times[name].append(1e3 * (time.perf_counter() - start))
            report(f"{kind}, {size} x {size}", times)


def report(title: str, times: dict[str, list[float]]) -> None:
    ours = min(next(iter(times.values())))
    print(f"\n{title}".ljust(58) + "min ms   median   / ours")
    for name, values in sorted(times.items(), key=lambda item: min(item[1])):
        middle = sorted(values)[len(values) // 2]
        print(f"  {name:52} {min(values):8.2f} {middle:8.2f} {min(values) / ours:8.2f}", flush=True)


def one_thread() -> None:
    import flurries as fl

    fl.set_threads(1)
    for module, name in (("cv2", "setNumThreads"), ("torch", "set_num_threads")):
        try:
            getattr(__import__(module), name)(1)
        except ImportError:
            print(f"no {module} here")


def classes(size: int) -> dict[str, dict[str, Call]]:
    """Return the calls to be timed, ours first."""
    from skimage import data

    import flurries as fl
    from flurries.io import fit

    picture = fit(data.coffee(), (size, size))
    found: dict[str, dict[str, Call]] = {}
    for kind, ours in (("snow", "Snowfall"), ("rain", "Rainfall"), ("fog", "Fog")):
        found[kind] = {}
        for severity in (3, 5):
            transform = getattr(fl.augment, ours)(severity=severity)
            found[kind][f"flurries {ours}(severity={severity})"] = lambda t=transform: t(picture)
    for peer in (albumentations, imgaug, imagecorruptions, kornia):
        try:
            for kind, name, call in peer(picture):
                try:
                    call()
                except Exception as error:
                    if size == SIZES[0]:
                        print(f"fails: {name}: {type(error).__name__}: {error}")
                    continue
                found[kind][name] = call
        except Exception as error:
            if size == SIZES[0]:
                line = traceback.extract_tb(error.__traceback__)[-1]
                print(f"fails: {peer.__name__}: {type(error).__name__}: {error} ({line.name})")
    return found


def albumentations(picture: Any) -> list[tuple[str, str, Call]]:
    import albumentations as A

    made = {
        ("snow", 'RandomSnow(method="texture")'): A.RandomSnow(method="texture", p=1.0),
        ("snow", "RandomSnow() (no flakes: it whitens)"): A.RandomSnow(p=1.0),
        ("rain", "RandomRain()"): A.RandomRain(p=1.0),
        ("rain", 'RandomRain(rain_type="drizzle")'): A.RandomRain(rain_type="drizzle", p=1.0),
        ("rain", 'RandomRain(rain_type="heavy")'): A.RandomRain(rain_type="heavy", p=1.0),
        ("rain", 'RandomRain(rain_type="torrential")'): A.RandomRain(rain_type="torrential", p=1.0),
        ("fog", "RandomFog()"): A.RandomFog(p=1.0),
        ("fog", "AtmosphericFog()"): A.AtmosphericFog(p=1.0),
    }
    return [
        (kind, f"albumentationsX {name}", lambda t=transform: t(image=picture))
        for (kind, name), transform in made.items()
    ]


def imgaug(picture: Any) -> list[tuple[str, str, Call]]:
    import numpy as np

    if "sctypes" not in vars(np):
        # NumPy 2 took away what it is imported with; put back so that it can be timed at all.
        types = {
            "float": [np.float16, np.float32, np.float64],
            "int": [np.int8, np.int16, np.int32, np.int64],
            "uint": [np.uint8, np.uint16, np.uint32, np.uint64],
        }
        vars(np)["sctypes"] = types
        print("imgaug: runs with np.sctypes put back, which NumPy 2 does not have")
    import imgaug.augmenters as iaa

    made = {
        ("snow", "Snowflakes()"): iaa.Snowflakes(),
        ("rain", "Rain()"): iaa.Rain(),
        ("fog", "Fog()"): iaa.Fog(),
    }
    return [
        (kind, f"imgaug {name}", lambda t=transform: t(image=picture))
        for (kind, name), transform in made.items()
    ]


def imagecorruptions(picture: Any) -> list[tuple[str, str, Call]]:
    from imagecorruptions import corrupt

    return [
        (kind, f"imagecorruptions {kind}, severity 3",
         lambda k=kind: corrupt(picture, corruption_name=k, severity=3))
        for kind in ("snow", "fog")
    ]  # fmt: skip


def kornia(picture: Any) -> list[tuple[str, str, Call]]:
    import kornia.augmentation as K
    import torch

    batch = torch.from_numpy(picture).permute(2, 0, 1)[None].float() / 255.0
    made = {
        ("snow", "RandomSnow() (no flakes: it whitens)"): K.RandomSnow(p=1.0),
        ("rain", "RandomRain()"): K.RandomRain(p=1.0),
    }
    return [
        (kind, f"kornia {name}", lambda t=transform: t(batch))
        for (kind, name), transform in made.items()
    ]


if __name__ == "__main__":
    main()
