"""Writing video: H.264 for everyone, VP9 for the web, FFV1 where no bit is lost, ProRes to cut."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from flurries._contract import choice
from flurries.io.atomic import replacing
from flurries.io.films.codecs import QUALITIES, Encoder, encoder_for, encoder_threads, frame_rate
from flurries.io.films.index import (
    SCALING,
    check_structure,
    never_free_in_children,
    require_library,
)
from flurries.io.films.reader import UNSPECIFIED, Tags
from flurries.io.films.sound import Sound, SoundTrack
from flurries.io.pictures.fitting import checked_size
from flurries.io.sequences import VIDEO_EXTENSIONS


class VideoWriter:
    """Writes a video frame by frame; a context manager.

    .mp4 and .mov hold H.264, .webm holds VP9, both with colors at half resolution (yuv420p,
    BT.709), and .mkv holds FFV1, which loses nothing. The file appears under its name when the
    block is left without an exception, and not before. The same frames make the same bytes with the
    same number of threads (`flurries.settings`), with all numbers up to 4, and in the
    reproducible mode with any.

    H.264 and VP9 have even sides: the last column or row of an odd picture is repeated once.

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
        A part of another film's sound; copied where the new file can hold it as it is, else encoded
        as AAC, Opus (WebM) or FLAC (Matroska).
    comment : str
        A line that goes into the file's header.
    codec : str, optional
        "h264", "h265", "vp9", "ffv1", "prores-hq", "prores-4444" or "dnxhr"; the extension's own if
        not given.
    bits : int, optional
        Of a color: 8, or where the codec has them 10 or 16.
    alpha : bool
        Whether frames have it, straight; "prores-4444" alone holds it.
    tags : Tags, optional
        Colors, pixel aspect and time code; sRGB display values in square pixels if not given.

    Raises
    ------
    ValueError, TypeError
        If an argument or a frame is not as above, or no frame was written.
    OSError
        If the file cannot be written.
    ImportError
        Without PyAV.
    RuntimeError
        If a frame is written outside the ``with`` block.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        size: tuple[int, int],
        fps: float | Fraction,
        *,
        quality: str = "high",
        sound: Sound | None = None,
        comment: str = "",
        codec: str | None = None,
        bits: int | None = None,
        alpha: bool = False,
        tags: Tags | None = None,
    ) -> None:
        require_library()
        self.path = Path(path)
        suffix = self.path.suffix.lower()
        if suffix not in VIDEO_EXTENSIONS:
            raise ValueError(
                f"{self.path}: videos are written as {', '.join(VIDEO_EXTENSIONS)}, not {suffix!r}"
            )
        choice("quality", quality, QUALITIES)
        self.size = checked_size(size, 16384)
        self.fps = frame_rate(fps)
        self.count = 0
        self._codec = encoder_for(suffix, quality, self.size, codec, bits, alpha=alpha)
        self._channels = 4 if alpha else 3
        if tags is not None and not isinstance(tags, Tags):
            raise TypeError(f"tags must be Tags, got {type(tags).__name__}")
        self._tags = _settled(tags or Tags(), self._codec)
        if suffix == ".mkv" and self._tags.aspect != 1:
            raise ValueError(f"{self.path}: a .mkv does not keep pixels that are not square")
        self._files: ExitStack | None = None
        self._container: Any = None
        self._stream: Any = None
        self._sound = sound
        self._comment = comment
        self._track: SoundTrack | None = None

    @property
    def bits(self) -> int:
        """Bits of a color."""
        return self._codec.bits

    def __enter__(self) -> VideoWriter:
        if self._files is not None:
            raise RuntimeError(f"{self.path}: a VideoWriter writes one video only")
        never_free_in_children(self)
        self._owner = os.getpid()
        with ExitStack() as files:
            self._temporary = files.enter_context(replacing(self.path))
            files.callback(self._close)
            self._open()
            self._files = files.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if os.getpid() != self._owner or self._files is None:
            return  # A forked child leaves the block: the file is its parent's.
        with self._files:
            if error is not None:
                raise error
            self._finish()

    def write(self, frame: npt.ArrayLike) -> None:
        """Append a frame, (H, W, 3), or (H, W, 4) with alpha, uint8 or uint16, display values."""
        if self._container is None:
            raise RuntimeError(f"{self.path}: frames are written inside a 'with' block")
        array = np.asarray(frame)
        if array.dtype not in (np.uint8, np.uint16):
            raise TypeError(f"frame must be uint8 or uint16, got {array.dtype}")
        width, height = self.size
        wanted = (height, width, self._channels)
        if array.shape != wanted:
            raise ValueError(f"frame must be {wanted}, got {array.shape}")
        # An encoder may hold frames back for long: a file that is being written is not old.
        os.utime(self._temporary)
        with _told(self.path):
            self._encode(self._converted(array))

    def _encode(self, picture: Any) -> None:
        for packet in self._stream.encode(picture):
            self._container.mux(packet)
        if self._track is not None:
            self._track.write_up_to((self.count + 1) / self.fps)
        self.count += 1

    def _open(self) -> None:
        import av
        from av.video.reformatter import VideoReformatter

        width, height = self.size
        across, down = self._codec.halved
        with _told(self.path):
            self._container = av.open(
                str(self._temporary.absolute()), "w", container_options=self._codec.container
            )
            if self._comment:
                self._container.metadata["comment"] = self._comment
            stream = self._container.add_stream(
                self._codec.name, rate=self.fps, options=self._codec.options
            )
            stream.width, stream.height = width + width % across, height + height % down
            stream.pix_fmt = self._codec.pixels
            context = stream.codec_context
            context.thread_count = encoder_threads()
            tags = self._tags
            context.color_primaries = tags.primaries
            context.color_trc = tags.transfer
            context.colorspace = tags.matrix
            context.color_range = 2 if tags.full else 1
            if tags.aspect != 1:
                context.sample_aspect_ratio = tags.aspect
            if self._codec.tag is not None:
                context.codec_tag = self._codec.tag
            if tags.timecode is not None:
                stream.metadata["timecode"] = tags.timecode.text
            if self._sound is not None:
                self._track = SoundTrack(self._sound, self._container, self.path.suffix.lower())
        self._stream = stream
        self._reformatter = VideoReformatter()

    def _converted(self, array: npt.NDArray[np.uint8]) -> Any:
        from av import VideoFrame
        from av.video.reformatter import ColorRange, Colorspace

        pad_down = self._stream.height - array.shape[0]
        pad_right = self._stream.width - array.shape[1]
        if pad_down or pad_right:
            array = np.pad(array, ((0, pad_down), (0, pad_right), (0, 0)), mode="edge")
        kind = {(1, 3): "rgb24", (2, 3): "rgb48le", (1, 4): "rgba", (2, 4): "rgba64le"}
        format = kind[array.dtype.itemsize, array.shape[2]]
        # No copy: `array` outlives the frame, of which the reformatter makes another.
        image = VideoFrame.from_numpy_buffer(np.ascontiguousarray(array), format=format)
        wishes = dict(SCALING)
        if not self._codec.rgb:
            wishes["dst_colorspace"] = _MATRICES.get(self._tags.matrix, Colorspace.ITU709)
            wishes["dst_color_range"] = ColorRange.JPEG if self._tags.full else ColorRange.MPEG
        converted = self._reformatter.reformat(image, format=self._codec.pixels, **wishes)
        # ProRes says it in each frame.
        converted.color_primaries = self._tags.primaries
        converted.color_trc = self._tags.transfer
        converted.pts = self.count
        converted.time_base = 1 / self.fps
        return converted

    def _finish(self) -> None:
        """Write what the encoder still holds, close the file and count what is in it."""
        if self.count == 0:
            raise ValueError(f"{self.path}: a video needs at least one frame")
        with _told(self.path):
            for packet in self._stream.encode():
                self._container.mux(packet)
            if self._track is not None:
                self._track.finish()
            self._container.close()
        self._container = None
        try:
            check_structure(self._temporary)
        except OSError as error:
            raise OSError(f"{self.path}: does not read back as a whole video") from error
        with _told(self.path):
            _, found = _comment_and_count(self._temporary)
        if found != self.count:
            raise OSError(f"{self.path}: reads back with {found} frames instead of {self.count}")

    def _close(self) -> None:
        container, self._container = self._container, None
        with suppress(Exception):
            if container is not None:
                container.close()
        if self._track is not None:
            self._track.close()


