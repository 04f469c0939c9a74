"""The command line says no in one sentence, and leaves nothing half done when it is stopped."""

import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from test_cli import PLATE, RENDER, Run, Scene, Snow, files, here, pixels, run


def mistakes() -> dict[str, tuple[list[str], str]]:
    """Each: the arguments, and a word that the one line must hold."""
    options = [
        ("--size", "size", ["0x0", "abc", "131073x4", "5", "-5x5"]),
        ("--amount", "amount", ["nan", "2", "-0.1", "x"]),
        ("--wind", "wind", ["nan,0,0", "1,2", "a,b,c", "1e999,0,0"]),
        ("--fly", "", ["0,nan,0", "1"]),
        ("--frames", "frames", ["one", "5--1-", "-3-", "1-5x0", "1-", ""]),
        ("--seed", "seed", [str(2**63), "1.5", "x"]), ("--fps", "fps", ["0", "nan", "-24"]),
        ("--threads", "", ["0", "257", "two"]), ("--foreground", "no.png", ["no.png"]),
        ("--flakes", "--flakes", ["3"]), ("--quality", "quality", ["best"]),
        ("--hide", "wants whole numbers like 3,12", ["1.7", "nan", "3,"]),
    ]  # fmt: skip
    patterns = ["plate.png/%d.png", "plate.png/a/%d.png", "%d/%d.png", "%s.png", "a%d%d.png", "a",
                "a/", "", "%d.xyz", "a\n%d.png", "plate.png", "%d.toml", "."]  # fmt: skip
    inputs = {
        "missing": ["no.png", "no.png"], "damaged": ["cut.png", "cut.png"],
        "no picture": ["text.png", "text.png"], "empty": ["empty.png", "empty.png"],
        "a folder": [".", "folder"], "unknown key": ["bad.toml", "line 2.*fpps.*fps"],
        "no scene": ["no.toml", "no.toml"], "bad TOML": ["worse.toml", "worse.toml"],
        "deep TOML": ["deep.toml", "deep.toml"], "no sequence": ["no.%d.png", "no.%d.png"],
    }  # fmt: skip
    every = {f"{o} {v}": ([*RENDER, o, v], word) for o, word, vs in options for v in vs}
    every["layers of PNG"] = ([*RENDER, "--layers"], "layers")
    every |= {f"to {p!r}": ([*RENDER[:-1], p, "--frames", "1"], "") for p in patterns}
    for name, (given, word) in inputs.items():
        every[name] = (["render", given, "--snow", "light", "-o", "out/%d.png"], word)
    plate = ["render", "plate.png", "-o", "a.png"]
    plan = ["plan", "plate.png"]
    every |= {
        "preset": ([*plate, "--snow", "hevy"], "hevy"),
        "no snow": (plate, "--snow"),
        "no output": (["render", "plate.png", "--snow", "light"], "output"),
        "bad command": (["rendr"], "'rendr'; did you mean 'render'?"),
        "near option": ([*RENDER, "--fames", "3"], "--frames"),
        "no mist": ([*plate, "--visibility", "30"], "--mist"),
        "near method": ([*RENDER, "--method", "tnet"], "mean 'tent'?"),
        "whose shutter": ([*plate, "--mist", "--shutter", "1"], "--shutter needs --snow"),
        "two cameras": ([*RENDER, "--camera", "a.csv", "--fly", "0,0,1"], "--camera and --fly"),
        "itself": ([*plate[:2], "--snow", "-o", "plate.png", "--overwrite"], "background itself"),
        "an angle": ([*RENDER, "--shutter", "180"], "shutter must be from 0 to 16"),
        "no depth": ([*RENDER, "--depth", "nope.exr"], "nope.exr"),
        "no camera": ([*RENDER, "--camera", "no.chan"], "no.chan: camera: No such file"),
        "near kind": (["plan", "kind.toml"], "line 3.*mean 'snow'?"),
        "old file": (["plan", "old.toml"], "old.toml.*format must be 3"),
        "two ways": ([*RENDER, "--severity", "3"], "severity"),
        "no such knob": ([*plan, "--mist", "--rate", "3"], "--rate.*--snow"),
        "which weather": (["plan", "scene.toml", "--severity", "3"], "--severity.*--rain"),
        "video rate": ([*RENDER[:-1], "a.mp4", "--frames", "1", "--fps", "5000"], "fps"),
        "view": (["view", "missing.toml", "--no-browser"], "missing.toml"),
    }
    return every


