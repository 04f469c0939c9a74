"""A data set whose pictures get snow; worker processes that are spawned import this and no more."""

import torch
from skimage import data
from torch.utils.data import Dataset

import flurries as fl
from flurries.augment import torchvision as flt

PHOTOGRAPH = data.astronaut()[:160, 100:300]


class Snowed(Dataset):
    """Pictures by number; without `by_index` by torch's random numbers."""

    def __init__(self, by_index: bool) -> None:
        self.by_index = by_index
        self.plain = fl.augment.Snowfall(severity=(2, 4), seed=3)
        self.drawn = flt.Snowfall(severity=(2, 4))
        self.planes = torch.from_numpy(PHOTOGRAPH).permute(2, 0, 1).contiguous()

    def __len__(self) -> int:
        return 12

    def __getitem__(self, index: int) -> torch.Tensor:
        if self.by_index:
            return torch.from_numpy(self.plain(PHOTOGRAPH, index=index))
        return self.drawn(self.planes)
