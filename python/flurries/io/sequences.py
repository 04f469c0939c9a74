"""Which frames, and in which files: ``1-60`` and ``frames/%04d.exr``."""

import operator
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

# More frames are refused before a list of them is made: at 24 frames a second, four days.
MOST_FRAMES = 10_000_000

_LONGEST_TEXT = 100_000

VIDEO_EXTENSIONS = (".mp4", ".mov", ".webm", ".mkv")

_PART = re.compile(r"(-?[0-9]{1,9})(?:-(-?[0-9]{1,9})(?:x([0-9]{1,9}))?)?")
_TOKEN = re.compile(r"%(?:0([0-9]{1,2}))?d")

# The tokens of compositing programs: a digit for each "#", and Houdini's.
_OTHER_TOKENS = re.compile(r"#+|@{2,}|\$F[0-9]?(?![A-Za-z0-9])")


def frame_range(text: str) -> list[int]:
    """Return the frames of "1-10,20,30-40x2", in its order, each once; "9-1" runs backwards."""
    if not isinstance(text, str):
        raise TypeError(f"frames must be a text like '1-60', got {text!r}")
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"frames {_short(text)} are {len(text)} characters, too many to be meant")
    ranges = [_range(part.strip(), text) for part in text.split(",")]
    if sum(map(len, ranges)) > MOST_FRAMES:
        raise ValueError(f"frames {_short(text)} are more than {MOST_FRAMES}")
    if len(ranges) == 1:
        return list(ranges[0])
    return list(dict.fromkeys(frame for part in ranges for frame in part))


def _range(part: str, text: str) -> range:
    matched = _PART.fullmatch(part)
    if not matched:
        raise ValueError(
            f"frames {_short(text)} must read like '1-60', '7', '1-100x2' or '1-10,20'; "
            f"{_short(part)} does not"
        )
    first, last, step = int(matched[1]), int(matched[2] or matched[1]), int(matched[3] or 1)
    if step == 0:
        raise ValueError(f"frames {part!r} have a step of 0; it must be at least 1")
    return range(first, last + 1, step) if first <= last else range(first, last - 1, -step)


def _short(text: str) -> str:
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def with_percent(text: str) -> str:
    """Return a file's name with the frame token of compositing programs as ``%04d``."""
    folder, name = os.path.split(text)
    if "%" in name or len(found := _OTHER_TOKENS.findall(name)) != 1:
        return text
    from fileseq.constants import PAD_STYLE_HASH1
    from fileseq.filesequence import FileSequence

    digits = FileSequence.getPaddingNum(found[0], pad_style=PAD_STYLE_HASH1)
    plain = name.replace(found[0], "%d" if digits == 1 else f"%0{digits}d")
    return os.path.join(folder, plain)  # noqa: PTH118 -- a Path would drop a leading "./"


@dataclass(frozen=True)
class Pattern:
    """The files of frames: a name with one frame token, or a video."""

    text: str
    inside: str | None = None  # A folder that every frame must lie in, links resolved.

    def __post_init__(self) -> None:
        text = os.fspath(self.text)
        if not isinstance(text, str):
            raise TypeError(f"pattern must be a string or a path, got {self.text!r}")
        text = with_percent(text)
        object.__setattr__(self, "text", text)
        if self.inside is not None:
            object.__setattr__(self, "inside", os.fspath(self.inside))
        (folder, name), token = os.path.split(text), _TOKEN.search(text)
        single = name.count("%") == 1 and token is not None
        digits = int(token[1] or 1) if token is not None else 1
        controls = any(ord(character) < 32 or ord(character) == 127 for character in text)
        for good, wanted in (
            (text.strip(), "not be empty"),
            (not controls, "not hold control characters"),
            (name not in ("", ".", "..") and "\\" not in name, "end in a file name"),
            ("%" not in folder, "not hold '%' in a folder's name"),
            (not self.is_video or "%" not in name, "not hold '%': a video holds all frames"),
            (self.is_video or single, "hold one frame token, %04d, #### or $F4, in its file name"),
            (1 <= digits <= 12, "ask for 1 to 12 digits"),
        ):
            if not good:
                raise ValueError(f"pattern {_short(text)} must {wanted}")
        self._check_inside(self.path(0))

    @property
    def is_video(self) -> bool:
        """Whether the pattern names a video, which takes all frames."""
        return self.text.lower().endswith(VIDEO_EXTENSIONS)

    def path(self, frame: int) -> Path:
        """Return the file of a frame, which lies inside; for a video, the video."""
        number = operator.index(frame)
        path = Path(self.text if self.is_video else self.text % number)
        self._check_inside(path)
        return path

    def existing(self, start: str = "") -> list[int]:
        """Return the frames that are there as files, in ascending order; none for a video."""
        if self.is_video:
            return []
        folder, name = os.path.split(os.path.join(start, self.text))  # noqa: PTH118
        token = _TOKEN.search(name)
        assert token is not None  # As __post_init__ made sure.
        before, after = re.escape(name[: token.start()]), re.escape(name[token.end() :])
        digits = re.compile(f"{before}(-?[0-9]{{1,18}}){after}")
        try:
            names = os.listdir(folder or ".")  # noqa: PTH208 -- names are all that is needed
        except (FileNotFoundError, NotADirectoryError):
            return []
        found = [match for match in map(digits.fullmatch, names) if match]
        # "7" is not a frame of %04d: only what this pattern would write counts.
        return sorted(int(match[1]) for match in found if name % int(match[1]) == match[0])

    def _check_inside(self, path: Path) -> None:
        folder = None if self.inside is None else Path(self.inside).resolve()
        if folder is not None and folder not in path.resolve().parents:
            raise ValueError(f"pattern {_short(self.text)} leads outside {self.inside}")


# What becomes of a number outside: an error, the first or last frame, or the frames over again.
EXTEND = ("stop", "hold", "loop")


def words_of(frames: Iterable[int]) -> str:
    """Return frame numbers as people write them: "1001-1003,1007"."""
    from fileseq import framesToFrameRange

    found = str(framesToFrameRange(frames, sort=True))
    return found if len(found) <= 80 else f"{found[:77]}..."


@dataclass(frozen=True)
class Span:
    name: str  # What has them, for messages: "depth depth.%04d.exr".
    first: int
    last: int
    extend: str = "stop"  # What stands for a number outside.

    @property
    def words(self) -> str:
        return f"{self.first}" if self.first == self.last else f"{self.first}-{self.last}"

    def number(self, wanted: int) -> int:
        """Return the number, from first to last, that stands for a number."""
        if self.first <= wanted <= self.last:
            return wanted
        if self.extend == "stop":
            raise ValueError(self.complaint([wanted]))
        if self.extend == "hold":
            return min(max(wanted, self.first), self.last)
        return self.first + (wanted - self.first) % (self.last - self.first + 1)

    def outside(self, wanted: Iterable[int]) -> list[int]:
        """Return the numbers that nothing stands for."""
        if self.extend != "stop":
            return []
        return [number for number in wanted if not self.first <= number <= self.last]

    def complaint(self, wanted: Iterable[int]) -> str:
        numbers = list(wanted)
        noun = "frame" if len(numbers) == 1 else "frames"
        return (
            f"{noun} {words_of(numbers)} of the shot: the {self.name} has {self.words}; "
            "extend='hold' repeats its ends, extend='loop' repeats all of it"
        )
