"""Sequences that cannot be lost: several processes, kills, manifests, damaged plates, sound."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.cli import main
from flurries.io import VideoWriter, open_background, read_picture, read_video, write_picture
from flurries.io.films.sound import Sound, has_sound
from flurries.output import manifest
from flurries.output.claims import awaited, claimed
from flurries.output.mark import Mark

W, H = 66, 50
PLATE = np.random.default_rng(3).integers(0, 220, (H, W, 3)).astype(np.uint8)
SCENE = fl.Scene((96, 64), "#304050", effects=fl.TentSnow.preset("heavy", flakes=100))
PROGRAM = """
import sys
import flurries as fl
scene = fl.Scene((96, 64), "#304050", effects=fl.TentSnow.preset("heavy", flakes=100))
done = scene.write("out/%04d.png", sys.argv[1])
print(*done.written)
"""


def start(folder: Path, frames: str, program: str = PROGRAM) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", program, frames], cwd=folder, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={**os.environ, "FLURRIES_NUM_THREADS": "1"},
    )  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    found = {}
    for path in folder.iterdir():
        # Another process may take its claim away meanwhile.
        with contextlib.suppress(FileNotFoundError):
            found[path.name] = path.read_bytes()
    return found


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("whole")
    SCENE.write(folder / "%04d.png", "1-60")
    return contents(folder)


# Several processes -------------------------------------------------------------------------------


def test_processes_share_a_folder(tmp_path: Path, whole: dict[str, bytes]):
    (tmp_path / "out").mkdir()
    running = [start(tmp_path, "1-60") for _ in range(3)]
    made: list[int] = []
    for process in running:
        out, err = process.communicate(timeout=100)
        assert process.returncode == 0, err
        assert len(list((tmp_path / "out").glob("*.png"))) == 60, "each returns when all are there"
        made += map(int, out.split())
    assert sorted(made) == list(range(1, 61)), "each frame once"
    assert contents(tmp_path / "out") == whole


def test_a_process_that_stands_still_is_waited_for_and_one_that_dies_is_not(
    tmp_path: Path, whole: dict[str, bytes]
):
    (tmp_path / "out").mkdir()
    claim = claimed(tmp_path / "out" / "0002.png")
    assert claim is not None and claimed(tmp_path / "out" / "0002.png") is None
    process = start(tmp_path, "1-3")
    end = time.monotonic() + 60
    while not (tmp_path / "out" / "0003.png").exists() and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(0.2)
    assert process.poll() is None and not (tmp_path / "out" / "0002.png").exists()
    claim.release()
    assert process.communicate(timeout=60)[0].split() == ["1", "2", "3"]
    # The system frees what a killed process held.
    holder = subprocess.Popen(
        [sys.executable, "-c", "import sys, time; from pathlib import Path\n"
         "from flurries.output.claims import claimed\n"
         "held = claimed(Path('out/0004.png')); print(held, flush=True); time.sleep(60)"],
        cwd=tmp_path, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert holder.stdout is not None and holder.stdout.readline()
    assert claimed(tmp_path / "out" / "0004.png") is None
    holder.kill()
    holder.communicate()
    assert start(tmp_path, "1-4").communicate(timeout=60)[0].split() == ["4"]
    assert all(whole[n] == data for n, data in contents(tmp_path / "out").items() if "png" in n)
    assert not list((tmp_path / "out").glob(".*"))


def test_threads_claim_like_processes(tmp_path: Path):
    target, held = tmp_path / "a.png", []
    ready = threading.Barrier(8)

    def work() -> None:
        ready.wait()
        for _ in range(20):
            claim = awaited(target)
            held.append(1)
            assert sum(held) == 1, "two at once"
            held.append(-1)
            claim.release()

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60)
    assert len(held) == 320 and not list(tmp_path.iterdir())


def test_the_two_modes_are_never_mixed(tmp_path: Path):
    SCENE.write(tmp_path / "%d.png", "1-2")
    fl.set_reproducible(True)
    try:
        with pytest.raises(ValueError, match="something else"):
            SCENE.write(tmp_path / "%d.png", "1-3")
        assert SCENE.write(tmp_path / "%d.png", "1-3", overwrite=True).written == [1, 2, 3]
        assert SCENE.write(tmp_path / "%d.png", "1-3").kept == [1, 2, 3]
    finally:
        fl.set_reproducible(False)


def test_without_the_mark_scenes_would_be_mixed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The control: frames that do not say whose they are."""
    monkeypatch.setattr(Mark, "settled", lambda self, path, said: {} if path.exists() else None)
    other = SCENE.replace(seed=9)
    SCENE.write(tmp_path / "%d.png", "1-2")
    assert other.write(tmp_path / "%d.png", "1-3").kept == [1, 2]
    assert not np.array_equal(read_picture(tmp_path / "1.png").pixels, other.render(1))


# The manifest ------------------------------------------------------------------------------------


