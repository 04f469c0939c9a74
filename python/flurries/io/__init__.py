"""Pictures, layers, films and color: the only place that touches files and color encodings.

Importing it costs NumPy; OpenImageIO and PyAV are imported by the first call that needs them.
"""

from flurries.io.atomic import remove_leftovers, replacing
from flurries.io.color import linear_to_srgb, srgb_to_linear
from flurries.io.files import Budget
from flurries.io.films.writer import VideoWriter
from flurries.io.layers.planes import read_layers, read_views, write_layer_views, write_layers
from flurries.io.photographs import photograph
from flurries.io.pictures.fitting import fit, fit_nearest
from flurries.io.pictures.header import Header, read_header
from flurries.io.pictures.reader import Picture, read_depth, read_picture
from flurries.io.pictures.slate import Slate, read_slate
from flurries.io.pictures.writer import write_picture
from flurries.io.sequences import Pattern, frame_range
from flurries.io.sources import Source, open_background, open_depth, read_video

__all__ = [
    "Budget", "Header", "Pattern", "Picture", "Slate", "Source", "VideoWriter", "fit",
    "fit_nearest", "frame_range", "linear_to_srgb", "open_background", "open_depth",
    "photograph", "read_depth", "read_header", "read_layers", "read_picture", "read_slate",
    "read_video", "read_views", "remove_leftovers", "replacing", "srgb_to_linear",
    "write_layer_views", "write_layers", "write_picture",
]  # fmt: skip
