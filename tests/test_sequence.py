"""Scenes to files: what is in them, journals, damaged plates; no other scene is mixed in."""

import os
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flurries as fl
from flurries.cli import main
from flurries.io import read_picture, read_video, srgb_to_linear, write_picture
from flurries.io.stores import Store
from flurries.output.film import Frames
from flurries.output.journal import NAME, Journal, check
from flurries.scene.fingerprint import BITS, Settings
from stills import header_of
from test_nothing_wrong import contents

PLATE = np.random.default_rng(3).integers(0, 220, (50, 66, 3)).astype(np.uint8)
SCENE = fl.Scene("#304050", size=(96, 64), effects=fl.effects.TentSnow("heavy", flakes=100))


@pytest.mark.parametrize("ending", ["png", "tif", "exr"])
def test_a_sequence_holds_the_frames(ending: str, tmp_path: Path):
    options = {"bits": "float"} if ending == "exr" else {}
    files = [tmp_path / "new" / f"000{n}.{ending}" for n in (2, 4, 6)]
    done = SCENE.write(tmp_path / "new" / f"%04d.{ending}", "2-6x2", **options)
    assert (done.written, done.kept, done.files) == ([2, 4, 6], [], files)
    assert sorted(contents(tmp_path / "new")) == [file.name for file in files]
    for number, file in zip(done.written, files, strict=True):
        got, want = read_picture(file).pixels, SCENE.render(number)
        if ending == "exr":
            # More bits are made of the same levels in 16.
            deep = np.full((64, 96, 3), (0x3030, 0x4040, 0x5050), np.uint16)
            light = srgb_to_linear(SCENE.replace(background=deep).render(number) / 65535.0)
            assert np.abs(got - light).max() < 1e-6
        else:
            assert np.array_equal(got, want)


def test_a_film_is_not_its_own_background(tmp_path: Path):
    film = fl.Scene(PLATE, fps=24).write(tmp_path / "film.mkv", "1-2").files[0]
    before = film.read_bytes()
    with pytest.raises((ValueError, OSError), match=r"film\.mkv"):
        fl.Scene(film, effects=SCENE.effects).write(film)
    assert film.read_bytes() == before


def test_headers_say_which_frame_and_nothing_private(tmp_path: Path):
    SCENE.write(tmp_path / "%d.png", [12])
    found = header_of(tmp_path / "12.png")
    assert found["frame"] == "12" and found["version"] == fl.__version__
    assert len(found["scene"]) >= 16
    assert str(tmp_path) not in (tmp_path / "12.png").read_bytes().decode("latin-1")


def test_frames_that_were_not_named(tmp_path: Path):
    # Those of a sequence are in `test_shot_numbers.py`.
    still = fl.Scene("#102030", size=(8, 8), fps=1.5)
    assert still.write(tmp_path / "still" / "%d.png").written == [1, 2, 3, 4, 5]  # 3 s and a bit
    assert still.write(tmp_path / "one.png").written == [1]


def test_the_two_modes_are_never_mixed(tmp_path: Path):
    SCENE.write(tmp_path / "%d.png", "1-2")
    with fl.settings(reproducible=True):
        with pytest.raises(ValueError, match="of another scene"):
            SCENE.write(tmp_path / "%d.png", "1-3")
        assert SCENE.write(tmp_path / "%d.png", "1-3", overwrite=True).written == [1, 2, 3]
        assert SCENE.write(tmp_path / "%d.png", "1-3").kept == [1, 2, 3]


def test_the_journal_has_a_hash_of_each_frame(tmp_path: Path, capsys: Any):
    SCENE.write(tmp_path / "%04d.png", "1-3")
    SCENE.write(tmp_path / "%04d.exr", "2-4x2")
    journal = Journal(Store(), tmp_path)
    assert journal.names() == ["0001.png", "0002.exr", "0002.png", "0003.png", "0004.exr"]
    for name in journal.names():
        (entry,), data = journal.lines(name), (tmp_path / name).read_bytes()
        assert entry["sha256"] == sha256(data).hexdigest() and entry["bytes"] == len(data)
        assert entry["frame"] == int(name[:4]) and entry["bits"] == BITS
    assert check(tmp_path)[1] == [] and main(["check", str(tmp_path)]) == 0
    (tmp_path / "0003.png").unlink()
    data = bytearray((tmp_path / "0004.exr").read_bytes())
    data[-1] ^= 1
    (tmp_path / "0004.exr").write_bytes(data)
    wrong = check(tmp_path)[1]
    assert len(wrong) == 2 and "0003.png is missing" in wrong[0] and "changed" in wrong[1]
    capsys.readouterr()
    assert main(["check", str(tmp_path)]) == 3
    assert "0004.exr" in capsys.readouterr().err
    # What nobody has a line of is nobody's.
    (tmp_path / NAME).rename(tmp_path / "flurries.json")
    with pytest.raises(ValueError, match=r"0001\.png .* no journal .* flurries 0\.2 .*overwrite"):
        SCENE.write(tmp_path / "%04d.png", "1-3")
    assert SCENE.write(tmp_path / "%04d.png", "1-3", overwrite=True).written == [1, 2, 3]
    with pytest.raises(FileNotFoundError, match=r"no journal \(flurries\.jsonl\)"):
        check(tmp_path.parent)