def test_the_manifest_has_a_hash_of_each_frame(tmp_path: Path, capsys: Any):
    import hashlib

    SCENE.write(tmp_path / "%04d.png", "1-3")
    SCENE.write(tmp_path / "%04d.exr", "2-4x2")
    said = manifest.read(tmp_path)
    assert list(said) == ["0001.png", "0002.exr", "0002.png", "0003.png", "0004.exr"]
    for name, entry in said.items():
        data = (tmp_path / name).read_bytes()
        assert entry["sha256"] == hashlib.sha256(data).hexdigest() and entry["bytes"] == len(data)
        assert entry["frame"] == int(name[:4])
    assert manifest.check(tmp_path) == [] and main(["check", str(tmp_path)]) == 0
    (tmp_path / "0003.png").unlink()
    data = bytearray((tmp_path / "0004.exr").read_bytes())
    data[-1] ^= 1
    (tmp_path / "0004.exr").write_bytes(data)
    wrong = manifest.check(tmp_path)
    assert len(wrong) == 2 and "0003.png is missing" in wrong[0] and "changed" in wrong[1]
    capsys.readouterr()
    assert main(["check", str(tmp_path)]) == 3
    assert "0004.exr" in capsys.readouterr().err
    # Frames that nobody listed, as after a kill, are hashed when they are found.
    (tmp_path / manifest.NAME).unlink()
    SCENE.write(tmp_path / "%04d.png", "1-3")
    assert list(manifest.read(tmp_path)) == ["0001.png", "0002.png", "0003.png"]
    assert manifest.check(tmp_path) == []


@pytest.mark.parametrize("text", ["mine", "[]", '{"files": {}}', "\xff", "[" * 100_000])
def test_somebody_elses_file_stays(text: str, tmp_path: Path):
    (tmp_path / manifest.NAME).write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=r"flurries\.json"):
        SCENE.write(tmp_path / "%d.png", "1")
    assert [p.name for p in tmp_path.iterdir()] == [manifest.NAME]
    assert (tmp_path / manifest.NAME).read_text(encoding="latin-1") == text
    SCENE.write(tmp_path / "%d.png", "1", manifest=False)
    SCENE.write(tmp_path / "still.png", "1")
    with pytest.raises(FileNotFoundError):
        manifest.check(tmp_path.parent)


def test_a_damaged_list_of_ours_is_made_again(tmp_path: Path):
    SCENE.write(tmp_path / "%d.png", "1")
    (tmp_path / manifest.NAME).write_text(json.dumps({"flurries": "0", "files": [1]}))
    SCENE.write(tmp_path / "%d.png", "1")
    assert manifest.check(tmp_path) == [] and list(manifest.read(tmp_path)) == ["1.png"]


# Damaged backgrounds -----------------------------------------------------------------------------


@pytest.fixture
def damaged(tmp_path: Path) -> fl.Scene:
    """Five plates of which the second is missing and the fourth cut short."""
    for number in range(5):
        write_picture(tmp_path / f"plate.{number}.png", np.roll(PLATE, number, axis=1))
    (tmp_path / "plate.1.png").unlink()
    cut = tmp_path / "plate.3.png"
    cut.write_bytes(cut.read_bytes()[:3000])
    return fl.Scene(None, tmp_path / "plate.%d.png", effects=fl.TentSnow(flakes=50))


def test_it_stops_at_a_damaged_frame(damaged: fl.Scene, tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"of 0-4 the background lacks 1: .*plate\.%d"):
        damaged.write(tmp_path / "out" / "%d.png")
    # What is missing is known before anything is made; what is damaged, when it is read.
    assert not (tmp_path / "out").exists()
    with pytest.raises(OSError, match=r"plate\.3\.png"):
        damaged.write(tmp_path / "out" / "%d.png", "2-4")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["2.png", manifest.NAME]


def test_it_skips_damaged_frames(damaged: fl.Scene, tmp_path: Path, capsys: Any):
    done = damaged.write(tmp_path / "out" / "%d.png", damaged="skip")
    assert (done.written, done.skipped, done.held) == ([0, 2, 4], [1, 3], [])
    assert [p.name for p in done.files] == ["0.png", "2.png", "4.png"]
    assert damaged.write(tmp_path / "out" / "%d.png", damaged="skip").kept == [0, 2, 4]
    film = damaged.write(tmp_path / "film.mkv", damaged="skip")
    assert (film.written, film.skipped, len(list(read_video(film.files[0])))) == (
        [0, 2, 4],
        [1, 3],
        3,
    )
    command = ["render", str(tmp_path / "plate.%d.png"), "--snow", "light", "--quiet", "-o"]
    assert main([*command, str(tmp_path / "cli" / "%d.png"), "--damaged", "skip"]) == 3
    assert "2 skipped (1, 3)" in capsys.readouterr().err


