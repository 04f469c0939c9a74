"""The sound of a film goes with its frames."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.io import VideoWriter, open_background, read_video
from flurries.io.films.sound import Sound

RATE = 48000


# Of the film's sound: a tone that rises by 10 Hz with every frame, so that a shift is heard.
CODECS = [
    ("mp4", "aac", "mp4", True), ("mp4", "aac", "mkv", True), ("mkv", "pcm_s16le", "mkv", True),
    ("mkv", "pcm_s16le", "mp4", False), ("mp4", "aac", "webm", False),
    ("mkv", "flac", "webm", False),
]  # fmt: skip


def film_with_sound(path: Path, codec: str, frames: int = 40, fps: int = 20) -> None:
    import av

    time_of = np.arange(frames * RATE // fps) / RATE
    tone = 0.4 * np.sin(2 * np.pi * np.cumsum(400 + 10 * np.floor(time_of * fps)) / RATE)
    with av.open(str(path), "w") as container:
        picture = container.add_stream("libx264", rate=fps)
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        sound = container.add_stream(codec, rate=RATE)
        sound.codec_context.layout = "mono"
        for number in range(frames):
            image = np.full((48, 64, 3), 3 * number, np.uint8)
            for packet in picture.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
                container.mux(packet)
        data = (tone * 32767).astype(np.int16)[None]
        frame = av.AudioFrame.from_ndarray(data, format="s16", layout="mono")
        frame.sample_rate, frame.pts = RATE, 0
        resampler = av.AudioResampler(
            format=sound.codec_context.format, layout="mono", rate=RATE,
            frame_size=sound.codec_context.frame_size or 1024,
        )  # fmt: skip
        for part in [*resampler.resample(frame), *resampler.resample(None)]:
            for packet in sound.encode(part):
                container.mux(packet)
        for stream in (picture, sound):
            for packet in stream.encode(None):
                container.mux(packet)


def heard(path: Path) -> tuple[str, np.ndarray]:
    """The codec and the samples from the first picture on, with their real times."""
    import av

    with av.open(str(path)) as container:
        codec = container.streams.audio[0].codec_context.name
        resampler = av.AudioResampler(format="flt", layout="mono", rate=RATE)
        samples, end = np.zeros(4 * RATE), None
        for frame in container.decode(audio=0):
            for part in resampler.resample(frame):
                assert part.pts is not None and part.time_base is not None
                at = round(part.pts * part.time_base * RATE)
                values = part.to_ndarray()[0]
                # Matroska rounds times to milliseconds: what follows closely follows at once.
                at = end if end is not None and abs(end - at) < 100 else at
                end = at + len(values)
                samples[max(at, 0) : at + len(values)] = values[max(-at, 0) :]
    return codec, samples


@pytest.mark.parametrize("source, codec, target, copies", CODECS)
def test_the_sound_goes_with_its_frames(
    source: str, codec: str, target: str, copies: bool, tmp_path: Path
):
    plate, out = tmp_path / f"plate.{source}", tmp_path / f"out.{target}"
    film_with_sound(plate, codec)
    scene = fl.Scene(plate, effects=fl.effects.TentSnow(flakes=20), fps=20.0)
    done = scene.write(out, "10-29", quality="draft")
    assert done.sound == "kept" and len(list(read_video(out))) == 20
    kind, samples = heard(out)
    assert (kind == codec) == copies
    window = np.hanning(RATE // 10)
    for first in (2, 8, 15):
        part = samples[first * RATE // 20 :][: len(window)]
        spectrum = np.abs(np.fft.rfft(part * window, 1 << 17))
        pitch = spectrum.argmax() * RATE / (1 << 17)
        # Two frames from `first` on: the tones of frames 10 + first and the next.
        assert abs(pitch - (400 + 10 * (10 + first) + 5)) < 10, (first, pitch)
    assert np.abs(samples[int(1.1 * RATE) :]).max() < 0.05, "and ends with them"
    assert scene.write(out, "10-29", quality="draft", sound=False, overwrite=True).sound == "none"
    assert not open_background(out).sound


def test_16_6_a_rate_that_is_given_counts_and_30_where_there_is_none(tmp_path: Path):
    film_with_sound(tmp_path / "plate.mp4", "aac", frames=6)
    scene = fl.Scene(tmp_path / "plate.mp4", fps=25)
    assert scene.fps == 25.0
    assert "20 frames a second" in scene.write(tmp_path / "a.mp4").sound
    (tmp_path / "scene.toml").write_text('format = 3\nbackground = "plate.mp4"\nfps = 12\n')
    assert fl.open(tmp_path / "scene.toml").fps == 12.0
    assert fl.Scene(size=(64, 48)).fps == fl.Scene(np.zeros((4, 5, 3))).fps == 30.0
    # A scene that was saved plays as it did.
    fl.Scene(tmp_path / "plate.mp4").save(tmp_path / "again.toml")
    assert fl.open(tmp_path / "again.toml").fps == 20.0


def test_sound_that_would_not_fit_is_left_out(tmp_path: Path):
    plate = tmp_path / "plate.mp4"
    film_with_sound(plate, "aac")
    scene = fl.Scene(plate, fps=20.0)
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("1-9x2", {}, "follow"),
        ("1-5", {"fps": 25.0}, "20 frames a second"),
        ("50-55", {"extend": "hold"}, "held or repeated"),
    ]
    for frames, change, why in cases:
        out = tmp_path / "a.mp4"
        done = scene.replace(**change).write(out, frames, quality="draft", overwrite=True)
        assert done.sound.startswith("left out") and why in done.sound
        assert not open_background(tmp_path / "a.mp4").sound
    silent = fl.Scene("#102030", size=(64, 48))
    assert silent.write(tmp_path / "b.mp4", "1-3", quality="draft").sound == "none"
    gone = Sound(str(tmp_path / "b.mp4"), Fraction(0), Fraction(1))
    with pytest.raises(ValueError, match="no sound"):
        VideoWriter(tmp_path / "c.mp4", (64, 48), 20, sound=gone).__enter__()
    assert not list(tmp_path.glob("*c.mp4")) and not list(tmp_path.glob(".*"))