@pytest.mark.parametrize("text", ["mine", "[]", '{"files": {}}', "\xff", "[" * 100_000])
def test_somebody_elses_file_stays(text: str, tmp_path: Path):
    (tmp_path / NAME).write_text(text, encoding="latin-1")
    with pytest.raises(ValueError, match=r"flurries\.jsonl is there already and is no journal"):
        SCENE.write(tmp_path / "%d.png", "1")
    assert [p.name for p in tmp_path.iterdir()] == [NAME]
    assert (tmp_path / NAME).read_text(encoding="latin-1") == text


def test_journals_of_many_are_one_and_lines_of_what_was_replaced_go(tmp_path: Path):
    """Each line is in some file at any time: two that join, a neighbour at work, a torn line."""
    for number, seed in ((1, 0), (2, 0), (1, 9)):
        SCENE.replace(seed=seed).write(tmp_path / "%d.png", f"{number}", overwrite=True)
    path = tmp_path / "1.png"
    with (tmp_path / NAME).open("ab") as file:
        file.write(b'{"file": "3.png", "sha256": "cut')
    one, other = Journal(Store(), tmp_path), Journal(Store(), tmp_path)
    assert [len(one.lines(name)) for name in one.names()] == [1, 1]
    for journal, name in ((one, "a"), (other, "b")):
        journal.append(journal.entry(tmp_path / name, path, {"frame": 1}))
    one.join()
    assert Journal(Store(), tmp_path).names() == ["1.png", "2.png", "a", "b"]
    assert len(list(tmp_path.glob("flurries*"))) == 2
    other.join()
    assert Journal(Store(), tmp_path).names() == ["1.png", "2.png", "a", "b"]
    assert [p.name for p in tmp_path.glob("flurries*")] == [NAME]
    assert (tmp_path / NAME).read_bytes().count(b"\n") == 4


def keyed(late: float, *, end: float = 60.0, low: float = 0.0) -> fl.Keys:
    return fl.Keys([(0, low), (20, 0.3), (40, 0.9), (end, late)])


def vectors(late: float, **more: float) -> fl.Keys:
    return fl.Keys([(frame, (0.2 * value, 0.0, 0.0)) for frame, value in keyed(late, **more).keys])


def way(**camera: Any) -> fl.Scene:
    path = fl.CameraPath(fl.Camera(110.0), **camera)
    return fl.Scene(size=(96, 64), camera=path, effects=[fl.Snow(), fl.Mist()], fps=24)


def weather(**snow: Any) -> fl.Scene:
    return fl.Scene(size=(96, 64), effects=fl.Snow(**snow), fps=24)


# Scenes by a late value, and the first of the frames 0, 19, 38, 40, 41, 55 that a change may reach.
LATE: dict[str, tuple[Any, int]] = {
    "amount": (lambda v: weather(amount=keyed(v)), 41),
    "color": (lambda v: weather(color=keyed(0.5, end=60 + 10 * v), far=9.0), 41),
    "lens": (lambda v: weather(haze=keyed(v)).replace(lens=fl.camera.Lens(keyed(v, low=3.0))), 41),
    "position": (lambda v: way(position=vectors(v)), 40),
    "velocity": (lambda v: way(velocity=vectors(v)), 40),
    "turning": (lambda v: way(orientation=vectors(v), velocity=(0.0, 0.0, 1.0)), 40),
    "places": (lambda v: way(position=np.full((61, 3), v) * (np.arange(61) > 42)[:, None]), 41),
    "zoom": (lambda v: way(focal=fl.Keys([(0, 99), (40, 140), (60, 110 + v)])), 40),
    # What decides on the whole film: all frames.
    "zoom out": (lambda v: way(focal=fl.Keys([(0, 99), (40, 140), (60, 9 + 9 * v)])), 0),
    "density": (lambda v: weather(density=fl.Keys([(0, 9), (40, 20), (60, 50 * v)])), 0),
    "a bend": (lambda v: way(position=vectors(v) if v < 0.5 else fl.Keys(vectors(v).keys[:2])), 0),
}


@pytest.mark.parametrize("name", LATE)
def test_a_late_key_counts_for_the_frames_that_it_changes(name: str):
    make, first = LATE[name]
    one, other = make(0.25), make(0.75)
    pair = Settings(one), Settings(other)
    for frame in (0, 19, 38, 40, 41, 55):
        before, after = (settings.common + settings.of(frame) for settings in pair)
        assert (before == after) == (frame < first), frame
        if frame < first:
            made = one.layers(frame), other.layers(frame)
            assert np.array_equal(*(each.image for each in made))
            for a, b in zip(*(each.layers.values() for each in made), strict=True):
                for field in ("rgba", "depth", "motion", "backward", "ids"):
                    planes = getattr(a, field), getattr(b, field)
                    assert planes[0] is None or np.array_equal(*planes, equal_nan=True), field
    # The control: the change is seen.
    assert not np.array_equal(one.layers(55).image, other.layers(55).image)