# Matrices of ITU-T H.273 that pictures are turned by, as the video library counts them.
_CURVES = {14: 1, 15: 1}  # BT.2020 has BT.709's curve, and ProRes knows one name of it.
_MATRICES = {1: 1, 4: 4, 5: 5, 6: 5, 7: 7, 9: 9, 10: 9}


def _settled(tags: Tags, codec: Encoder) -> Tags:
    """Return a film's tags, with BT.709 where there is none, or sRGB where RGB is stored."""

    def said(value: int, usual: int) -> int:
        return usual if value in (0, UNSPECIFIED) else value

    matrix = 0 if codec.rgb else said(tags.matrix, 1)
    if not codec.rgb and (matrix not in _MATRICES or codec.name == "dnxhd"):
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


def comment_of(path: Path) -> tuple[str, int]:
    """Return the comment in a video's header and its number of frames; of a damaged one neither."""
    try:
        check_structure(path)
        return _comment_and_count(path)
    except (OSError, ValueError):
        return "", 0


def _comment_and_count(path: Path) -> tuple[str, int]:
    require_library()
    import av

    # Its header and packets say all: without this H.264 is decoded as it is opened, for 100 ms.
    with av.open(str(path.absolute()), options={"skip_frame": "all"}) as container:
        said = {key.lower(): text for key, text in container.metadata.items()}
        stream = container.streams.video[0]
        count = sum(1 for packet in container.demux(stream) if packet.size)
    return said.get("comment", ""), count


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn the video library's errors into OSErrors that name the file."""
    import av

    try:
        yield
    except av.FFmpegError as error:
        reason = error.strerror or "no reason given"
        raise OSError(f"{path}: the video cannot be written: {reason}") from error
