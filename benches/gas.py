"""Gas: ratios to what people write instead, and the scenes that Johnson 2005 timed.

    python benches/gas.py [--runs N] [--scenes] [--inside]

Variants take turns in one run; read the ratios. `cargo bench --bench gas` has the plain compiled
loop over the table.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np

import flurries as fl

SIZE, FOCAL = 1024, 1000.0
SHAPE = (SIZE, SIZE)

# Section 4.1: frames per second on average, and where the most overlap; 1.9 GHz and a GeForce 4.
PAPER = {(1000, 0.4): (50, 15), (2000, 0.4): (14, 10), (2000, 0.32): (20, 11)}


def cloud(count: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return middles, radii and extents in pixels of 50 to 300, at depths from low to high."""
    rng = np.random.default_rng(3)
    extent = rng.uniform(50, 300, count)
    depth = rng.uniform(low, high, count)
    place = (rng.uniform(0, SIZE, (count, 2)) - SIZE / 2) * depth[:, None] / FOCAL
    return np.column_stack([place, depth]), extent / 2 * depth / FOCAL, extent


def slices(centers: np.ndarray, extent: np.ndarray, density: float, color: np.ndarray) -> object:
    """Blend each particle into its slice of an RGB picture, as a reader of the paper would."""
    picture = np.zeros((SIZE, SIZE, 3), np.float32)
    order = np.argsort(-centers[:, 2])
    for i in order:
        x, y = FOCAL * centers[i, :2] / centers[i, 2] + SIZE / 2
        r = extent[i] / 2
        left, right = max(0, int(x - r)), min(SIZE, int(x + r) + 1)
        top, bottom = max(0, int(y - r)), min(SIZE, int(y + r) + 1)
        rows, columns = np.mgrid[top:bottom, left:right] + 0.5
        q2 = ((columns - x) ** 2 + (rows - y) ** 2) * (3 / r) ** 2
        alpha = (density * np.exp(-0.5 * q2))[..., None].astype(np.float32)
        part = picture[top:bottom, left:right]
        part *= 1 - alpha
        part += alpha * color[i]
    return picture


def timed(calls: dict[str, Callable[[], object]], runs: int, rare: tuple[str, ...] = ()) -> dict:
    """Return the least and the median milliseconds of each, taking turns."""
    times: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(runs + 1):
        for name, call in calls.items():
            if name in rare and turn > 2:
                continue
            start = time.perf_counter()
            call()
            if turn:
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: (min(values), statistics.median(values)) for name, values in times.items()}


def kernels(runs: int) -> None:
    """Print all rows."""
    for count in (1000, 2000):
        one_eye(count, runs)


def one_eye(count: int, runs: int) -> None:
    """Print every way to draw against NumPy's slices."""
    camera = fl.Camera(FOCAL)
    centers, radius, extent = cloud(count, 2, 10)
    colors = np.random.default_rng(4).random((count, 3)).astype(np.float32)
    grey = np.full((count, 3), 0.7, np.float32)
    plane = np.empty(SHAPE, np.float32)
    layer = np.empty((*SHAPE, 4), np.float32)

    def alpha(threads: int, footprint: str = "viewplane_c") -> object:
        fl.set_threads(threads)
        gas = (SHAPE, centers, radius, 0.02, camera)
        return fl.gas.alpha(*gas, footprint=footprint, out=plane)

    def splat(threads: int, color: object) -> object:
        fl.set_threads(threads)
        return fl.gas.splat(SHAPE, centers, radius, 0.02, color, camera, out=layer)

    calls: dict[str, Callable[[], object]] = {
        "NumPy slices, RGB": lambda: slices(centers, extent, 0.02, grey),
        "alpha": lambda: alpha(1),
        "RGBA, one color": lambda: splat(1, 0.7),
        "RGBA, a color each": lambda: splat(1, colors),
        "alpha, viewpoint": lambda: alpha(1, "viewpoint"),
        "alpha, volume": lambda: alpha(1, "volume"),
        "alpha, 2 threads": lambda: alpha(2),
        "RGBA, a color each, 2 threads": lambda: splat(2, colors),
    }
    found = timed(calls, runs, ("NumPy slices, RGB",))
    base = found["NumPy slices, RGB"][0]
    print(f"{count} particles of 50-300 px, {SIZE} x {SIZE}, float32")
    for name, (least, middle) in found.items():
        print(f"  {name:34}{least:9.2f} ms {middle:9.2f} ms median {base / least:8.0f} x")
    for one in ("alpha", "RGBA, a color each"):
        print(f"  two threads, {one}: {found[one][0] / found[one + ', 2 threads'][0]:.2f} x")


def scenes() -> None:
    """Print frames per second of the paper's scenes: anaglyph, the viewer moves through the box."""
    fl.set_threads(2)
    shape, focal = (768, 1024), 900.0
    middle = fl.Camera(focal)
    both = fl.stereo.eyes(middle, distance=0.065, convergence=4.0)
    print(f"anaglyph of {shape[1]} x {shape[0]}, the viewer goes 9 units through a box of 5")
    print("                       frames/s  slowest   paper: mean  slowest    a plain loop")
    for (count, radius), (mean, slow) in PAPER.items():
        centers = np.random.default_rng(1).uniform(-2.5, 2.5, (count, 3))
        layers = [np.empty((*shape, 4), np.float32) for _ in both]
        times = []
        for step in range(60):
            start = time.perf_counter()
            moved = centers + np.array((0.0, 0.0, 5.5 - 0.15 * step))
            for layer, eye in zip(layers, both, strict=True):
                # As the paper draws: billboards parallel to the viewplane, culled.
                fl.gas.splat(shape, moved, radius, 0.4, 0.7, eye, footprint="viewplane",
                             near_mode="cull", out=layer)  # fmt: skip
            fl.stereo.anaglyph(*(layer[..., :3] for layer in layers))
            times.append(time.perf_counter() - start)
        start = time.perf_counter()
        _plain(shape, centers + np.array((0.0, 0.0, 4.0)), radius, both)
        plain = time.perf_counter() - start
        ours = f"{len(times) / sum(times):9.1f} {1 / max(times):8.1f}"
        print(f"  {count} particles r {radius:4} {ours} {mean:11d} {slow:8d} {1 / plain:12.3f}")


