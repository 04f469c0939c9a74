"""A camera: its lens, its way through the air, and cameras from other programs."""

from flurries.camera.lens import Camera, image_velocity, project
from flurries.camera.optics import Lens
from flurries.camera.tiles import tile_drift, tile_shift

__all__ = ["Camera", "Lens", "image_velocity", "project", "tile_drift", "tile_shift"]
