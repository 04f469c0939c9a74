"""Writing video: H.264 for everyone, VP9 for the web, FFV1 where no bit is lost, ProRes to cut."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from flurries import _core
from flurries._contract import Array, ArrayLike, PathLike, choice
from flurries.io.atomic import replacing
from flurries.io.files import given
from flurries.io.films.codecs import QUALITIES, Encoder, encoder_for, frame_rate
from flurries.io.films.process import Remote
from flurries.io.films.reader import SCALING, UNSPECIFIED, Tags, check_structure, require_library
from flurries.io.films.sound import Sound, SoundTrack
from flurries.io.pictures.fitting import checked_size
from flurries.io.sequences import VIDEO_EXTENSIONS

GROUP = 48  # Frames of a group, which builds on no other: what a stopped film loses at most.

# Threads of an encoder, at least and at most. x264's result depends on their number a little:
# machines with no more cores than the least make the same bytes; in the reproducible mode all do.
_THREADS = 4, 16

_GLOBAL_HEADER = 1 << 22

# Matrices of ITU-T H.273 that pictures are turned by, as the video library counts them.
_MATRICES = {1: 1, 4: 4, 5: 5, 6: 5, 7: 7, 9: 9, 10: 9}

_CURVES = {14: 1, 15: 1}  # BT.2020 has BT.709's curve, and ProRes knows one name of it.

# How an array is called, by the bytes of a number and the channels.
_ARRAYS = {(1, 3): "rgb24", (2, 3): "rgb48le", (1, 4): "rgba", (2, 4): "rgba64le"}


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


class VideoWriter:
    """Writes a video frame by frame; it appears where the block is left without an exception."""

    def __init__(
        self, path: PathLike, size: tuple[int, int], fps: float | Fraction, *,
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
        self.bits = encoder.bits
        most = _THREADS[0] if _core.reproducible() else _THREADS[1]
        self.plan = Plan(
            self.path, self.size, self.fps, encoder, min(max(_core.threads(), _THREADS[0]), most),
            _completed(given("tags", tags, Tags), encoder), sound, comment, 4 if alpha else 3,
        )  # fmt: skip
        if suffix == ".mkv" and self.plan.tags.aspect != 1:
            raise ValueError(f"{self.path}: a .mkv does not keep pixels that are not square")
        self.count = 0
        self._files: ExitStack | None = None
        self._film: Remote | None = None

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

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
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

    def write(self, frame: ArrayLike) -> None:
        """Append a frame, (H, W, 3), or (H, W, 4) with alpha, uint8 or uint16, display values."""
        if self._film is None:
            raise RuntimeError(f"{self.path}: frames are written inside a 'with' block")
        array = np.asarray(frame)
        if array.dtype not in (np.uint8, np.uint16):
            raise TypeError(f"frame must be uint8 or uint16, got {array.dtype}")
        wanted = (self.size[1], self.size[0], self.plan.channels)
        if array.shape != wanted:
            raise ValueError(f"frame must be {wanted}, got {array.shape}")
        if self.count and self.count % GROUP == 0:
            self._film.call("join_own")
        # An encoder may hold frames back for long: a file that is being written is not old.
        os.utime(self._temporary)
        self._film.call("encode", array)
        self.count += 1


def _completed(tags: Tags, codec: Encoder) -> Tags:
    """Return a film's tags, with BT.709 where there is none, or sRGB where RGB is stored."""

    def said(value: int, usual: int) -> int:
        return usual if value in (0, UNSPECIFIED) else value

    matrix = 0 if codec.rgb else said(tags.matrix, 1)
    if not codec.rgb and (matrix not in _MATRICES or codec.name == "dnxhd"):
        # DNxHR's frames say BT.709 whatever they were turned by.
        matrix = 1
    curve = said(tags.transfer, 13 if codec.rgb else 1)
    curve = _CURVES.get(curve, curve) if codec.name == "prores_ks" else curve
    primaries, full = said(tags.primaries, 1), codec.rgb or tags.full
    return replace(tags, primaries=primaries, transfer=curve, matrix=matrix, full=full)


class Film:
    """Frames to groups of packets, and such groups to a file."""

    def __init__(self, plan: Plan) -> None:
        require_library()
        self._plan, self._count, self._joined = plan, 0, 0
        self._context: Any = None
        self._packets: list[Any] = []

    def encode(self, frame: Array) -> None:
        from av import CodecContext

        with self._told():
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
        with self._told():
            if self._context is not None:
                found = [*found, *self._context.encode(None)]
        self._context, self._packets, self._count = None, [], 0
        times = [(one.pts, one.dts, one.duration, one.is_keyframe, one.size) for one in found]
        data = np.frombuffer(b"".join(map(bytes, found)), np.uint8)
        return np.array(times, np.int64).reshape(-1, 5), data

    def open(self, temporary: Path) -> None:
        import av

        plan, self._temporary = self._plan, temporary
        with self._told():
            place, how = str(temporary.absolute()), plan.codec.container
            self._container = av.open(place, "w", container_options=how)
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
        from av import Packet

        first, place = self._joined, 0
        with self._told():
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
        import av

        path, temporary = self._plan.path, self._temporary
        if count == 0:
            raise ValueError(f"{path}: a video needs at least one frame")
        with self._told():
            if self._track is not None:
                self._track.finish()
            self._container.close()
        try:
            check_structure(temporary)
        except OSError as error:
            raise OSError(f"{path}: does not read back as a whole video") from error
        # Its header and packets say all: without this H.264 is decoded as it is opened, for 100 ms.
        wishes = {"skip_frame": "all"}
        with self._told(), av.open(str(temporary.absolute()), options=wishes) as container:
            found = sum(1 for packet in container.demux(container.streams.video[0]) if packet.size)
        if found != count:
            raise OSError(f"{path}: reads back with {found} frames instead of {count}")

    def _configure(self, context: Any) -> None:
        plan, tags = self._plan, self._plan.tags
        # Colors at half resolution want even sides.
        across, down = 1 + ("42" in plan.codec.pixels), 1 + ("420" in plan.codec.pixels)
        context.width = plan.size[0] + plan.size[0] % across
        context.height = plan.size[1] + plan.size[1] % down
        context.pix_fmt = plan.codec.pixels
        context.time_base = 1 / plan.fps
        context.thread_count, context.thread_type = plan.threads, plan.codec.threading
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
        # No copy: `array` outlives the frame, of which the reformatter makes another.
        kind = _ARRAYS[array.dtype.itemsize, array.shape[2]]
        image = VideoFrame.from_numpy_buffer(np.ascontiguousarray(array), format=kind)
        wishes = dict(SCALING)
        if not codec.rgb:
            wishes["dst_colorspace"] = _MATRICES.get(tags.matrix, Colorspace.ITU709)
            wishes["dst_color_range"] = ColorRange.JPEG if tags.full else ColorRange.MPEG
        converted = VideoReformatter().reformat(image, format=codec.pixels, **wishes)
        # ProRes says it in each frame.
        converted.color_primaries, converted.color_trc = tags.primaries, tags.transfer
        converted.pts, converted.time_base = self._count, 1 / self._plan.fps
        return converted

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turn the video library's errors into OSErrors that name the file."""
        import av

        try:
            yield
        except av.FFmpegError as error:
            reason = error.strerror or "no reason given"
            raise OSError(f"{self._plan.path}: the video cannot be written: {reason}") from error
