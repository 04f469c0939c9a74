"""The gas' accuracy against its cost, the paper's figures of errors, and the pictures of gas.md.

    python docs/gas_studies.py [ladder] [errors] [flight] [pictures]

`ladder` and `errors` need matplotlib (the extra "plots").
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np
from skimage import data

import flurries as fl
from flurries import io, stereo

IMAGES = Path(__file__).parent / "images"
MODELS = ("table", "viewplane", "viewplane_c", "viewpoint", "volume")


def save(name: str, picture: np.ndarray, width: int) -> None:
    """Write a picture as a JPEG of that width."""
    height = round(width * picture.shape[0] / picture.shape[1])
    IMAGES.mkdir(exist_ok=True)
    if picture.dtype != np.uint8:
        picture = io.color.to_integer(io.linear_to_srgb(np.clip(picture, 0, 1)), 8)
    io.write_picture(IMAGES / name, io.fit(picture, (width, height)), quality=85)


def ladder() -> None:
    """Print time and error of every model on the fog, outside and inside; draw them."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    fl.set_threads(1)
    views = {"outside, 59 degrees": (424.0, 4.5), "inside, 98 degrees": (209.0, 0.0)}
    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.6), sharey=True)
    print("fog, 1200 particles, 480 x 360, float32, one thread; errors of alpha against volume")
    for axis, (view, (focal, ahead)) in zip(axes, views.items(), strict=True):
        centers = np.random.default_rng(7).uniform(-2.5, 2.5, (1200, 3))
        centers[:, 2] += ahead
        camera = fl.Camera(focal)
        exact = fl.gas.alpha((360, 480), centers, 0.45, 0.4, camera, footprint="volume",
                             dtype=np.float64)  # fmt: skip
        least = dict.fromkeys(MODELS, np.inf)
        errors = {}
        for _ in range(7):
            for model in MODELS:
                start = time.perf_counter()
                alpha = fl.gas.alpha((360, 480), centers, 0.45, 0.4, camera, footprint=model)
                least[model] = min(least[model], time.perf_counter() - start)
                errors[model] = np.abs(alpha - exact)
        print(f"\n{view}")
        print("| model | ms | / volume | mean error | largest error |")
        print("| --- | --- | --- | --- | --- |")
        for model in MODELS:
            part = least[model] / least["volume"]
            print(f"| {model} | {1e3 * least[model]:.2f} | {part:.2f} | "
                  f"{errors[model].mean():.2g} | {errors[model].max():.2g} |")  # fmt: skip
            axis.loglog(part, errors[model].mean(), "o", color="C0")
            axis.loglog(part, errors[model].max(), "^", color="C1", mfc="none")
            axis.annotate(model, (part, errors[model].mean()), xytext=(5, 4),
                          textcoords="offset points", fontsize=8)  # fmt: skip
        axis.set_title(view, fontsize=10)
        axis.set(xlabel="time over volume's", xlim=(0.04, 2.5))
        axis.set_xticks([0.1, 0.2, 0.5, 1.0, 2.0], ["0.1", "0.2", "0.5", "1", "2"])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("error of alpha: mean (dot), largest")
    figure.tight_layout()
    figure.savefig(IMAGES / "gas_ladder.png", dpi=90)


