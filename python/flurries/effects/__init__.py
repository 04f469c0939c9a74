"""What can be in the air of a scene: each effect names its parts and renders one layer."""

from flurries.effects.color import Hex
from flurries.effects.cone import ConeRain, ConeSnow
from flurries.effects.drawn import Flakes
from flurries.effects.falling import Rain, Snow
from flurries.effects.field import Field
from flurries.effects.kinds import register
from flurries.effects.mist import Mist
from flurries.effects.motion import Motion
from flurries.effects.notes import Body, Where
from flurries.effects.precipitation import Precipitation, Veil
from flurries.effects.tent import TentRain, TentSnow
from flurries.effects.texture import Texture
from flurries.frame.layer import Layer
from flurries.frame.view import Frame

__all__ = [
    "Body", "ConeRain", "ConeSnow", "Field", "Flakes", "Frame", "Hex", "Layer", "Mist",
    "Motion", "Precipitation", "Rain", "Snow", "TentRain", "TentSnow", "Texture", "Veil",
    "Where", "register",
]  # fmt: skip
