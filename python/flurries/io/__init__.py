"""Pictures, layers, films and color: the only place that touches files and color encodings.

Importing it costs NumPy; OpenImageIO and PyAV are imported by the first call that needs them.
"""

from flurries.io.atomic import remove_leftovers as remove_leftovers
from flurries.io.atomic import replacing as replacing
from flurries.io.color import linear_to_srgb, srgb_to_linear
from flurries.io.files import Budget
from flurries.io.films.writer import VideoWriter as VideoWriter
from flurries.io.layers.planes import Deep, read_deep, read_layers, write_layers
from flurries.io.layers.planes import read_views as read_views
from flurries.io.layers.planes import write_layer_views as write_layer_views
from flurries.io.photographs import photograph
from flurries.io.pictures.fitting import fit
from flurries.io.pictures.fitting import fit_nearest as fit_nearest
from flurries.io.pictures.reader import Picture, read_depth, read_picture
from flurries.io.pictures.slate import Slate as Slate
from flurries.io.pictures.slate import read_slate as read_slate
from flurries.io.pictures.writer import write_picture
from flurries.io.sequences import Pattern as Pattern
from flurries.io.sequences import frame_range as frame_range
from flurries.io.sources import open_background
from flurries.io.sources import open_depth as open_depth
from flurries.io.sources import read_video as read_video

# What users are told of; the rest serves the other folders.
__all__ = [
    "Budget", "Deep", "Picture", "fit", "linear_to_srgb", "open_background", "photograph",
    "read_deep", "read_depth", "read_layers", "read_picture", "srgb_to_linear", "write_layers",
    "write_picture",
]  # fmt: skip
