"""What can be in the air of a scene: each effect says what it is made of and renders one layer."""

from flurries.effects.layer import Frame, Layer
from flurries.effects.matched import MatchedSnow
from flurries.effects.rain import Rain
from flurries.effects.snow import Snow

__all__ = ["Frame", "Layer", "MatchedSnow", "Rain", "Snow"]