MISTAKES = mistakes()
BROKEN = {
    "text.png": "no picture at all", "empty.png": "", "bad.toml": "format = 3\nfpps = 25\n",
    "kind.toml": "format = 3\n[[effects]]\nkind = 'sonw'\n", "worse.toml": "size = [1,\n",
    "old.toml": "[[effects]]\nkind = 'snow'\n", "deep.toml": "size = " + "[" * 20000,
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES, ids=ascii)
def test_a_mistake_is_one_sentence(name: str, run: Run, here: Path):
    Path("cut.png").write_bytes(Path("plate.png").read_bytes()[:3000])
    for file, text in BROKEN.items():
        Path(file).write_text(text)
    before = sorted(here.rglob("*"))
    contents = files(here)
    arguments, word = MISTAKES[name]
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("flurries: ") and err.count("\n") == 1 and err.endswith("\n"), err
    assert "Traceback" not in err and len(err) < 600
    assert all(part in err for part in word.split(".*"))
    assert sorted(here.rglob("*")) == before, "something was left"
    assert files(here) == contents


def start(here: Path, *arguments: str, **more: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "flurries", *arguments],
        cwd=here, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more,
    )  # fmt: skip


def wait_for(count: int, folder: Path, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 60
    while len(list(folder.glob("[0-9]*"))) < count and time.monotonic() < end:
        assert process.poll() is None, process.communicate()
        time.sleep(0.002)


def test_ctrl_c_keeps_what_is_done_and_goes_on(here: Path):
    process = start(here, *RENDER, "--frames", "1-5000")
    wait_for(3, here / "out", process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert "Traceback" not in err and "stopped; what is finished stays" in err and out == ""
    done = sorted(p.name for p in (here / "out").glob("*.png"))
    assert not list((here / "out").glob(".*"))
    assert 3 <= len(done) < 5000 and done == [f"{n:04d}.png" for n in range(1, len(done) + 1)]
    last = len(done) + 2
    process = start(here, *RENDER, "--frames", f"1-{last}")
    _, err = process.communicate(timeout=60)
    assert f"2 frames rendered, {len(done)} were there already" in err
    scene = Scene(PLATE, effects=[Snow("light")], fps=30)
    for number in (1, len(done), last):
        assert np.array_equal(pixels(here / "out" / f"{number:04d}.png"), scene.render(number))


STOPPED = [("SIGINT", "mp4", 130), ("SIGTERM", "mov", 143), ("SIGHUP", "webm", 129),
           ("SIGKILL", "mkv", -9)]  # fmt: skip


@pytest.mark.parametrize(("name", "kind", "code"), STOPPED)
def test_a_stopped_film_goes_on(name: str, kind: str, code: int, here: Path):
    film, parts = here / "out" / f"film.{kind}", here / "out" / f"film.{kind}.parts"
    words = [*RENDER[:-1], str(film), "--frames", "1-144"]
    process = start(here, *words)
    end = time.monotonic() + 60
    while not (parts / "0000.npz").exists() and time.monotonic() < end:
        time.sleep(0.002)
    process.send_signal(getattr(signal, name))
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert name == "SIGKILL" or not list((here / "out").rglob(".*"))
    _, err = start(here, *words).communicate(timeout=60)
    rendered, kept = re.search(r"(\d+) frames rendered, (\d+) were there already", err).groups()
    assert int(kept) in range(48, 144, 48) and int(rendered) + int(kept) == 144
    assert sorted(entry.name for entry in film.parent.iterdir()) == [film.name, "flurries.jsonl"]
    Scene("plate.png", effects=[Snow("light")]).write(f"whole.{kind}", "1-144")
    data = film.read_bytes()
    assert Path(f"whole.{kind}").read_bytes() == data and str(here).encode() not in data
