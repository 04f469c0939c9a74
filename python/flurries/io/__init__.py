"""Pictures, sequences and video: the only place that touches files and color encodings.

Importing it costs NumPy; OpenImageIO and PyAV are imported by the first call that needs them.
"""

from flurries.io.atomic import remove_leftovers, replacing
from flurries.io.color import linear_to_srgb, srgb_to_linear
from flurries.io.decoding import read_video
from flurries.io.depth import open_depth, read_depth
from flurries.io.headers import Header, read_header
from flurries.io.layer_views import write_layer_views
from flurries.io.layers import read_layers, write_layers
from flurries.io.pictures import Picture, read_mask, read_picture
from flurries.io.resize import fit, fit_nearest
from flurries.io.sequences import Pattern, frame_range
from flurries.io.sources import Source, open_background
from flurries.io.video import VideoWriter
from flurries.io.views import read_views, write_views
from flurries.io.writing import write_picture

__all__ = [
    "Header",
    "Pattern",
    "Picture",
    "Source",
    "VideoWriter",
    "fit",
    "fit_nearest",
    "frame_range",
    "linear_to_srgb",
    "open_background",
    "open_depth",
    "read_depth",
    "read_header",
    "read_layers",
    "read_mask",
    "read_picture",
    "read_video",
    "read_views",
    "remove_leftovers",
    "replacing",
    "srgb_to_linear",
    "write_layer_views",
    "write_layers",
    "write_picture",
    "write_views",
]
