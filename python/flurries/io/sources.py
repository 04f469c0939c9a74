"""Backgrounds: a still, a numbered sequence or a video, all asked for a frame by its number."""

from __future__ import annotations

import errno
import operator
import os
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any
from weakref import WeakSet

from flurries._contract import Array, PathLike, choice, naming, suggestion
from flurries._kept import Kept
from flurries.io.color import Encoding
from flurries.io.files import Budget, given, path_text, plain_file
from flurries.io.films.process import Remote
from flurries.io.films.reader import READABLE, Decoder, check_structure, require_library
from flurries.io.layers.cryptomatte import read_matte, split_names, things_of
from flurries.io.pictures.header import Window, opened_picture, rate_of
from flurries.io.pictures.reader import Picture, read_depth, read_picture, require_depth
from flurries.io.sequences import Pattern, with_percent

# Two eyes ask for the same frame, and a player steps back and forth by one.
_KEPT = 3

_sources: WeakSet[Source] = WeakSet()


def _renew_sources() -> None:
    # A thread that is gone may hold a lock, and a codec's file is the parent's.
    for source in list(_sources):
        source._renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_sources)


class Source(ABC):
    """A background that has a picture for every frame."""

    # Safe to share between threads, to pickle and to use after a fork: files are opened again where
    # need be. Pictures that it returns are read-only, since the next caller may get the same ones.
    spec: str  # What it was opened from, as an absolute path.
    size: tuple[int, int]  # (width, height) in px.
    count: int | None = None  # How many frames there are; None for a still.
    first: int = 0  # The number of the first frame: of a sequence's files; else 0.
    fps: float | None = None  # Of a video, or as a picture's header says.
    display: Window | None = None  # The display window's place in pictures with their overscan.
    aspect: float = 1.0  # Width of a pixel over its height.
    overscan: bool = False
    encoding: Encoding
    damaged: str  # What happens to a frame that cannot be read: "stop" or "hold".

    def __init__(self, spec: str, damaged: str) -> None:
        self.spec, self.damaged = spec, damaged
        # Frames, of those asked for so far, that were replaced by an earlier one.
        self.held: set[int] = set()
        self._renew()

    def frame(self, i: int) -> Picture:
        """Return the picture of frame `i`, counted from 0; beyond the ends the first or last."""
        number = self._number(i)
        with self._lock:
            return self._kept.once(number, lambda: self._read_or_hold(number))

    def file(self, i: int) -> Path:
        return Path(self.spec)

    def gaps(self, span: Sequence[int]) -> list[int]:
        """Return the numbers, of some that lie between the first and the last, without a file."""
        return []

    def close(self) -> None:
        """Close files and forget pictures; asking for a frame opens them again."""
        with self._lock:
            self._kept.clear()

    def _number(self, i: int) -> int:
        """Return the frame that stands for `i`: the first before it, the last after the end."""
        number = max(operator.index(i), 0)
        return 0 if self.count is None else min(number, self.count - 1)

    @abstractmethod
    def _read(self, number: int) -> Picture: ...

    def _read_or_hold(self, number: int) -> Picture:
        """Return a picture that the next caller may get as well."""
        # The last good frame up to it, found by reading backwards and not by remembering, so that
        # it does not depend on which frames were asked for before.
        failed: Exception | None = None
        for earlier in range(number, -1, -1):
            try:
                picture = self._read(earlier)
            except (OSError, ValueError) as error:
                if self.damaged == "stop":
                    raise
                failed = failed or error
                continue
            if failed is not None:
                self.held.add(number)
            for plane in (picture.pixels, picture.alpha):
                if plane is not None:
                    plane.flags.writeable = False
            return picture
        assert failed is not None
        raise failed

    def _renew(self) -> None:
        self._lock = threading.Lock()
        self._kept = Kept(_KEPT)
        _sources.add(self)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if not name.startswith("_")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._renew()


class PictureSource(Source):
    """One picture for all frames, or a file for each; frame 0 has the lowest number."""

    def __init__(
        self, name: str, spec: PathLike, damaged: str,
        read: Callable[[Path], Picture], *, overscan: bool = False, deep: bool = False,
    ) -> None:  # fmt: skip
        path = _place(name, spec)
        super().__init__(str(path), damaged)
        self.read, self.overscan = read, overscan
        # Only the name is a pattern: a folder may be called "50%".
        self.pattern = Pattern(path.name) if _is_pattern(path) else None
        if self.pattern is not None:
            numbers = self.pattern.existing(str(path.parent))
            if not numbers:
                raise FileNotFoundError(errno.ENOENT, "No frame of it is there", str(path))
            self.first, self.count = numbers[0], numbers[-1] - numbers[0] + 1
        with opened_picture(self.file(0), overscan=overscan, deep=deep) as opened:
            header, rate = opened.specification, rate_of(opened.specification)
            self.size, self.encoding, self.display = opened.size, opened.encoding, opened.display
            # What a DPX says of its numbers: "Logarithmic", "Linear" and so on.
            self.aspect, self.curve = opened.aspect, header.get_string_attribute("dpx:Transfer")
        self.fps = None if rate is None else float(rate)

    def file(self, i: int) -> Path:
        path = Path(self.spec)
        if self.pattern is None:
            return path
        return path.parent / self.pattern.path(self.first + self._number(i))

    def gaps(self, span: Sequence[int]) -> list[int]:
        if self.pattern is None:
            return []
        there = set(self.pattern.existing(str(Path(self.spec).parent)))
        return [number for number in span if number not in there]

    def _read(self, number: int) -> Picture:
        path, frame = self.file(number), self.first + number
        if self.pattern is None:
            return self.read(path)
        if not path.exists():
            raise FileNotFoundError(errno.ENOENT, f"Frame {frame} is missing", str(path))
        said = f"frame {frame}"
        with naming(said, OSError, then=OSError), naming(said, ValueError, then=ValueError):
            picture = self.read(path)
        if picture.size != self.size or picture.encoding != self.encoding:
            raise OSError(
                f"frame {frame}: {path} is {picture.size[0]} x {picture.size[1]} px, "
                f"{picture.encoding}; the first frame is {self.size[0]} x {self.size[1]} px, "
                f"{self.encoding}"
            )
        return picture


