"""The tables of a scene file and their keys, for who reads them and who writes them."""

from __future__ import annotations

from dataclasses import fields

from flurries.camera.lens import Camera
from flurries.camera.optics import Lens
from flurries.light.lamp import Lamp
from flurries.light.sun import Sun
from flurries.motion.wind import FIELDS
from flurries.scene.output import Output
from flurries.scene.scene import Scene

# The number that files say, raised where an older file would mean something else.
FORMAT = 3

SCENE = tuple(f.name for f in fields(Scene) if f.init)
SUN = tuple(f.name for f in fields(Sun))
DEPTH = ("source", "near", "far", "white", "law")
LAMP = tuple(f.name for f in fields(Lamp))
OPENING = tuple(f.name for f in fields(Lens))
OUTPUT = tuple(f.name for f in fields(Output))
LENS = tuple(f.name for f in fields(Camera))
WAY = ("position", "velocity", "orientation")
# A field of velocities is an array, which no text holds.
WIND = tuple(name for name in FIELDS if name != "field")
