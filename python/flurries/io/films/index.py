"""Opening a video, and where its frames are: an index made without decoding any of them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flurries.io.files import Budget

READABLE = (
    *(".mp4", ".m4v", ".mov", ".webm", ".mkv", ".avi"),
    *(".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".wmv"),
)

# A playlist or a concatenation script is text that makes the library open other files, or the
# network. Only real containers in real files are let in.
_CONTAINERS = "mov,matroska,avi,mpegts,mpeg,asf"

# Packets of these do not say when their frames are shown, or say it wrongly. Their frames are
# counted from the start, and going backwards starts over.
_TIMELESS = ("avi", "mpeg")

# Transport streams are searched by time stamps, and a damaged one leads astray.
_SEEKLESS = ("mpegts",)


# How pixel formats are converted: bicubic (4), chroma interpolated in full (0x2000), rounded
# exactly (0x40000), the same bits on every processor (0x80000), and in the calling thread.
SCALING: dict[str, Any] = {"interpolation": 4 | 0x2000 | 0x40000 | 0x80000, "threads": 1}


def require_library() -> None:
    """Refuse to go on without PyAV, which is an extra: pictures do without it."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise ImportError(
            "films need PyAV, which flurries' extra [video] brings: pip install 'flurries[video]', "
            f"or pip install av ({error})"
        ) from None


@dataclass(frozen=True)
class FrameIndex:
    """The places of the frames in a video."""

    times: Sequence[int]  # When each frame is shown.
    keys: Sequence[int]  # The frames that build on no other, ascending.
    order: Sequence[int]  # Each frame's place in the file.
    counted: bool = False  # Whether the file does not tell times.
    seekable: bool = True  # Whether the file can be entered at a key frame.

    def __post_init__(self) -> None:
        numbers = {time: number for number, time in enumerate(self.times)}
        object.__setattr__(self, "_numbers", numbers)
        reach, last = [0] * len(self.times), 0
        for number in sorted(range(len(self.times)), key=self.order.__getitem__):
            last = max(last, number)
            reach[number] = last
        object.__setattr__(self, "_reach", reach)

    def number_at(self, time: int | None) -> int | None:
        found: int | None = vars(self)["_numbers"].get(time)
        return found

    def key_of(self, number: int) -> int:
        return self.keys[bisect_right(self.keys, number) - 1]

    def reach_of(self, number: int) -> int:
        """Return the last frame of those that are decoded no later than this one."""
        reach: int = vars(self)["_reach"][number]
        return reach

    def builds_on(self, number: int, other: int) -> bool:
        """Return whether `other` is decoded between the key frame of a frame and the frame."""
        return self.order[self.key_of(number)] <= self.order[other] <= self.order[number]


def open_video(path: Path, budget: Budget | None = None) -> tuple[Any, Any]:
    require_library()
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
    if not container.streams.video:
        container.close()
        raise ValueError(f"{path}: the file holds no video")
    stream = container.streams.video[0]
    if stream.codec_context is None:
        container.close()
        raise OSError(f"{path}: the video is damaged, or of a codec that is not known")
    # One thread: threads of a decoder do not survive a fork, and a child that frees it hangs.
    stream.codec_context.thread_count = 1
    limits = Budget.of(budget)
    # Codecs have whole blocks of pixels.
    room = limits.pixels + limits.pixels // 8 + 2**16
    stream.codec_context.options = {"max_pixels": str(room)}
    try:
        if stream.codec_context.width and stream.codec_context.height:
            limits.admit(path, (stream.codec_context.width, stream.codec_context.height), 3)
    except OSError:
        container.close()
        raise
    return container, stream


def index_frames(path: Path, budget: Budget | None = None) -> FrameIndex:
    import av

    container, stream = open_video(path, budget)
    packets = []
    with closing(container):
        kind = container.format.name
        try:
            for packet in container.demux(stream):
                if packet.size and not packet.is_discard:
                    packets.append((packet.pts, packet.is_keyframe))
        except av.FFmpegError as error:
            raise OSError(f"{path}: the video is damaged: {error.strerror}") from error
    times = sorted(time for time, _ in packets if time is not None)
    if kind in _TIMELESS or len({*times}) < len(packets):
        numbers = range(_count_frames(path, budget))
        index = FrameIndex(numbers, [0], numbers, counted=True, seekable=False)
    else:
        # What comes before the first key frame builds on frames that were cut away.
        key_times = {time for time, is_key in packets if is_key} or {*times[:1]}
        times = [time for time in times if time >= min(key_times)]
        stored = {time: place for place, (time, _) in enumerate(packets)}
        index = FrameIndex(
            times,
            [number for number, time in enumerate(times) if time in key_times],
            [stored[time] for time in times],
            seekable=kind not in _SEEKLESS,
        )
    if not index.times:
        raise OSError(f"{path}: the video holds no frames")
    return index


def _count_frames(path: Path, budget: Budget | None) -> int:
    """Decode the whole video to count its frames, where nothing else tells their number."""
    import av

    container, stream = open_video(path, budget)
    count = 0
    with closing(container):
        for packet in container.demux(stream):
            try:
                count += len(packet.decode())
            except av.FFmpegError:
                continue
    return count