def errors() -> None:
    """Draw Figures 4, 5 and 8 to 13 of the paper, exact beside printed; 6 and 7 as two lines."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    near, r, apart = 1.0, 0.45, 0.065
    x = np.linspace(-5, 5, 201)

    def over(y: np.ndarray, depth: np.ndarray) -> np.ndarray:
        return np.stack(np.broadcast_arrays(x[None, :], y, depth), -1).reshape(-1, 3)

    along = np.linspace(1.0, 8.0, 141)[:, None]
    across = np.linspace(-5, 5, 141)[:, None]
    planes = {"z": (along, over(np.array([[1.0]]), along)),
              "y": (across, over(across, np.array([[2.0]])))}  # fmt: skip
    kinds = [("e_x", 0), ("e_y", 1), ("p_x", 0), ("p_y", 1)]
    numbers = iter((4, 5, 8, 9, 10, 11, 12, 13))
    rows = [(*kind, plane, next(numbers)) for kind in kinds for plane in "zy"]
    figure, axes = pyplot.subplots(len(rows), 2, figsize=(7.5, 17), layout="constrained")
    for row, (name, component, plane, number) in enumerate(rows):
        side, places = planes[plane]
        for column, form in enumerate(("exact", "printed")):
            if name.startswith("e"):
                values = fl.gas.projection_error(places, r, near=near, form=form)
            else:
                values = fl.gas.parallax_error(places, r, near=near, form=form, eye_distance=apart)
            field = values[:, component].reshape(len(side), len(x))
            limit = np.nanpercentile(np.abs(field), 99)
            axis = axes[row, column]
            drawn = axis.pcolormesh(x, side[:, 0], field, cmap="RdBu_r", vmin=-limit, vmax=limit,
                                    rasterized=True)  # fmt: skip
            axis.contour(x, side[:, 0], field, levels=[0.0], colors="k", linewidths=0.7)
            figure.colorbar(drawn, ax=axis)
            axis.set_title(f"Figure {number}: {name}, {form}", fontsize=9)
            axis.set_ylabel("depth" if plane == "z" else "$C_y$", fontsize=8)
    for axis in axes[-1]:
        axis.set_xlabel("$C_x$", fontsize=8)
    figure.savefig(IMAGES / "gas_errors.jpg", dpi=75, pil_kwargs={"quality": 80})

    figure, axis = pyplot.subplots(figsize=(5.5, 3.2), layout="constrained")
    for depth, number in ((6.0, 6), (1.5, 7)):
        places = np.stack([x, np.zeros_like(x), np.full_like(x, depth)], 1)
        for form, style in (("exact", "-"), ("printed", ":")):
            values = fl.gas.projection_error(places, r, near=near, form=form)[:, 0]
            axis.plot(x, values, style, color=f"C{number - 6}",
                      label=f"Figure {number}: depth {depth}, {form}")  # fmt: skip
    axis.set(xlabel="$C_x$", ylabel="$e_x$")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7)
    figure.savefig(IMAGES / "gas_errors_depth.png", dpi=90)
    print("largest of |e_x|, |e_y|, |p_x|, |p_y| on the planes above: exact, printed")
    for name, component, plane, number in rows:
        found = []
        for form in ("exact", "printed"):
            function = fl.gas.projection_error if name[0] == "e" else fl.gas.parallax_error
            more = {} if name[0] == "e" else {"eye_distance": apart}
            values = function(planes[plane][1], r, near=near, form=form, **more)
            found.append(np.nanmax(np.abs(values[:, component])))
        print(f"  Figure {number:2} {name}: {found[0]:9.4f} {found[1]:9.4f}")


def motorcycle() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Return both eyes' photographs, their depths in metres without holes, and f."""
    from scipy.ndimage import distance_transform_edt

    left, right, disparity = data.stereo_motorcycle()
    focal, baseline, dx = 994.978, 0.193001, 31.086
    depth = focal * baseline / (disparity + dx)
    holes = ~np.isfinite(disparity)
    # What is not known is as far as the nearest that is.
    _, nearest = distance_transform_edt(holes, return_indices=True)
    depth = depth[tuple(nearest)].astype(np.float32)
    # The right eye's: each pixel of the left one moved by its disparity, the nearest on top.
    other = np.full(depth.shape, np.nan, np.float32)
    rows, columns = np.indices(depth.shape)
    moved = np.rint(columns - (focal * baseline / depth - dx)).astype(int)
    order = np.argsort(-depth, axis=None)
    row, column, value = rows.ravel()[order], moved.ravel()[order], depth.ravel()[order]
    seen = (column >= 0) & (column < depth.shape[1])
    other[row[seen], column[seen]] = value[seen]
    # What no pixel went to is what lies behind, on its right.
    _, nearest = distance_transform_edt(np.isnan(other), return_indices=True)
    return left, right, depth, other[tuple(nearest)], focal


