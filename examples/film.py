"""A film of falling snow, a still with layers, and two eyes: the usual calls, with their types.

python examples/film.py FOLDER
"""

import sys
from pathlib import Path

import numpy as np

import flurries as fl

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
picture = fl.io.photograph(size=(320, 214))

# Snow that begins, in a wind that turns; the camera flies forward.
snow = fl.Snow(
    "heavy",
    amount=fl.Keys([(0, 0.0), (20, 1.0)]),
    wind=fl.Wind((0.5, 0.0, 0.0), gusts=1.0),
)
camera = fl.CameraPath(fl.Camera(focal=380.0), velocity=(0.0, -0.2, 2.0))
scene = fl.Scene(picture, camera=camera, effects=[snow], fps=24, seed=7)

summary = scene.write(folder / "snow_%04d.png", "1-4", overwrite=True)
print(summary.written, Path(summary.files[0]).name)

# What a compositor wants: the snow alone, how deep it is, and how it moves.
parts = scene.layers(24)
flakes = parts.layers["snow"].rgba
share = float(np.mean(flakes[..., 3] > 0.1))
print(f"{parts!r}: opacity {parts.alpha.mean():.3f}, {share:.0%} of the pixels show snow")
scene.replace(space="linear").write(folder / "snow.exr", 24, layers=True, overwrite=True)

# Two eyes 65 mm apart, for red and cyan glasses.
left, right = scene.stereo(24, distance=0.065)
fl.io.write_picture(folder / "anaglyph.png", fl.stereo.anaglyph(left, right))

# The texture alone, on arrays.
alpha = fl.spectral.alpha((214, 320), drift=(2.0, 9.0), seed=7, mean=0.1, spread=2.0)
fl.io.write_picture(folder / "texture.png", fl.composite.snow(picture, alpha))
