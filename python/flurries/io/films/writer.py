"""Writing video: H.264 for everyone, VP9 for the web, FFV1 where no bit is lost, ProRes to cut."""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType

import numpy.typing as npt

from flurries._contract import choice
from flurries.io.atomic import replacing
from flurries.io.films.codecs import QUALITIES, Encoder, encoder_for, encoder_threads, frame_rate
from flurries.io.films.encoding import GROUP, MATRICES, Film, Plan
from flurries.io.films.index import require_library
from flurries.io.films.process import Remote
from flurries.io.films.reader import UNSPECIFIED, Tags
from flurries.io.films.sound import Sound
from flurries.io.pictures.fitting import checked_size
from flurries.io.sequences import VIDEO_EXTENSIONS


class VideoWriter:
    """Writes a video frame by frame; a context manager.

    .mp4 and .mov hold H.264, .webm holds VP9, both with colors at half resolution (yuv420p,
    BT.709) and even sides, to which an odd picture's last column or row is repeated; .mkv holds
    FFV1, which loses nothing. The file appears when the block is left without an exception. The
    same frames make the same bytes with the same number of threads (`flurries.settings`), with all
    numbers up to 4, and in the reproducible mode with any.

    Parameters
    ----------
    path : str or path
        Ends in .mp4, .mov, .webm or .mkv.
    size : (int, int)
        (width, height) of every frame.
    fps : float or Fraction
        Above 0, at most 1000. 23.976, 29.97 and 59.94 mean 24000/1001 and so on.
    quality : {"high", "medium", "draft"}
    sound : flurries.io.films.sound.Sound, optional
        A part of another film's sound; copied where the new file can hold it, else encoded.
    comment : str
        For the file's header.
    codec : str, optional
        "h264", "h265", "vp9", "ffv1", "prores-hq", "prores-4444" or "dnxhr", not the usual one.
    bits : int, optional
        Of a color: 8, or where the codec has them 10 or 16.
    alpha : bool
        Whether frames have it, straight; "prores-4444" alone holds it.
    tags : Tags, optional
        Colors, pixel aspect and time code; sRGB display values in square pixels if not given.
    """

    def __init__(
        self, path: str | os.PathLike[str], size: tuple[int, int], fps: float | Fraction, *,
        quality: str = "high", sound: Sound | None = None, comment: str = "",
        codec: str | None = None, bits: int | None = None, alpha: bool = False,
        tags: Tags | None = None,
    ) -> None:  # fmt: skip
        require_library()
        self.path = Path(path)
        suffix = self.path.suffix.lower()
        if suffix not in VIDEO_EXTENSIONS:
            raise ValueError(
                f"{self.path}: videos are written as {', '.join(VIDEO_EXTENSIONS)}, not {suffix!r}"
            )
        choice("quality", quality, QUALITIES)
        self.size, self.fps = checked_size(size, 16384), frame_rate(fps)
        encoder = encoder_for(suffix, quality, self.size, codec, bits, alpha=alpha)
        if tags is not None and not isinstance(tags, Tags):
            raise TypeError(f"tags must be Tags, got {type(tags).__name__}")
        self.plan = Plan(
            self.path, self.size, self.fps, encoder, encoder_threads(),
            _settled(tags or Tags(), encoder), sound, comment, 4 if alpha else 3,
        )  # fmt: skip
        if suffix == ".mkv" and self.plan.tags.aspect != 1:
            raise ValueError(f"{self.path}: a .mkv does not keep pixels that are not square")
        self.count = 0
        self._files: ExitStack | None = None
        self._film: Remote | None = None

    @property
    def bits(self) -> int:
        return self.plan.codec.bits

    def __enter__(self) -> VideoWriter:
        if self._files is not None:
            raise RuntimeError(f"{self.path}: a VideoWriter writes one video only")
        self._owner = os.getpid()
        with ExitStack() as files:
            self._temporary = files.enter_context(replacing(self.path))
            film = Remote(self.path, "written", Film, self.plan)
            files.callback(film.close)
            film.call("open", self._temporary)
            self._film, self._files = film, files.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:  # fmt: skip
        if os.getpid() != self._owner or self._files is None:
            return  # A forked child leaves the block: the file is its parent's.
        film, self._film = self._film, None
        assert film is not None
        with self._files:
            if error is not None:
                raise error
            # What the encoder still holds; then the file is closed, and what is in it counted.
            film.call("join_own")
            film.call("finish", self.count)

    def write(self, frame: npt.ArrayLike) -> None:
        """Append a frame, (H, W, 3), or (H, W, 4) with alpha, uint8 or uint16, display values."""
        if self._film is None:
            raise RuntimeError(f"{self.path}: frames are written inside a 'with' block")
        array = self.plan.expect_frame(frame)
        if self.count and self.count % GROUP == 0:
            self._film.call("join_own")
        # An encoder may hold frames back for long: a file that is being written is not old.
        os.utime(self._temporary)
        self._film.call("encode", array)
        self.count += 1


_CURVES = {14: 1, 15: 1}  # BT.2020 has BT.709's curve, and ProRes knows one name of it.


def _settled(tags: Tags, codec: Encoder) -> Tags:
    """Return a film's tags, with BT.709 where there is none, or sRGB where RGB is stored."""

    def said(value: int, usual: int) -> int:
        return usual if value in (0, UNSPECIFIED) else value

    matrix = 0 if codec.rgb else said(tags.matrix, 1)
    if not codec.rgb and (matrix not in MATRICES or codec.name == "dnxhd"):
        # DNxHR's frames say BT.709 whatever they were turned by.
        matrix = 1
    transfer = said(tags.transfer, 13 if codec.rgb else 1)
    if codec.name == "prores_ks":
        transfer = _CURVES.get(transfer, transfer)
    return replace(
        tags,
        primaries=said(tags.primaries, 1),
        transfer=transfer,
        matrix=matrix,
        full=codec.rgb or tags.full,
    )
