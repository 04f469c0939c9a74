"""Snow inside a pipeline of torchvision (v2), in a DataLoader with workers.

python examples/with_torchvision.py FOLDER
"""

import sys
from pathlib import Path

import torch
import torchvision
from torch.utils.data import DataLoader
from torchvision import tv_tensors
from torchvision.transforms import v2

import flurries as fl
from flurries.augment.torchvision import Fog, Snowfall

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
photograph = torch.from_numpy(fl.io.photograph("coffee")).permute(2, 0, 1).contiguous()

pipeline = v2.Compose([Snowfall(severity=(2, 4)), v2.RandomHorizontalFlip(p=1.0)])
picture = tv_tensors.Image(photograph)
boxes = tv_tensors.BoundingBoxes(
    torch.tensor([[100, 50, 400, 350]]), format="XYXY", canvas_size=photograph.shape[-2:]
)
torch.manual_seed(7)
seen, around = pipeline(picture, boxes)
assert isinstance(seen, tv_tensors.Image) and seen.dtype == torch.uint8
assert around.tolist() == [[200, 50, 500, 350]]
v2.functional.to_pil_image(seen).save(folder / "torchvision_snow.png")

film = tv_tensors.Video(torch.stack([photograph] * 3))
frames = Fog(severity=3, fps=24.0)(film)
assert frames.shape == film.shape


class Photographs:
    """Snow by the number of the picture: the same set whatever the number of workers.

    A loader takes whatever has a length and numbered items.
    """

    snow = fl.augment.Snowfall(amount=(0.2, 0.8), seed=7)

    def __len__(self) -> int:
        return 8

    def __getitem__(self, index: int) -> torch.Tensor:
        return torch.from_numpy(self.snow(fl.io.photograph()[:192, :256], index=index))


if __name__ == "__main__":
    alone = torch.cat(list(DataLoader(Photographs(), batch_size=2)))
    shared = torch.cat(list(DataLoader(Photographs(), batch_size=2, num_workers=2)))
    assert torch.equal(alone, shared) and len(torch.unique(alone, dim=0)) == 8
    print(f"torchvision {torchvision.__version__}: a picture, a film, and a loader with workers")
