"""What can be in the air of a scene: each effect says what it is made of and renders one layer."""

from flurries.effects.cone import ConeRain, ConeSnow
from flurries.effects.matched import MatchedSnow
from flurries.effects.mist import Mist
from flurries.effects.rain import Rain
from flurries.effects.snow import Snow

__all__ = ["ConeRain", "ConeSnow", "MatchedSnow", "Mist", "Rain", "Snow"]
