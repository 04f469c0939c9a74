"""Reading video: any frame by its number, the same pixels in whatever order."""

import struct
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from fractions import Fraction
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from flurries._ahead import Ahead
from flurries._contract import Array, naming
from flurries.io.files import Budget, given
from flurries.io.timecode import TimeCode

READABLE = (
    ".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv"
)  # fmt: skip

# A playlist or a concatenation script is text that makes the library open other files, or the
# network. Only real containers in real files are let in.
_CONTAINERS = "mov,matroska,avi,mpegts,mpeg,asf"

# Packets of these do not say when their frames are shown, or say it wrongly. Their frames are
# counted from the start, and going backwards starts over.
_TIMELESS = ("avi", "mpeg")

# Transport streams are searched by time stamps, and a damaged one leads astray.
_SEEKLESS = ("mpegts",)

# How pixel formats are converted: bicubic (4) or means over areas (32), chroma interpolated in full
# (0x2000), rounded exactly (0x40000), the same bits on every processor (0x80000), in this thread.
_BICUBIC, _AREA = (kind | 0x2000 | 0x40000 | 0x80000 for kind in (4, 32))
SCALING: dict[str, Any] = {"interpolation": _BICUBIC, "threads": 1}

UNSPECIFIED = 2


def require_library() -> None:
    """Refuse to go on without PyAV, which is an extra: pictures do without it."""
    if find_spec("av") is None:
        raise ImportError(
            "films need PyAV, which flurries' extra [video] brings: pip install 'flurries[video]', "
            "or pip install av"
        )


@dataclass(frozen=True)
class Tags:
    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED  # As ITU-T H.273 counts them; 2 is not said.
    full: bool = False  # Whether numbers go from 0 to the largest, not from 16 to 235.
    aspect: Fraction = Fraction(1)  # Width of a pixel over its height.
    bits: int = 8  # Of a color.
    timecode: TimeCode | None = None  # Of the first frame.
    interlaced: bool = False  # Whether a frame holds two moments.

    @staticmethod
    def of(container: Any, stream: Any, frame: Any) -> "Tags":
        context = stream.codec_context

        def said(name: str) -> int:
            own = int(getattr(frame, name))
            return int(getattr(context, name)) if own in (0, UNSPECIFIED) else own

        aspect = Fraction(stream.sample_aspect_ratio or context.sample_aspect_ratio or 1)
        rate = stream.average_rate or stream.guessed_rate
        said_of = [container.metadata, *(one.metadata for one in container.streams)]
        texts = [text for one in said_of for key, text in one.items() if key.lower() == "timecode"]
        codes = [TimeCode.of_text(text, Fraction(rate)) for text in texts if rate]
        return Tags(
            primaries=said("color_primaries"), transfer=said("color_trc"),
            matrix=UNSPECIFIED if frame.format.is_rgb else said("colorspace"),
            full=said("color_range") == 2 or frame.format.name.startswith("yuvj"),
            aspect=aspect if Fraction(1, 20) <= aspect <= 20 else Fraction(1), bits=_bits(frame),
            timecode=next((code for code in codes if code is not None), None),
            interlaced=bool(frame.interlaced_frame),
        )  # fmt: skip


def _bits(frame: Any) -> int:
    return max(int(part.bits) for part in frame.format.components)


