"""Snow inside a pipeline of albumentations or AlbumentationsX, with boxes, a mask and a film.

python examples/with_albumentations.py FOLDER
"""

import sys
from pathlib import Path

import albumentations as A
import numpy as np
from PIL import Image

import flurries as fl
from flurries.augment.albumentations import Rainfall, Snowfall

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
photograph = fl.io.photograph("coffee")
face = [[180.0, 60.0, 270.0, 180.0]]
mask = np.zeros(photograph.shape[:2], np.uint8)
mask[60:180, 180:270] = 1

pipeline = A.Compose(
    [
        Snowfall(severity=(2, 4), alpha_key="alpha", record_key="records", p=1.0),
        A.HorizontalFlip(p=1.0),
    ],
    bbox_params=A.BboxParams("pascal_voc", label_fields=["labels"]),
    additional_targets={"alpha": "mask"},
    seed=7,
)
clear = np.zeros(photograph.shape[:2], np.float32)
seen = pipeline(
    image=photograph, mask=mask, alpha=clear, records=[], bboxes=face, labels=["face"]
)  # fmt: skip
assert seen["image"].shape == photograph.shape and seen["image"].dtype == np.uint8
assert (seen["mask"][:, ::-1] == mask).all()  # the weather left the labels alone
hidden = fl.augment.occlusion(seen["alpha"], seen["bboxes"])  # the share of the face
assert 0.0 < hidden[0] < 1.0
again = fl.augment.replay(seen["records"][0])(photograph)
assert (seen["image"][:, ::-1] == again).all()
Image.fromarray(seen["image"]).save(folder / "albumentations_snow.png")

# The frames of a film have one weather, and it moves.
film = np.stack([photograph] * 4)
rain = A.Compose([Rainfall(severity=4, fps=24.0, p=1.0)], seed=7)
frames = rain(images=film)["images"]
assert frames.shape == film.shape and (frames[0] != frames[1]).any()
Image.fromarray(frames[0]).save(folder / "albumentations_rain.png")
print(f"albumentations {A.__version__}: a picture with its labels, and a film")
