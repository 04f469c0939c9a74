"""The sound of a film, cut to some of its frames: copied where the new file can hold it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from flurries.io.files import plain_file
from flurries.io.films.index import open_video

# What each kind of file holds of sound, and what it is encoded as otherwise.
_HOLDS: dict[str, tuple[tuple[str, ...], str]] = {
    ".mp4": (("aac", "mp3", "ac3", "eac3", "alac", "opus", "flac"), "aac"),
    ".mov": (("aac", "mp3", "ac3", "alac", "pcm_s16le", "pcm_s24le"), "aac"),
    ".webm": (("opus", "vorbis"), "libopus"),
    ".mkv": (("aac", "mp3", "ac3", "eac3", "alac", "opus", "vorbis", "flac", "pcm_s16le"), "flac"),
}

_LAYOUTS = {1: "mono", 2: "stereo", 6: "5.1", 8: "7.1"}


@dataclass(frozen=True)
class Sound:
    path: str  # The film.
    start: Fraction  # Seconds after the film's first picture.
    length: Fraction  # Seconds.


def has_sound(path: str | os.PathLike[str]) -> bool:
    container, _ = open_video(plain_file(path))
    try:
        return any(stream.codec_context is not None for stream in container.streams.audio)
    finally:
        container.close()


class SoundTrack:
    """Carries a film's first sound track into a container that is being written."""

    def __init__(self, sound: Sound, container: Any, suffix: str) -> None:
        if not has_sound(sound.path):
            raise ValueError(f"{sound.path}: the film has no sound that can be read")
        self._source, picture = open_video(plain_file(sound.path))
        self._container = container
        stream = self._source.streams.audio[0]
        first = Fraction(0)
        if picture.start_time is not None:
            first = picture.start_time * picture.time_base
        self._from = first + sound.start
        self._to = self._from + sound.length
        kept, encoder = _HOLDS[suffix]
        self._copies = stream.codec_context.name in kept
        if self._copies:
            self._stream = container.add_stream_from_template(stream)
            self._packets = self._copied(stream)
        else:
            rate = 48000 if encoder == "libopus" else stream.codec_context.sample_rate
            self._stream = container.add_stream(encoder, rate=rate)
            channels = stream.codec_context.layout.nb_channels
            # Files that only count their channels have no name for them.
            named = _LAYOUTS.get(channels, stream.codec_context.layout.name)
            self._stream.codec_context.layout = named
            self._stream.codec_context.thread_count = 1
            self._packets = self._encoded(stream)
        self._next = next(self._packets, None)

    def write_up_to(self, seconds: Fraction) -> None:
        """Write what is heard before a time of the new film."""
        while self._next is not None and self._next[0] < seconds:
            self._container.mux(self._next[1])
            self._next = next(self._packets, None)

    def finish(self) -> None:
        self.write_up_to(self._to + 1)

    def close(self) -> None:
        with suppress(Exception):
            self._source.close()

    def _copied(self, stream: Any) -> Iterator[tuple[Fraction, Any]]:
        for packet in self._source.demux(stream):
            if packet.pts is None or not packet.size:
                continue
            time = packet.pts * packet.time_base
            if time >= self._to:
                return
            if time < self._from:
                continue
            shift = round(self._from / packet.time_base)
            packet.pts -= shift
            packet.dts = packet.pts
            packet.stream = self._stream
            yield time - self._from, packet

    def _encoded(self, stream: Any) -> Iterator[tuple[Fraction, Any]]:
        for number, frame in self._resampled(stream):
            time = Fraction(number, self._stream.codec_context.rate)
            for packet in self._stream.encode(frame):
                yield time, packet
        for packet in self._stream.encode(None):
            yield self._to - self._from, packet

    def _resampled(self, stream: Any) -> Iterator[tuple[int, Any]]:
        """Yield first samples and frames as the encoder wants them, cut at the sample."""
        from av.audio.fifo import AudioFifo
        from av.audio.resampler import AudioResampler

        context = self._stream.codec_context
        resampler = AudioResampler(format=context.format, layout=context.layout, rate=context.rate)
        total = round((self._to - self._from) * context.rate)
        fifo, begun, taken = AudioFifo(), False, 0
        size = context.frame_size or 1024
        for frame in self._decoded(stream):
            for part in resampler.resample(frame):
                if part.pts is None or part.time_base is None:
                    continue
                at = round((part.pts * part.time_base - self._from) * context.rate)
                if at + part.samples <= 0:
                    continue
                part.pts = None
                fifo.write(part)
                if not begun:
                    begun = True
                    if at < 0:
                        fifo.read(-at)
            while fifo.samples >= size and taken < total:
                yield taken, self._numbered(fifo.read(min(size, total - taken)), taken)
                taken += min(size, total - taken)
            if taken >= total:
                return
        left = min(fifo.samples, total - taken)
        if left > 0:
            yield taken, self._numbered(fifo.read(left), taken)

    def _numbered(self, frame: Any, sample: int) -> Any:
        frame.pts = sample
        frame.sample_rate = self._stream.codec_context.rate
        frame.time_base = Fraction(1, self._stream.codec_context.rate)
        return frame

    def _decoded(self, stream: Any) -> Iterator[Any]:
        import av

        for packet in self._source.demux(stream):
            if packet.pts is not None and packet.pts * packet.time_base >= self._to:
                break
            with suppress(av.FFmpegError):
                yield from packet.decode()
