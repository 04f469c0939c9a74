"""Snow inside a pipeline of kornia: a batch of pictures, each in a weather of its own.

python examples/with_kornia.py FOLDER
"""

import sys
from pathlib import Path

import kornia
import kornia.augmentation as K
import torch
from PIL import Image

import flurries as fl
from flurries.augment.kornia import Rainfall, Snowfall

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
photograph = torch.from_numpy(fl.io.photograph()[:400, :400]).permute(2, 0, 1).float() / 255.0
batch = torch.stack([photograph] * 3)
masks = (batch[:, :1] > 0.5).float()

torch.manual_seed(7)
pipeline = K.AugmentationSequential(
    Snowfall(severity=(2, 4), p=1.0), K.RandomHorizontalFlip(p=1.0), data_keys=["input", "mask"]
)
seen, labels = pipeline(batch, masks)
assert seen.shape == batch.shape and seen.dtype == torch.float32
assert torch.equal(labels, masks.flip(-1))
assert not torch.equal(seen[0], seen[1])  # each its own
rainy = Rainfall(severity=3, p=1.0, same_on_batch=True)(batch)
assert torch.equal(rainy[0], rainy[1])
show = torch.cat(list(seen), dim=2).permute(1, 2, 0)
Image.fromarray((show * 255).round().byte().numpy()).save(folder / "kornia_snow.png")
print(f"kornia {kornia.__version__}: a batch with its masks")
