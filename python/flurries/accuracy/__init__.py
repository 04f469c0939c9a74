"""What accuracy costs: for every approximation, its error against the time that it takes.

`flurries accuracy` measures on your machine and writes a page with plots; `fl.accuracy.study` gives
the numbers. References are slow and independent: sums in extended precision, brute force, closed
forms. Plots need the extra ``flurries[plots]``.
"""

from flurries.accuracy.page import write
from flurries.accuracy.study import AXES, Point, Study, study
from flurries.accuracy.ways import Axis

__all__ = ["AXES", "Axis", "Point", "Study", "study", "write"]