def inside(runs: int) -> None:
    """Print what the eye inside the gas costs, on every pixel and on the lattice, and both eyes."""
    shape, camera = (480, 640), fl.Camera(560.0)
    both = fl.stereo.eyes(camera, distance=0.065, convergence=4.0)
    layers = [np.empty((*shape, 4), np.float32) for _ in both]

    def draw(centers: np.ndarray, radius: float, eye: int, smooth: float | None) -> np.ndarray:
        return fl.gas.splat(
            shape, centers, radius, 0.4, 0.7, both[eye], near_mode="exact", smooth=smooth,
            out=layers[eye],
        )  # fmt: skip

    def anaglyph(centers: np.ndarray, radius: float, smooth: float | None) -> None:
        pair = [draw(centers, radius, eye, smooth)[..., :3] for eye in (0, 1)]
        fl.stereo.anaglyph(*pair)

    print("the eye in the middle of a box of 5, 640 x 480: both eyes and the anaglyph, frames/s")
    for (count, radius), (mean, _) in PAPER.items():
        centers = np.random.default_rng(1).uniform(-2.5, 2.5, (count, 3))
        exact = draw(centers, radius, 0, None).copy()
        off = np.abs(draw(centers, radius, 0, 24.0) - exact).max()
        row = []
        for threads in (1, 2):
            fl.set_threads(threads)
            found = timed(
                {
                    "exact": lambda c=centers, r=radius: anaglyph(c, r, None),
                    "smooth": lambda c=centers, r=radius: anaglyph(c, r, 24.0),
                },
                runs,
            )
            row += [1e3 / found[name][0] for name in ("exact", "smooth")]
        print(
            f"  {count} particles r {radius}: all pixels {row[0]:.0f}, {row[2]:.0f} on two threads;"
            f" lattice {row[1]:.0f}, {row[3]:.0f} (largest error {off:.5f}); the paper {mean}"
        )
    fl.set_threads(1)
    plate = np.full((768, 1024, 3), 128, np.uint8)
    ramp = np.repeat(np.linspace(3.0, 60.0, 768)[:, None], 1024, axis=1)
    fog = fl.Mist.preset("fog", visibility=20.0, wind=(1.0, 0.0, 0.0))
    bank = fl.Mist.preset("bank", visibility=20.0, wind=(1.0, 0.0, 0.0))
    flat = fl.Scene(None, plate, effects=[fog])
    deep = fl.Scene(None, plate, effects=[fog], depth=ramp)
    stirred = fl.Scene(None, plate, effects=[bank])
    time_of = iter(range(10**6))
    found = timed(
        {
            "one eye": lambda: flat.render(next(time_of)),
            "both": lambda: flat.stereo(next(time_of), distance=0.065, convergence=4.0),
            "depth": lambda: deep.render(next(time_of)),
            "structure": lambda: stirred.render(next(time_of)),
        },
        runs,
    )
    one = found["one eye"][0]
    print(f"moving fog, 1024 x 768, 20 m, one thread: {one:.1f} ms;", end=" ")
    print(", ".join(f"{name} {found[name][0] / one:.2f}" for name in found if name != "one eye"))


def _plain(shape: tuple[int, int], centers: np.ndarray, radius: float, eyes: object) -> None:
    """Splat both eyes by slices of Eq. 2's table, particle by particle."""
    table = fl.gas.footprint_table(65)
    height, width = shape
    for eye in eyes:  # type: ignore[attr-defined]
        picture = np.zeros((*shape, 3), np.float32)
        places = centers - np.array(eye.offset)
        cx, cy = eye.principal(shape)
        for x, y, z in places[np.argsort(-places[:, 2])]:
            if z < 0.1:
                continue
            extent = max(1, round(2 * eye.focal * radius / z))
            left = round(cx + eye.focal * x / z - extent / 2)
            top = round(cy + eye.focal * y / z - extent / 2)
            rows = np.arange(max(top, 0), min(top + extent, height))
            columns = np.arange(max(left, 0), min(left + extent, width))
            if not len(rows) or not len(columns):
                continue
            i = (rows - top) * 64 // max(extent - 1, 1)
            j = (columns - left) * 64 // max(extent - 1, 1)
            alpha = (0.4 * table[np.ix_(i, j)])[..., None].astype(np.float32)
            part = picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            part *= 1 - alpha
            part += alpha * np.float32(0.7)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--scenes", action="store_true", help="only the paper's scenes")
    parser.add_argument("--inside", action="store_true", help="only the eye inside the gas")
    options = parser.parse_args()
    if options.inside:
        inside(options.runs)
        return
    if not options.scenes:
        kernels(options.runs)
    scenes()
    inside(options.runs)


if __name__ == "__main__":
    main()
