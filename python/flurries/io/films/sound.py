"""The sound of a film, cut to some of its frames: copied where the new file can hold it."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from typing import Any

from flurries.io.files import plain_file
from flurries.io.films.reader import has_sound, open_video

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


class SoundTrack:
    """Carries a film's first sound track into a container that is being written."""

    def __init__(self, sound: Sound, container: Any, suffix: str) -> None:
        self._source, picture = open_video(plain_file(sound.path))
        if not has_sound(self._source):
            raise ValueError(f"{sound.path}: the film has no sound that can be read")
        self._container = container
        stream = self._source.streams.audio[0]
        self._from = sound.start
        if picture.start_time is not None:
            self._from += picture.start_time * picture.time_base
        self._to = self._from + sound.length
        kept, encoder = _HOLDS[suffix]
        if stream.codec_context.name in kept:
            self._stream = container.add_stream_from_template(stream)
            self._packets = self._copied(stream)
        else:
            rate = 48000 if encoder == "libopus" else stream.codec_context.sample_rate
            self._stream = container.add_stream(encoder, rate=rate)
            layout = stream.codec_context.layout
            # Files that only count their channels have no name for them.
            self._stream.codec_context.layout = _LAYOUTS.get(layout.nb_channels, layout.name)
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
            packet.pts -= round(self._from / packet.time_base)
            packet.dts = packet.pts
            packet.stream = self._stream
            yield time - self._from, packet

    def _encoded(self, stream: Any) -> Iterator[tuple[Fraction, Any]]:
        for frame in self._cut(stream):
            for packet in self._stream.encode(frame):
                yield frame.pts * frame.time_base, packet
        for packet in self._stream.encode(None):
            yield self._to - self._from, packet

    def _cut(self, stream: Any) -> Iterator[Any]:
        """Yield frames as the encoder wants them, cut at the sample and numbered from 0."""
        from av.filter import Graph

        context, graph = self._stream.codec_context, Graph()
        begin, end = (round(1e6 * time) for time in (self._from, self._to))
        graph.link_nodes(
            graph.add_abuffer(template=stream),
            graph.add("aformat", f"{context.format.name}:{context.rate}:{context.layout.name}"),
            graph.add("atrim", f"start={begin}us:end={end}us"),
            graph.add("asetpts", "N/SR/TB"),
            graph.add("asetnsamples", f"{context.frame_size or 1024}:0"),
            graph.add("abuffersink"),
        ).configure()
        for frame in chain(self._decoded(stream), [None]):
            graph.push(frame)
            with suppress(BlockingIOError, EOFError):
                while True:
                    yield graph.pull()

    def _decoded(self, stream: Any) -> Iterator[Any]:
        import av

        for packet in self._source.demux(stream):
            if packet.pts is not None and packet.pts * packet.time_base >= self._to:
                break
            with suppress(av.FFmpegError):
                yield from packet.decode()