class VideoSource(Source):
    """A video's frames in the order of showing, RGB: uint8, of more than 8 bits uint16."""

    encoding: Encoding = "display"
    count: int
    _decoder: Remote | None

    def __init__(self, spec: str, damaged: str = "stop", budget: Budget | None = None) -> None:
        require_library()
        path = plain_file(spec)
        super().__init__(str(path), damaged)
        self.budget = given("budget", budget, Budget)
        check_structure(path)
        # Its process has decoded the first frame by then.
        self.fps, self.count, self.size, self.tags, self.sound = self._ask("facts")
        self.aspect = float(self.tags.aspect)

    def close(self) -> None:
        super().close()
        with self._lock:
            if self._decoder is not None:
                self._decoder.close()  # The next frame opens it again.

    def _renew(self) -> None:
        super()._renew()
        self._decoder = None

    def _ask(self, method: str, *arguments: Any) -> Any:
        # It has ended after a crash, Ctrl-C while it was asked, or a fork.
        if self._decoder is None or self._decoder.ended:
            path = Path(self.spec)
            self._decoder = Remote(path, "read", Decoder, path, self.budget)
        return self._decoder.call(method, *arguments)

    def smaller(self, number: int, scale: int) -> Array:
        """Return a frame's means over squares of scale x scale pixels, rounded."""
        with self._lock:
            pixels: Array = self._ask("frame", number, scale)
            return pixels

    def _read(self, number: int) -> Picture:
        return Picture(self._ask("frame", number), None, "display", self.spec)


def read_video(path: PathLike, *, budget: Budget | None = None) -> Iterator[Array]:
    """Yield the frames of a video in order, each (H, W, 3): uint8, of more bits uint16."""
    with closing(VideoSource(path_text("path", path), budget=budget)) as film:
        for number in range(film.count):
            yield film._read(number).pixels


def open_background(
    spec: PathLike, *, damaged: str = "stop", budget: Budget | None = None, overscan: bool = False
) -> Source:
    """Open a background.

    A picture, ``plate.exr``; a numbered sequence from the lowest number that is there,
    ``plate.%04d.png`` (or ``####``, ``$F4``); or a video, ``plate.mov``. A frame that is missing or
    `damaged` is an error with "stop"; with "hold" the last good frame before it stands in for it.
    `budget` and `overscan` are those of `read_picture`, for each frame, and of pictures alone.
    """
    choice("damaged", damaged, ("stop", "hold"))
    given("budget", budget, Budget)
    path = _place("spec", spec)
    if path.suffix.lower() not in READABLE or _is_pattern(path):
        read = partial(read_picture, budget=budget, overscan=overscan)
        return PictureSource("spec", spec, damaged, read, overscan=overscan)
    film = VideoSource(str(path), damaged, budget)
    # ITU-R BT.2100's curves.
    hdr = {16: "PQ", 18: "HLG"}.get(film.tags.transfer)
    wrong = hdr and f"HDR ({hdr}), no display values: convert it to an EXR sequence first"
    if film.tags.interlaced:
        wrong = "interlaced: make it progressive first, such as by ffmpeg's filter bwdif"
    if wrong:
        film.close()
        raise ValueError(f"{path} is {wrong}")
    return film


def _place(name: str, spec: PathLike) -> Path:
    path = Path(path_text(name, spec)).absolute()
    # A file whose own name holds a token is that file.
    return path if path.exists() else Path(with_percent(str(path)))


def _is_pattern(path: Path) -> bool:
    return "%" in path.name and not path.exists()


def open_depth(spec: PathLike, *, budget: Budget | None = None, overscan: bool = False) -> Source:
    """Open depth as `read_depth` has it: a picture, or a numbered sequence."""
    read = partial(_plane, read_depth, budget=budget, overscan=overscan)
    source = PictureSource("depth", spec, "stop", read, overscan=overscan, deep=True)
    require_depth(source.file(0), budget)
    return source


def open_matte(spec: PathLike, *, overscan: bool = False) -> Source | None:
    """Open the cover of what ``plate.####.exr:house,tree`` names; None without such names."""
    file, names = split_names(spec)
    if not names:
        return None
    source = PictureSource("foreground", file, "stop", read_picture, overscan=overscan)
    things: dict[str, tuple[str, str]] = {}
    known: set[str] = set()
    for number in range(source.count or 1):
        missing = [name for name in names if name not in things]
        if missing and source.file(number).exists():
            found, more = things_of(source.file(number), missing)
            things, known = things | found, known | more
    for name in names:
        if name not in things:
            raise ValueError(f"{file}: no Cryptomatte has {name!r}{suggestion(name, known)}")
    source.read = partial(_plane, read_matte, things=[*things.values()], overscan=overscan)
    return source


def _plane(read: Callable[..., Array], path: Path, **more: Any) -> Picture:
    return Picture(read(path, **more), None, "linear", str(path))