def test_it_holds_the_last_good_frame(damaged: fl.Scene, tmp_path: Path):
    done = damaged.write(tmp_path / "out" / "%d.png", damaged="hold")
    assert (done.written, done.held, done.skipped) == ([0, 1, 2, 3, 4], [1, 3], [])
    for number, plate in ((1, 0), (3, 2), (4, 4)):
        want = damaged.replace(background=np.roll(PLATE, plate, axis=1)).render(number)
        assert np.array_equal(read_picture(tmp_path / "out" / f"{number}.png").pixels, want)


# Sound -------------------------------------------------------------------------------------------

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
    scene = fl.Scene(None, plate, effects=fl.TentSnow(flakes=20), fps=20.0)
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
    assert not has_sound(out)


@pytest.mark.parametrize("way", ["scene", "source", "file", "command", "command with a scene"])
def test_16_6_a_film_keeps_its_rate_and_its_sound(
    way: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    from flurries.cli import main

    monkeypatch.chdir(tmp_path)
    film_with_sound(tmp_path / "plate.mp4", "aac", frames=12)
    Path("scene.toml").write_text('background = "plate.mp4"\n[[effects]]\nkind = "snow"\n')
    if way == "command":
        assert main(["render", "plate.mp4", "--snow", "light", "-o", "out.mp4"]) == 0
    elif way == "command with a scene":
        assert main(["render", "scene.toml", "-o", "out.mp4"]) == 0
    else:
        plate = open_background("plate.mp4") if way == "source" else "plate.mp4"
        scene = fl.Scene.load("scene.toml") if way == "file" else fl.Scene(None, plate)
        assert scene.fps == 20.0
        assert scene.write("out.mp4").sound == "kept"
    written = open_background("out.mp4")
    assert (written.fps, written.count) == (20.0, 12)
    assert has_sound("out.mp4")


def test_16_6_a_rate_that_is_given_counts_and_30_where_there_is_none(tmp_path: Path):
    film_with_sound(tmp_path / "plate.mp4", "aac", frames=6)
    scene = fl.Scene(None, tmp_path / "plate.mp4", fps=25)
    assert scene.fps == 25.0
    assert "20 frames a second" in scene.write(tmp_path / "a.mp4").sound
    (tmp_path / "scene.toml").write_text('background = "plate.mp4"\nfps = 12\n')
    assert fl.Scene.load(tmp_path / "scene.toml").fps == 12.0
    assert fl.Scene((64, 48)).fps == fl.Scene(None, np.zeros((4, 5, 3))).fps == 30.0
    # A scene that was saved plays as it did.
    fl.Scene(None, tmp_path / "plate.mp4").save(tmp_path / "again.toml")
    assert fl.Scene.load(tmp_path / "again.toml").fps == 20.0


def test_sound_that_would_not_fit_is_left_out(tmp_path: Path):
    plate = tmp_path / "plate.mp4"
    film_with_sound(plate, "aac")
    scene = fl.Scene(None, plate, fps=20.0)
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("1-9x2", {}, "follow"),
        ("1-5", {"fps": 25.0}, "20 frames a second"),
        ("50-55", {"extend": "hold"}, "held or repeated"),
    ]
    for frames, change, why in cases:
        out = tmp_path / "a.mp4"
        done = scene.replace(**change).write(out, frames, quality="draft", overwrite=True)
        assert done.sound.startswith("left out") and why in done.sound
        assert not has_sound(tmp_path / "a.mp4")
    silent = fl.Scene((64, 48), "#102030")
    assert silent.write(tmp_path / "b.mp4", "1-3", quality="draft").sound == "none"
    gone = Sound(str(tmp_path / "b.mp4"), Fraction(0), Fraction(1))
    with pytest.raises(ValueError, match="no sound"):
        VideoWriter(tmp_path / "c.mp4", (64, 48), 20, sound=gone).__enter__()
    assert not list(tmp_path.glob("*c.mp4")) and not list(tmp_path.glob(".*"))


INTERRUPTED = """
import fcntl, os, sys
from pathlib import Path
from flurries.output import claims
place, step = sys.argv[1:]
module = fcntl if step == "flock" else os
real = getattr(module, step)
def interrupted(*a, **k):
    setattr(module, step, real)
    # What it returns is lost, as where Ctrl-C comes right behind it.
    real(*a, **k)
    raise KeyboardInterrupt
setattr(module, step, interrupted)
claims.claimed(Path(place) / "0001.png").release()
"""


@pytest.mark.parametrize("step", ["open", "flock", "fstat", "unlink", "close"])
def test_ctrl_c_at_any_step_of_a_claim_leaves_nothing(step: str, tmp_path: Path):
    command = [sys.executable, "-c", INTERRUPTED, str(tmp_path), step]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert "KeyboardInterrupt" in done.stderr and done.stderr.count("Traceback") == 1
    assert not list(tmp_path.iterdir())
    # The lock is gone too.
    claim = claimed(tmp_path / "0001.png")
    assert claim is not None
    claim.release()
