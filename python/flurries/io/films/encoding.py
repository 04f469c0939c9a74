"""The encoding of a film in groups of frames, and the joining of groups: in the codecs' process."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flurries._contract import Array
from flurries.io.films.codecs import Encoder
from flurries.io.films.index import SCALING, check_structure, require_library
from flurries.io.films.reader import Tags
from flurries.io.films.sound import Sound, SoundTrack

# Frames of a group, which builds on no other: what a stopped film loses at most.
GROUP = 48

_GLOBAL_HEADER = 1 << 22

# Matrices of ITU-T H.273 that pictures are turned by, as the video library counts them.
MATRICES = {1: 1, 4: 4, 5: 5, 6: 5, 7: 7, 9: 9, 10: 9}


@dataclass(frozen=True)
class Plan:
    """A film that is written: everything but its frames."""

    path: Path
    size: tuple[int, int]
    fps: Fraction
    codec: Encoder
    threads: int
    tags: Tags
    sound: Sound | None = None
    comment: str = ""
    channels: int = 3

    def expect_frame(self, frame: ArrayLike) -> Array:
        array = np.asarray(frame)
        if array.dtype not in (np.uint8, np.uint16):
            raise TypeError(f"frame must be uint8 or uint16, got {array.dtype}")
        wanted = (self.size[1], self.size[0], self.channels)
        if array.shape != wanted:
            raise ValueError(f"frame must be {wanted}, got {array.shape}")
        return array

    def groups(self, numbers: list[int]) -> list[list[int]]:
        """Return frames in the groups that are encoded alone."""
        return [numbers[first : first + GROUP] for first in range(0, len(numbers), GROUP)]


class Film:
    """Frames to groups of packets, and such groups to a file."""

    def __init__(self, plan: Plan) -> None:
        require_library()
        self._plan, self._count, self._joined = plan, 0, 0
        self._context: Any = None
        self._packets: list[Any] = []

    def encode(self, frame: Array) -> None:
        from av import CodecContext

        with _told(self._plan.path):
            if self._context is None:
                self._context = CodecContext.create(self._plan.codec.name, "w")
                self._context.options = dict(self._plan.codec.options)
                self._context.framerate = self._plan.fps
                self._context.flags |= _GLOBAL_HEADER
                self._configure(self._context)
            self._packets += self._context.encode(self._converted(frame))
        self._count += 1

    def end_group(self) -> tuple[Array, Array]:
        """Return the packets since the last group as `join` takes them."""
        found = self._packets
        with _told(self._plan.path):
            if self._context is not None:
                found = [*found, *self._context.encode(None)]
        self._context, self._packets, self._count = None, [], 0
        times = [(one.pts, one.dts, one.duration, one.is_keyframe, one.size) for one in found]
        data = np.frombuffer(b"".join(map(bytes, found)), np.uint8)
        return np.array(times, np.int64).reshape(-1, 5), data

    def open(self, temporary: Path) -> None:
        import av

        plan, self._temporary = self._plan, temporary
        with _told(plan.path):
            self._container = av.open(
                str(temporary.absolute()), "w", container_options=plan.codec.container
            )
            if plan.comment:
                self._container.metadata["comment"] = plan.comment
            # Its encoder tells the file what it holds, and encodes nothing.
            self._stream = self._container.add_stream(
                plan.codec.name, rate=plan.fps, options=dict(plan.codec.options)
            )
            self._configure(self._stream.codec_context)
            if plan.codec.tag is not None:
                self._stream.codec_context.codec_tag = plan.codec.tag
            if plan.tags.timecode is not None:
                self._stream.metadata["timecode"] = plan.tags.timecode.text
            self._track = None
            if plan.sound is not None:
                self._track = SoundTrack(plan.sound, self._container, plan.path.suffix.lower())

    def join(self, times: Array, data: Array) -> None:
        """Append a group."""
        from av import Packet

        first, place = self._joined, 0
        with _told(self._plan.path):
            for time, decoded, duration, is_key, size in times.tolist():
                packet = Packet(data[place : place + size].tobytes())
                packet.pts, packet.dts, packet.duration = first + time, first + decoded, duration
                packet.time_base, packet.is_keyframe = 1 / self._plan.fps, bool(is_key)
                packet.stream = self._stream
                self._container.mux(packet)
                place += size
                self._joined += 1
                if self._track is not None:
                    self._track.write_up_to(self._joined / self._plan.fps)

    def join_own(self) -> None:
        self.join(*self.end_group())

    def finish(self, count: int) -> None:
        """Close the file and make sure that it has so many frames."""
        path, temporary = self._plan.path, self._temporary
        if count == 0:
            raise ValueError(f"{path}: a video needs at least one frame")
        with _told(path):
            if self._track is not None:
                self._track.finish()
            self._container.close()
        try:
            check_structure(temporary)
        except OSError as error:
            raise OSError(f"{path}: does not read back as a whole video") from error
        with _told(path):
            found = count_packets(temporary)
        if found != count:
            raise OSError(f"{path}: reads back with {found} frames instead of {count}")

    def _configure(self, context: Any) -> None:
        plan, tags = self._plan, self._plan.tags
        across, down = plan.codec.halved
        context.width = plan.size[0] + plan.size[0] % across
        context.height = plan.size[1] + plan.size[1] % down
        context.pix_fmt = plan.codec.pixels
        context.time_base = 1 / plan.fps
        context.thread_count = plan.threads
        context.color_primaries, context.color_trc = tags.primaries, tags.transfer
        context.colorspace, context.color_range = tags.matrix, 2 if tags.full else 1
        if tags.aspect != 1:
            context.sample_aspect_ratio = tags.aspect

    def _converted(self, array: Array) -> Any:
        from av import VideoFrame
        from av.video.reformatter import ColorRange, Colorspace, VideoReformatter

        codec, tags = self._plan.codec, self._plan.tags
        pad_down = self._context.height - array.shape[0]
        pad_right = self._context.width - array.shape[1]
        if pad_down or pad_right:
            array = np.pad(array, ((0, pad_down), (0, pad_right), (0, 0)), mode="edge")
        kind = {(1, 3): "rgb24", (2, 3): "rgb48le", (1, 4): "rgba", (2, 4): "rgba64le"}
        format = kind[array.dtype.itemsize, array.shape[2]]
        # No copy: `array` outlives the frame, of which the reformatter makes another.
        image = VideoFrame.from_numpy_buffer(np.ascontiguousarray(array), format=format)
        wishes = dict(SCALING)
        if not codec.rgb:
            wishes["dst_colorspace"] = MATRICES.get(tags.matrix, Colorspace.ITU709)
            wishes["dst_color_range"] = ColorRange.JPEG if tags.full else ColorRange.MPEG
        converted = VideoReformatter().reformat(image, format=codec.pixels, **wishes)
        # ProRes says it in each frame.
        converted.color_primaries, converted.color_trc = tags.primaries, tags.transfer
        converted.pts, converted.time_base = self._count, 1 / self._plan.fps
        return converted


def count_packets(path: Path) -> int:
    import av

    # Its header and packets say all: without this H.264 is decoded as it is opened, for 100 ms.
    with av.open(str(path.absolute()), options={"skip_frame": "all"}) as container:
        return sum(1 for packet in container.demux(container.streams.video[0]) if packet.size)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn the video library's errors into OSErrors that name the file."""
    import av

    try:
        yield
    except av.FFmpegError as error:
        reason = error.strerror or "no reason given"
        raise OSError(f"{path}: the video cannot be written: {reason}") from error