def test_only_frames_that_a_late_key_changes_are_refused(tmp_path: Path):
    old, new = (weather(amount=fl.Keys([(0, 0.2), (48, 0.6), (90, v)])) for v in (0.9, 0.8))
    assert old.write(tmp_path / "%d.png", "1,48,60").written == [1, 48, 60]
    with pytest.raises(ValueError, match=r"60\.png is there already and is of another scene"):
        new.write(tmp_path / "%d.png", "1,48,60")
    assert new.write(tmp_path / "%d.png", "1-48x47").kept == [1, 48]


def test_a_journal_that_is_joined_while_it_is_listed_is_seen(tmp_path: Path, monkeypatch: Any):
    SCENE.write(tmp_path / "1.png")
    scandir, part = os.scandir, tmp_path / f"flurries.{'0' * 24}.jsonl"

    def joining(folder: Path) -> list[Any]:
        part.touch()
        listed = list(scandir(folder))
        part.unlink()
        return listed

    monkeypatch.setattr(os, "scandir", joining)
    assert Journal(Store(), tmp_path).names() == ["1.png"]


@pytest.mark.parametrize(("name", "pattern"), [("2.png", "%d.png"), ("film.mkv", "film.mkv")])
def test_what_appears_while_a_frame_is_made_is_refused(
    name: str, pattern: str, tmp_path: Path, monkeypatch: Any
):
    make, theirs = Frames.make, tmp_path / name
    monkeypatch.setattr(Frames, "make", lambda *job: theirs.write_bytes(b"mine") and make(*job))
    with pytest.raises(ValueError, match=f"{name} is there already and no journal"):
        SCENE.write(tmp_path / pattern, "2-2")
    assert theirs.read_bytes() == b"mine"


@pytest.fixture
def damaged(tmp_path: Path) -> fl.Scene:
    """Five plates of which the second is missing and the fourth cut short."""
    for number in range(5):
        write_picture(tmp_path / f"plate.{number}.png", np.roll(PLATE, number, axis=1))
    (tmp_path / "plate.1.png").unlink()
    cut = tmp_path / "plate.3.png"
    cut.write_bytes(cut.read_bytes()[:3000])
    return fl.Scene(tmp_path / "plate.%d.png", effects=fl.effects.TentSnow(flakes=50))


def test_it_stops_at_a_damaged_frame(damaged: fl.Scene, tmp_path: Path, monkeypatch: Any):
    with pytest.raises(FileNotFoundError, match=r"of 0-4 the background lacks 1: .*plate\.%d"):
        damaged.write(tmp_path / "out" / "%d.png")
    # What is missing is known before anything is made; what is damaged, when it is read.
    assert not (tmp_path / "out").exists()
    with pytest.raises(OSError, match=r"plate\.3\.png"):
        damaged.write(tmp_path / "out" / "%d.png", "2-4")
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["2.png", NAME]
    # It is this that is told, whatever becomes of the journal.
    monkeypatch.setattr(Store, "join", lambda *_: (tmp_path / "none").read_bytes())
    with pytest.raises(OSError, match=r"plate\.3\.png"):
        damaged.write(tmp_path / "again" / "%d.png", "2-4")


def test_it_skips_damaged_frames(damaged: fl.Scene, tmp_path: Path, capsys: Any):
    done = damaged.write(tmp_path / "out" / "%d.png", damaged="skip")
    assert (done.written, done.skipped, done.held) == ([0, 2, 4], [1, 3], [])
    assert [p.name for p in done.files] == ["0.png", "2.png", "4.png"]
    assert damaged.write(tmp_path / "out" / "%d.png", damaged="skip").kept == [0, 2, 4]
    film = damaged.write(tmp_path / "film.mkv", damaged="skip")
    assert (film.written, film.skipped) == ([0, 2, 4], [1, 3])
    assert len(list(read_video(film.files[0]))) == 3
    command = ["render", str(tmp_path / "plate.%d.png"), "--snow", "light", "--quiet", "-o"]
    assert main([*command, str(tmp_path / "cli" / "%d.png"), "--damaged", "skip"]) == 3
    assert "2 skipped (1, 3)" in capsys.readouterr().err


def test_it_holds_the_last_good_frame(damaged: fl.Scene, tmp_path: Path):
    done = damaged.write(tmp_path / "out" / "%d.png", damaged="hold")
    assert (done.written, done.held, done.skipped) == ([0, 1, 2, 3, 4], [1, 3], [])
    for number, plate in ((1, 0), (3, 2), (4, 4)):
        want = damaged.replace(background=np.roll(PLATE, plate, axis=1)).render(number)
        assert np.array_equal(read_picture(tmp_path / "out" / f"{number}.png").pixels, want)
