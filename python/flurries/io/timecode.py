"""Time codes of film and television: hours, minutes, seconds and frames."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

_TEXT = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})([:;.,])(\d{2,3})")

# In a word of SMPTE 12M each digit has four bits, from the hours' on, and some of them are flags.
_DIGITS, _DROP = 0x3F7F7F3F, 1 << 6


@dataclass(frozen=True)
class TimeCode:
    """A time code, as a number of frames since midnight."""

    frames: int  # From 0.
    nominal: int  # Frames that a second counts: 24, 25, 30, 60.
    drop: bool = False  # Whether two numbers of 30 are left out in each minute but every tenth.

    @staticmethod
    def of_text(text: str, rate: Fraction) -> TimeCode | None:
        """Return the time code of "01:00:00:00" or, where numbers drop, "01:00:00;00"."""
        found = _TEXT.fullmatch(text.strip())
        if found is None:
            return None
        hours, minutes, seconds, frames = (int(found[place]) for place in (1, 2, 3, 5))
        nominal = -(-rate.numerator // rate.denominator)
        if hours > 23 or minutes > 59 or seconds > 59 or frames >= nominal:
            return None
        whole = 60 * hours + minutes
        count = (60 * whole + seconds) * nominal + frames
        drop = found[4] != ":" and nominal % 30 == 0
        if drop:
            count -= nominal // 15 * (whole - whole // 10)
        return TimeCode(count, nominal, drop)

    @staticmethod
    def of_word(word: int, rate: Fraction) -> TimeCode | None:
        """Return the time code of a word as OpenEXR's and DPX's headers have it."""
        digits, mark = f"{word & _DIGITS:08x}", ";" if word & _DROP else ":"
        text = f"{digits[:2]}:{digits[2:4]}:{digits[4:6]}{mark}{digits[6:]}"
        return TimeCode.of_text(text, rate)

    def later(self, frames: int) -> TimeCode:
        """Return the time code so many frames later; a day begins again."""
        dropped = self.nominal // 15 * (1440 - 144) if self.drop else 0
        day = 86400 * self.nominal - dropped
        return TimeCode((self.frames + frames) % day, self.nominal, self.drop)

    @property
    def text(self) -> str:
        count = self.frames
        if self.drop:
            skipped = self.nominal // 15
            tens, rest = divmod(count, 600 * self.nominal - 9 * skipped)
            ones = max(rest - skipped, 0) // (60 * self.nominal - skipped)
            count += skipped * (9 * tens + ones)
        seconds, frames = divmod(count, self.nominal)
        clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
        return f"{clock}{';' if self.drop else ':'}{frames:02d}"

    @property
    def word(self) -> int:
        digits = re.sub(r"\D", "", self.text)
        return int(digits[:6] + digits[-2:], 16) | (_DROP if self.drop else 0)