def open_video(path: Path, budget: Budget | None = None, threads: int = 1) -> tuple[Any, Any]:
    import av

    options = {"protocol_whitelist": "file", "format_whitelist": _CONTAINERS}
    try:
        # An absolute path cannot be taken for a protocol.
        container = av.open(str(path.absolute()), container_options=options)
    except (av.FFmpegError, OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if path.suffix.lower() in READABLE:
            raise OSError(f"{path}: the video cannot be read: {reason}") from error
        raise ValueError(f"{path}: not a video of a known format") from error
    with ExitStack() as opened:
        opened.callback(container.close)
        if not container.streams.video:
            raise ValueError(f"{path}: the file holds no video")
        stream = container.streams.video[0]
        context, limits = stream.codec_context, given("budget", budget, Budget)
        if context is None:
            raise OSError(f"{path}: the video is damaged, or of a codec that is not known")
        # One thread: renderers have the others. With more, damage is told some frames late.
        context.thread_count, context.thread_type = threads, "FRAME"
        # Codecs have whole blocks of pixels.
        context.options = {"max_pixels": str(limits.pixels + limits.pixels // 8 + 2**16)}
        if context.width and context.height:
            limits.admit(path, (context.width, context.height), 3)
        opened.pop_all()
    return container, stream


def has_sound(container: Any) -> bool:
    return any(stream.codec_context is not None for stream in container.streams.audio)


class _Index:
    """The places of the frames in a video, found without decoding any where the file tells."""

    def __init__(self, path: Path, budget: Budget) -> None:
        import av

        container, stream = open_video(path, budget)
        with closing(container):
            kind = container.format.name
            try:
                packets = [
                    (packet.pts, packet.is_keyframe)
                    for packet in container.demux(stream)
                    if packet.size and not packet.is_discard
                ]
            except av.FFmpegError as error:
                raise OSError(f"{path}: the video is damaged: {error.strerror}") from error
        times = sorted(time for time, _ in packets if time is not None)
        # Whether the file does not tell times, and whether it can be entered at a key frame.
        self.counted = kind in _TIMELESS or len({*times}) < len(packets)
        self.seekable = not self.counted and kind not in _SEEKLESS
        # When each frame is shown, those that build on no other, and each one's place in the file.
        self.times: Sequence[int] = range(_count_frames(path, budget)) if self.counted else times
        self.keys: list[int] = [0]
        self.order: Sequence[int] = self.times
        if not self.counted:
            # What comes before the first key frame builds on frames that were cut away.
            key_times = {time for time, is_key in packets if is_key} or {*times[:1]}
            self.times = times = [time for time in times if time >= min(key_times)]
            self.keys = [number for number, time in enumerate(times) if time in key_times]
            stored = {time: place for place, (time, _) in enumerate(packets)}
            self.order = [stored[time] for time in times]
        if not self.times:
            raise OSError(f"{path}: the video holds no frames")
        # The frame that is shown at each time.
        self.numbers: dict[int | None, int] = {time: n for n, time in enumerate(self.times)}
        # The last of the frames that are decoded no later than each frame.
        self.reach, last = [0] * len(self.times), 0
        for number in sorted(range(len(self.times)), key=self.order.__getitem__):
            self.reach[number] = last = max(last, number)

    def key_of(self, number: int) -> int:
        return self.keys[bisect_right(self.keys, number) - 1]

    def builds_on(self, number: int, other: int) -> bool:
        """Return whether `other` is decoded between the key frame of a frame and the frame."""
        return self.order[self.key_of(number)] <= self.order[other] <= self.order[number]


def _count_frames(path: Path, budget: Budget) -> int:
    """Decode the whole video to count its frames, where nothing else tells their number."""
    import av

    container, stream = open_video(path, budget)
    count = 0
    with closing(container):
        for packet in container.demux(stream):
            with suppress(av.FFmpegError):
                count += len(packet.decode())
    return count


class Decoder:
    """Decodes a video's frames, in the codecs' process."""

    def __init__(self, path: Path, budget: Budget) -> None:
        self.path, self._budget = path, budget
        self._index = index = _Index(path, budget)
        self._container, self._stream = open_video(path, budget)
        self._frames = Ahead(self._decode())
        # The frame that the decoder will yield next, and those that it yielded ahead of need.
        self._next = 0
        self._ready: dict[int, Any] = {}
        self._broken: set[int] = set()
        self._seeks, self._threads = index.seekable, 1
        self._size: tuple[int, int] | None = None
        self._tags = Tags()
        first = self.frame(0)
        self._size = (first.shape[1], first.shape[0])

    def facts(self) -> tuple[float | None, int, Any, Tags, bool]:
        """Return the rate, number and size of frames, the tags, and whether there is sound."""
        rate = self._stream.average_rate or self._stream.guessed_rate
        sound = has_sound(self._container)
        return float(rate) if rate else None, len(self._index.times), self._size, self._tags, sound

    def frame(self, number: int, scale: int = 1) -> Array:
        """Return frame `number`, from 0, (H, W, 3) uint8 or uint16, upright, scale times less."""
        key = self._index.key_of(number)
        if scale > 1 and self._threads == 1:
            self._threads = 2  # Who wants it small renders nothing meanwhile.
            self._go_to(0)
        if number not in self._ready and not key <= self._next <= number:
            self._go_to(key)
        # Damage shows when a frame is yielded. So all frames decoded before this one are awaited,
        # also those that are shown later, and frames do not depend on what was asked for before.
        overshot = self._read_to(self._index.reach[number], key)
        if overshot and self._seeks and key:
            # Some files seek to a later key frame than they were asked for: never seek in them.
            self._seeks = False
            self._go_to(key)
            self._read_to(self._index.reach[number], key)
        self._ready = {place: one for place, one in self._ready.items() if place >= number}
        found = self._ready.get(number)
        if found is None or any(self._index.builds_on(number, place) for place in self._broken):
            raise OSError(f"{self.path}: frame {number} of the video is damaged")
        if self._size is None:
            self._tags = Tags.of(self._container, self._stream, found)
        pixels = _to_rgb(found, scale)
        size = pixels.shape[1], pixels.shape[0]
        if self._size is not None and size != tuple(side // scale for side in self._size):
            raise OSError(f"{self.path}: frame {number} of the video has another size")
        return pixels

    def _go_to(self, key: int) -> None:
        """Make `key` or an earlier frame the next one to be decoded."""
        self._ready.clear()
        self._frames.close()
        if self._seeks and key:
            self._container.seek(self._index.times[key], stream=self._stream)
            self._next = key
        else:
            self._container.close()
            self._container, self._stream = open_video(self.path, self._budget, self._threads)
            self._next = 0
        self._frames = Ahead(self._decode())

    def _read_to(self, last: int, key: int) -> bool:
        """Decode up to frame `last`; return whether the decoder began after the frame `key`."""
        import av

        fresh = self._next == key
        while self._next <= last:
            frame = next(self._frames, None)
            if frame is None:
                self._next = len(self._index.times)
                return False
            if isinstance(frame, av.Packet):
                # Without a time, the frame that comes next is as near as can be told.
                at = self._index.numbers.get(frame.pts, self._next)
                self._broken.add(min(at, len(self._index.times) - 1))
                continue
            place = self._next if self._index.counted else self._index.numbers.get(frame.pts)
            if place is None:
                continue
            if fresh and place > key:
                return True
            fresh = False
            self._next = place + 1
            self._ready[place] = frame
            if frame.is_corrupt:
                self._broken.add(place)
        return False

    def _decode(self) -> Iterator[Any]:
        """Yield decoded frames from where the file stands, and packets that cannot be decoded."""
        import av

        with suppress(av.FFmpegError):
            for packet in self._container.demux(self._stream):
                try:
                    yield from packet.decode()
                except av.FFmpegError:
                    yield packet


def _to_rgb(frame: Any, scale: int) -> Array:
    from av.video.reformatter import Colorspace

    wishes = dict(SCALING)
    if scale > 1:
        wishes |= {"width": frame.width // scale, "height": frame.height // scale}
        wishes["interpolation"] = _AREA
    if frame.colorspace == UNSPECIFIED and not frame.format.is_rgb:
        # Unmarked video follows the convention of its size.
        wishes["src_colorspace"] = Colorspace.ITU709 if frame.height >= 720 else Colorspace.ITU601
    pixels = frame.to_ndarray(format="rgb48le" if _bits(frame) > 8 else "rgb24", **wishes)
    # The display matrix turns counterclockwise, as rot90 does.
    return np.ascontiguousarray(np.rot90(pixels, round(frame.rotation / 90)))


def check_structure(path: Path) -> None:
    """Raise OSError if a film is empty or ends before its own structure says that it should."""
    # Decoders stop early and call it a success; a copy that broke off is common.
    size, stated = path.stat().st_size, 0
    if size == 0:
        raise OSError(f"{path}: the file is empty")
    with path.open("rb") as stream:
        head = stream.read(12)
        with naming(f"{path}: the video is cut short or damaged", ValueError, then=OSError):
            if head[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
                stated = _end_of_boxes(stream, size)
            elif head.startswith(b"\x1a\x45\xdf\xa3"):
                stated = _end_of_matroska(stream)
            elif head.startswith(b"RIFF") and head[8:12] == b"AVI ":
                stated = 8 + struct.unpack("<I", head[4:8])[0]
    if stated > size:
        raise OSError(f"{path}: the video is cut short: {size} of {stated} bytes are there")


def _end_of_boxes(stream: BinaryIO, size: int) -> int:
    """Walk the outermost boxes of an MP4 or MOV file: each must end within the file."""
    position = 0
    while position < size:
        stream.seek(position)
        header = stream.read(16)
        length = int.from_bytes(header[:4], "big")
        if length == 0 and len(header) >= 8:
            return 0  # This box reaches to the end, wherever that is.
        if length == 1:
            length = int.from_bytes(header[8:], "big")
        if len(header) < 8 or length < 8:
            raise ValueError("a part of it has no length")
        position += length
    return position


def _end_of_matroska(stream: BinaryIO) -> int:
    """Return the end that the outermost element of a WebM or Matroska file states, 0 if none."""
    length, width = _matroska_length(stream, 4)
    position = 4 + width + length
    stream.seek(position)
    if stream.read(4) != b"\x18\x53\x80\x67":
        raise ValueError("it has no segment")
    length, width = _matroska_length(stream, position + 4)
    if length == 2 ** (7 * width) - 1:
        return 0  # It is not stated, as in live streams.
    return position + 4 + width + length


def _matroska_length(stream: BinaryIO, position: int) -> tuple[int, int]:
    """Return a length as Matroska writes it, and the bytes that it takes itself."""
    stream.seek(position)
    data = stream.read(8)
    width = 9 - data[0].bit_length() if data else 9
    if len(data) < width:
        raise ValueError("a part of it has no length")
    return int.from_bytes(data[:width], "big") & (2 ** (7 * width) - 1), width
