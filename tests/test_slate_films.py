"""What a film says of itself goes through: time codes, tags, bits; so does its sound."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

import flurries as fl
from flurries import io
from flurries.io import VideoWriter, open_background, read_video
from flurries.io.films.reader import Tags
from flurries.io.films.sound import Sound
from flurries.io.timecode import TimeCode
from test_slate import SNOW, H, W


@pytest.mark.parametrize(("begun", "rate", "after", "text"), [
    ("00:00:59;29", Fraction(30000, 1001), 1, "00:01:00;02"),
    ("00:09:59;29", Fraction(30000, 1001), 1, "00:10:00;00"),
    # 29.97 frames a second for an hour are an hour but for 4 ms.
    ("00:00:00;00", Fraction(30000, 1001), 107892, "01:00:00;00"),
    ("23:59:59:23", Fraction(24), 1, "00:00:00:00"),
    ("01:02:03:04", Fraction(24), 0, "01:02:03:04"),
])  # fmt: skip
def test_time_codes_count_as_clocks_do(begun: str, rate: Fraction, after: int, text: str):
    code = TimeCode.of_text(begun, rate)
    assert code is not None and code.later(after).text == text
    assert TimeCode.of_text("noon", rate) is None
    if rate == 24:
        assert TimeCode.of_word(code.word, rate) == code
        assert TimeCode.of_word(0x01020304, rate).text == "01:02:03:04"
        assert TimeCode.of_word(0x0102030A, rate) is None


CODE = TimeCode.of_text("10:20:30:05", Fraction(24))
FILMS: dict[str, tuple[str, dict[str, Any], Tags]] = {
    "709": ("a.mp4", {}, Tags(primaries=1, transfer=1, matrix=1, timecode=CODE)),
    "601": ("a.mp4", {}, Tags(primaries=6, transfer=6, matrix=6)),
    "full range": ("a.mp4", {}, Tags(primaries=1, transfer=1, matrix=1, full=True)),
    "anamorphic": ("a.mov", {}, Tags(aspect=Fraction(2), timecode=CODE)),
    "ten bits": ("a.mp4", {"codec": "h265", "bits": 10}, Tags(primaries=9, transfer=14, matrix=9)),
    "ten bits h264": ("a.mp4", {"bits": 10}, Tags(primaries=9, transfer=14, matrix=9)),
    "prores": ("a.mov", {"codec": "prores-hq"}, Tags(primaries=9, transfer=1, matrix=9)),
    "vp9": ("a.webm", {}, Tags(primaries=1, transfer=1, matrix=1)),
    "ffv1 16": ("a.mkv", {"bits": 16}, Tags(primaries=9, transfer=13, timecode=CODE)),
}


def film(path: Path, tags: Tags, given: dict[str, Any]) -> None:
    # Twice as large as plates: H.265 has no room in less than 64 px.
    y, x = np.mgrid[: 2 * H, : 2 * W] / (2 * H)
    shade = np.stack([x * H / W, y, (x + y) * H / (H + W)], -1)
    with io.VideoWriter(path, (2 * W, 2 * H), 24, tags=tags, **given) as writer:
        for level in range(3):
            deep = (0.2 + 0.2 * level + 0.3 * shade) * (255 if writer.bits == 8 else 65535)
            writer.write(deep.astype(np.uint8 if writer.bits == 8 else np.uint16))


@pytest.mark.parametrize("name", FILMS)
def test_what_a_film_says_goes_through(name: str, tmp_path: Path):
    file, given, tags = FILMS[name]
    film(tmp_path / file, tags, given)
    codec = {"codec": given["codec"]} if "codec" in given else {}
    scene = fl.Scene(tmp_path / file, effects=SNOW)
    before = io.open_background(tmp_path / file).tags
    assert (before.primaries, before.full, before.aspect) == (
        tags.primaries if tags.primaries != 2 else 1, tags.full or file.endswith("mkv"), tags.aspect
    )  # fmt: skip
    out = tmp_path / f"out{Path(file).suffix}"
    scene.write(out, **codec)
    assert io.open_background(out).tags == before
    assert scene._backdrop.aspect == scene.camera.camera.aspect == float(tags.aspect)
    if tags.timecode is not None:
        scene.write(tmp_path / f"later{out.suffix}", "1-2", **codec)
        later = io.open_background(tmp_path / f"later{out.suffix}").tags.timecode
        assert later == tags.timecode.later(1)


def test_a_film_of_ten_bits_is_not_made_one_of_eight(tmp_path: Path):
    film(tmp_path / "ten.mp4", Tags(), {"bits": 10})
    scene = fl.Scene(tmp_path / "ten.mp4", effects=SNOW)
    assert scene.render(0).dtype == np.uint16
    with pytest.raises(ValueError, match=r"the film has 10 bits, the new one at most 8: bits="):
        scene.write(tmp_path / "out.webm")
    scene.write(tmp_path / "out.webm", bits=8)
    scene.write(tmp_path / "out.mp4")
    assert io.open_background(tmp_path / "out.mp4").tags.bits == 10


@pytest.mark.parametrize("transfer", [16, 18])
def test_hdr_is_refused(transfer: int, tmp_path: Path):
    film(tmp_path / "hdr.mp4", Tags(primaries=9, transfer=transfer, matrix=9), {"bits": 10})
    with pytest.raises(ValueError, match=r"is HDR \((PQ|HLG)\)"):
        fl.Scene(tmp_path / "hdr.mp4")


def test_interlaced_film_is_refused(tmp_path: Path):
    path = tmp_path / "fields.mp4"
    with av.open(str(path), "w") as made:
        stream = made.add_stream("libx264", rate=25, options={"x264-params": "tff=1"})
        stream.width, stream.height, stream.pix_fmt = 64, 64, "yuv420p"
        stream.codec_context.flags |= 0x40000  # AV_CODEC_FLAG_INTERLACED_DCT
        for level in range(3):
            frame = av.VideoFrame.from_ndarray(np.full((64, 64, 3), 40 * level, np.uint8), "rgb24")
            made.mux(stream.encode(frame))
        made.mux(stream.encode())
    for use in ({"background": path}, {"size": (64, 64), "foreground": path}):
        with pytest.raises(ValueError, match="is interlaced"):
            fl.Scene(**use)


def test_snow_alone_in_prores_4444(tmp_path: Path):
    scene = fl.Scene("#000000", size=(64, 48), effects=SNOW)
    scene.write(tmp_path / "snow.mov", "1-2", alone=True, codec="prores-4444")
    with av.open(str(tmp_path / "snow.mov")) as made:
        frame = next(made.decode(video=0))
        assert frame.format.name.startswith("yuva444p")
        rgba = frame.to_ndarray(format="rgba64le") / 65535.0
    truth = scene.layers(1)
    assert np.abs(rgba[..., 3] - truth.alpha).max() < 0.03
    with pytest.raises(ValueError, match="alone needs codec='prores-4444'"):
        scene.write(tmp_path / "b.mp4", "1-2", alone=True)


CODECS = {"h264": ("mp4", 8), "h265": ("mp4", 10), "prores-hq": ("mov", 10), "ffv1": ("mkv", 10)}


def pictures(path: Path) -> np.ndarray:
    film = io.open_background(path)
    return np.stack([film.frame(number).pixels for number in range(4)])


@pytest.mark.parametrize("codec", CODECS)
def test_a_film_at_amount_0_is_what_the_codec_makes_of_the_plate(codec: str, tmp_path: Path):
    ending, bits = CODECS[codec]
    tags = Tags(primaries=1, transfer=1, matrix=1)
    tall, wide = 96, 128
    rows, columns = np.mgrid[:tall, :wide] / 40.0
    plate, ours, again = (tmp_path / f"{name}.{ending}" for name in ("plate", "ours", "again"))
    with io.VideoWriter(plate, (wide, tall), 24, codec=codec, bits=bits, tags=tags) as film:
        for number in range(4):
            wave = np.stack([np.sin(k * rows + columns + 0.3 * number) for k in (1, 2, 3)], axis=2)
            levels = (0.5 + 0.4 * wave) * (255 if bits == 8 else 65535)
            film.write(levels.astype(np.uint8 if bits == 8 else np.uint16))
    none = [fl.Snow("heavy", amount=0.0)]
    fl.Scene(plate, effects=none).write(ours, codec=codec, bits=bits)
    before = pictures(plate)
    with io.VideoWriter(again, (wide, tall), 24, codec=codec, bits=bits, tags=tags) as film:
        for picture in before:
            film.write(picture)
    # The codec's own error, of the very pictures that the plate's film shows.
    lost = pictures(again).astype(float) - before
    np.testing.assert_array_equal(pictures(ours), pictures(again))
    assert np.abs(pictures(ours).astype(float) - before).max() <= np.abs(lost).max()


def test_a_picture_too_small_for_h265_is_refused(tmp_path: Path):
    """Its library wrote past its own memory there, and ended the process."""
    with pytest.raises(ValueError, match=r"codec h265 needs 64 px in width or height, got 48 x 48"):
        io.VideoWriter(tmp_path / "a.mp4", (48, 48), 24, codec="h265")


RATE = 48000


# Of the film's sound: a tone that rises by 10 Hz with every frame, so that a shift is heard.
SOUNDS = [
    ("mp4", "aac", "mp4", True), ("mp4", "aac", "mkv", True), ("mkv", "pcm_s16le", "mkv", True),
    ("mkv", "pcm_s16le", "mp4", False), ("mp4", "aac", "webm", False),
    ("mkv", "flac", "webm", False),
]  # fmt: skip


def film_with_sound(path: Path, codec: str, frames: int = 40, fps: int = 20) -> None:
    time_of = np.arange(frames * RATE // fps) / RATE
    tone = 0.4 * np.sin(2 * np.pi * np.cumsum(400 + 10 * np.floor(time_of * fps)) / RATE)
    with av.open(str(path), "w") as container:
        picture = container.add_stream("libx264", rate=fps)
        picture.width, picture.height, picture.pix_fmt = 64, 48, "yuv420p"
        sound = container.add_stream(codec, rate=RATE)
        sound.codec_context.layout = "mono"
        for number in range(frames):
            image = np.full((48, 64, 3), 3 * number, np.uint8)
            container.mux(picture.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
        data = (tone * 32767).astype(np.int16)
        for at in range(0, len(data), 1024):
            part = data[None, at : at + 1024]
            frame = av.AudioFrame.from_ndarray(part, format="s16", layout="mono")
            frame.sample_rate, frame.pts = RATE, at
            container.mux(sound.encode(frame))
        container.mux([*picture.encode(None), *sound.encode(None)])


def heard(path: Path) -> tuple[str, np.ndarray]:
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


@pytest.mark.parametrize("source, codec, target, copies", SOUNDS)
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
