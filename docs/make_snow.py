"""The README's moving picture: docs/images/snow.webp, heavy snow at 1:1.

python docs/make_snow.py
"""

from pathlib import Path

import numpy as np
from PIL import Image

import flurries as fl

FILE = Path(__file__).parent / "images" / "snow.webp"
FRAMES = 36


def main() -> None:
    picture = fl.io.photograph(size=(560, 373))
    snow = fl.Snow("heavy", color=0.98, wind=fl.Wind((0.6, 0.0, 0.0), gusts=0.6, scale=4.0))
    scene = fl.Scene(picture, effects=[snow], fps=25, seed=4)
    pages = [Image.fromarray(np.asarray(scene.render(50 + n))) for n in range(FRAMES)]
    pages[0].save(
        FILE, quality=48, method=4, save_all=True, append_images=pages[1:], duration=40, loop=0
    )
    print(FILE, FILE.stat().st_size)


if __name__ == "__main__":
    main()