def tower(
    shape: tuple[int, int], focal: float, ahead: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return a ball on a tower before a plain, seen from `ahead` nearer: linear RGB and depth."""
    height, width = shape
    sy, sx = (np.mgrid[:height, :width] + 0.5 - [[[height / 2]], [[width / 2]]]) / focal
    depth = np.full(shape, np.inf)
    shade = np.zeros(shape)
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(sy > 0, 1.6 / sy, np.inf)
        tiles = (np.floor(ground * sx) + np.floor(ground + ahead)) % 2
    depth, shade = ground, np.where(np.isfinite(ground), 0.12 + 0.1 * tiles, 0)
    for radius, center in ((0.8, (0.0, -0.5, 5.0 - ahead)), (0.22, None)):
        if center is None:
            a, b, c = sx**2 + 1, -2 * (5.0 - ahead), (5.0 - ahead) ** 2 - radius**2
        else:
            way = np.stack([sx, sy, np.ones(shape)], -1)
            a = (way**2).sum(-1)
            b, c = -2 * way @ np.array(center), np.dot(center, center) - radius**2
        root = b * b - 4 * a * c
        z = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / (2 * a), np.inf)
        if center is None:
            z = np.where((z * sy > 0.2) & (z * sy < 1.6), z, np.inf)
        near = z < depth
        flat = np.where(near, z, 1.0)
        tilt = (flat * sx - 0.0) / radius
        shade = np.where(near, 0.05 + 0.45 * np.clip(0.6 - 0.5 * tilt, 0, 1), shade)
        depth = np.minimum(depth, z)
    sky = np.clip(0.5 - 0.4 * sy, 0.2, 0.9)[..., None] * np.array([0.35, 0.5, 0.75])
    red = np.stack([shade, 0.75 * shade, 0.6 * shade], -1)
    return np.where(np.isfinite(depth)[..., None], red, sky).astype(np.float32), depth


def flight() -> None:
    """Print by how much the mean alpha of the paper's fog changes by the camera's speed."""
    print("| units a frame | fl.Mist, particles | culled, as in the paper |")
    print("| --- | --- | --- |")
    for step in (0.025, 0.05, 0.1, 0.2):
        largest = []
        for near_mode in ("exact", "cull"):
            means = []
            for t in range(round(5.0 / step)):
                way = {"velocity": (0, 0, -step), "time": t}
                centers = fl.particles.positions(1200, 5.0, seed=3, center=(0, 0, 1.675), **way)
                shown = 0.4 * fl.particles.edge_fade(centers, 5.0, center=(0, 0, 1.675))
                means.append(
                    fl.gas.alpha(
                        (36, 48), centers, 0.45, shown, fl.Camera(42.0), near_mode=near_mode
                    ).mean()
                )
            largest.append(float(np.abs(np.diff(means)).max()))
        print(f"| {step:g} | {largest[0]:.4f} | {largest[1]:.4f} |")


def pictures() -> None:
    """Make the pictures of gas.md."""
    left, right, depth, other, focal = motorcycle()
    camera = fl.Camera(focal)
    shown = [left]
    for preset in ("clouds", "mist", "fog"):
        scene = fl.Scene(
            left, camera=camera, depth=depth, seed=3, effects=[fl.Mist(preset, method="particles")],
        )  # fmt: skip
        shown.append(scene.render(3))
    save("gas_presets.jpg", np.vstack([np.hstack(shown[:2]), np.hstack(shown[2:])]), 1300)

    # Both photographs under one fog: the left eye is the camera, the right one stands .193 m aside.
    fog = fl.Mist("fog", visibility=9.0)
    eyes = [camera, fl.Camera(focal, offset=(0.193001, 0, 0), center_shift=(31.086, 0))]
    pair = [
        fl.Scene(photograph, camera=camera, depth=distance, seed=3, effects=[fog]).render(
            3, eye=eye
        )
        for photograph, distance, eye in zip((left, right), (depth, other), eyes, strict=True)
    ]
    # What is 38 px apart comes to lie in the plane of the screen.
    shifted = [(a[:, 38:], b[:, :-38]) for a, b in ((left, right), pair)]
    save("gas_anaglyph.jpg", np.hstack([stereo.anaglyph(*both) for both in shifted]), 1300)

    shape, f = (480, 640), 560.0
    picture, far = tower(shape, f)
    rows = []
    for preset in ("clouds", "mist", "fog"):
        row = []
        for place in ((0.0, 0.0, 0.0), (0.0, 0.0, 3.2)):
            moved, distance = tower(shape, f, place[2])
            scene = fl.Scene(
                moved, camera=fl.CameraPath(fl.Camera(f), position=[place]), depth=distance,
                effects=[fl.Mist(preset, method="particles", center=(0, 0, 5.5), box=6.0)], seed=2,
            )  # fmt: skip
            row.append(scene.render(0))
        rows.append(np.hstack(row))
    save("gas_tower.jpg", np.vstack(rows), 1100)

    cloud = fl.Mist("cumulus", center=(4, -7, 34), box=(24, 9, 16), visibility=8, color=0.98)
    lit = []
    for sun in (None, fl.scene.Sun((0.5, 1.0, 0.2), (1.0, 0.97, 0.9), 0.18)):
        scene = fl.Scene(
            picture, camera=fl.Camera(f), depth=far, sun=sun, effects=[cloud], seed=9,
        )  # fmt: skip
        lit.append(scene.render(0))
    save("gas_lit.jpg", np.hstack(lit), 1200)


if __name__ == "__main__":
    chosen = sys.argv[1:] or ["ladder", "errors", "flight", "pictures"]
    for task in chosen:
        {"ladder": ladder, "errors": errors, "flight": flight, "pictures": pictures}[task]()
