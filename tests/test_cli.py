"""The command line: what it makes, how it says no, and what is left when it is stopped."""

from __future__ import annotations

import fcntl
import importlib
import os
import pty
import re
import select
import shlex
import signal
import struct
import subprocess
import sys
import termios
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import OpenImageIO as oiio
import pytest

import flurries as fl
from flurries.cli import main
from flurries.cli.main import COMMANDS
from flurries.cli.words import lines
from flurries.io import VideoWriter, open_background, read_picture, write_picture

CameraPath, Camera, Scene, Snow = fl.CameraPath, fl.camera.Camera, fl.Scene, fl.Snow
W, H = 96, 64
PLATE = np.random.default_rng(2).integers(0, 200, (H, W, 3)).astype(np.uint8)
MASK = np.zeros((H, W), np.uint8)
MASK[:, 48:] = 255
RENDER = ["render", "plate.png", "--snow", "light", "-o", "out/%04d.png"]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a plate, a mask and a scene."""
    monkeypatch.chdir(tmp_path)
    write_picture("plate.png", PLATE)
    write_picture("mask.png", MASK)
    write_picture("light.exr", (PLATE / 50.0).astype(np.float32))
    Path("scene.toml").write_text(
        "background = 'plate.png'\nfps = 25\nseed = 4\n[camera]\nfocal = 100\n"
        "[[effects]]\nkind = 'snow'\npreset = 'light'\nflakes = 100\n"
    )
    return tmp_path


@pytest.fixture
def run(here: Path, capfd: pytest.CaptureFixture[str], threads: Any) -> Run:
    """The command line in this process: exit code, stdout, stderr."""

    def call(*arguments: str) -> tuple[int, str, str]:
        capfd.readouterr()
        code = main(list(arguments))
        return (code, *capfd.readouterr())

    return call


def files(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, hidden ones too."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def pixels(path: str | Path) -> np.ndarray:
    return read_picture(path).pixels


# What it makes -----------------------------------------------------------------------------------


def test_a_picture_becomes_frames_and_again_only_what_is_missing(run: Run, here: Path):
    command = ["render", "plate.png", "--snow", "heavy", "-o", "frames/%04d.png", "--frames", "1-3"]
    code, out, err = run(*command)
    names = [f"frames/000{n}.png" for n in (1, 2, 3)]
    assert (code, out.splitlines()) == (0, names)
    assert "3 frames rendered" in err
    first = files(here / "frames")
    assert sorted(first) == ["0001.png", "0002.png", "0003.png", "flurries.json"]
    scene = Scene(None, PLATE, effects=[Snow.preset("heavy")])
    assert all(np.array_equal(pixels(n), scene.render(i)) for i, n in enumerate(names, 1))

    code, out, err = run(*command)
    assert (code, out.splitlines()) == (0, names), "data, as if it had made them"
    assert "0 frames rendered, 3 were there already" in err
    (here / "frames" / "0002.png").unlink()
    code, _, err = run(*command)
    assert code == 0 and "1 frame rendered, 2 were there already" in err
    assert files(here / "frames") == first

    other = ["light" if word == "heavy" else word for word in command]
    code, out, err = run(*other)
    assert (code, out) == (2, "")
    assert err.startswith("flurries: frames/0001.png") and err.count("\n") == 1
    assert files(here / "frames") == first
    assert run(*other, "--overwrite")[0] == 0
    assert all(first[n] != data for n, data in files(here / "frames").items())


LENS = Camera(1.2 * W)
OPTIONS: dict[str, tuple[list[str], dict[str, Any], dict[str, Any]]] = {
    # The options, what they mean for the scene, and for the snow.
    "nothing": ([], {}, {}),
    "seed": (["--seed", "-7"], {"seed": -7}, {}),
    "fps": (["--fps", "12.5"], {"fps": 12.5}, {}),
    "wind": (["--wind", "1,0.5,-2"], {}, {"wind": (1.0, 0.5, -2.0)}),
    "wind from the right": (["--wind", "-1.5,0,0"], {}, {"wind": (-1.5, 0.0, 0.0)}),
    "fly": (["--fly", "0,-0.5,3"], {"camera": CameraPath(LENS, velocity=(0, -0.5, 3))}, {}),
    "fly back": (["--fly=-1,0,-2"], {"camera": CameraPath(LENS, velocity=(-1, 0, -2))}, {}),
    "amount": (["--amount", "0.5"], {}, {"amount": 0.5}),
    "foreground": (["--foreground", "mask.png"], {"foreground": MASK}, {}),
    "linear": (["--linear"], {"space": "linear"}, {}),
    "quiet": (["--quiet"], {}, {}),
}  # fmt: skip


@pytest.mark.parametrize("name", OPTIONS)
def test_what_an_option_means(name: str, run: Run):
    options, of_scene, of_snow = OPTIONS[name]
    code, _, err = run(*RENDER, "--frames", "9", *options)
    assert code == 0, err
    scene = Scene(None, PLATE, effects=[Snow.preset("light", **of_snow)], **of_scene)
    assert np.array_equal(pixels("out/0009.png"), scene.render(9))
    plain = Scene(None, PLATE, effects=[Snow.preset("light")]).render(9)
    assert np.array_equal(scene.render(9), plain) is (name in ("nothing", "quiet"))


def test_size_and_threads(run: Run, here: Path):
    for count in ("1", "3"):
        command = [*RENDER, "--frames", "2", "--threads", count, "--size", "50x40", "--overwrite"]
        assert run(*command)[0] == 0
        assert fl.threads() == int(count)
        (here / "out" / "0002.png").rename(here / f"{count}.png")
    assert pixels("1.png").shape == (40, 50, 3)
    assert (here / "1.png").read_bytes() == (here / "3.png").read_bytes()
    want = Scene((50, 40), here / "plate.png", effects=[Snow.preset("light")]).render(2)
    assert np.array_equal(pixels("1.png"), want)


@pytest.mark.parametrize("ending", ["mp4", "webm", "mkv"])
def test_a_film(ending: str, run: Run, here: Path):
    code, out, _ = run(*RENDER[:-1], f"film.{ending}", "--frames", "1-4", "--fps", "10")
    assert (code, out) == (0, f"film.{ending}\n")
    film = open_background(here / f"film.{ending}")
    assert (film.count, film.fps, film.size) == (4, 10.0, (W, H))


@pytest.mark.parametrize("ending", ["png", "jpg", "exr"])
def test_a_still(ending: str, run: Run, here: Path):
    code, out, _ = run(*RENDER[:-1], f"still.{ending}", "--frames", "6")
    assert (code, out) == (0, f"still.{ending}\n")
    want = Scene(None, PLATE, effects=[Snow.preset("light")]).render(6)
    got = pixels(f"still.{ending}")
    if ending == "exr":
        assert got.dtype == np.float32 and 0.0 < got.max() <= 1.0
    else:
        assert np.abs(got.astype(int) - want).mean() <= (0 if ending == "png" else 8)


def test_an_exr(run: Run, here: Path):
    """What is in it is judged in `test_render.py`; here, that the options arrive."""
    command = ["render", "light.exr", "--snow", "heavy", "--frames", "3", "-o"]
    for name, options in (("a.exr", []), ("b.exr", ["--layers", "--float"])):
        assert run(*command, name, *options)[0] == 0
        spec = oiio.ImageInput.open(name).spec()
        assert str(spec.channelformat(0)) == ("float" if options else "half")
        assert ("snow.A" in spec.channelnames) == bool(options)


def test_a_scene_file(run: Run, here: Path):
    command = ["render", "scene.toml", "-o", "a/%d.png", "--frames", "1-7x3"]
    code, out, _ = run(*command)
    assert (code, out.split()) == (0, ["a/1.png", "a/4.png", "a/7.png"])
    scene = Scene.load("scene.toml")
    assert np.array_equal(pixels("a/4.png"), scene.render(4))
    assert scene.effects[0].flakes == 100

    assert run(*[w.replace("a/", "b/") for w in command], "--snow", "heavy", "--seed", "9")[0] == 0
    heavy = scene.replace(effects=[Snow.preset("heavy")], seed=9)
    assert np.array_equal(pixels("b/4.png"), heavy.render(4))

    assert run(*[w.replace("a/", "c/") for w in command], "--amount", "0.3")[0] == 0
    less = scene.replace(effects=[fl.TentSnow.preset("light", flakes=100, amount=0.3)])
    assert np.array_equal(pixels("c/4.png"), less.render(4))

    # Another size keeps the angle of view.
    assert run(*[w.replace("a/", "d/") for w in command], "--size", "48x32")[0] == 0
    small = scene.replace(size=(48, 32), camera=Camera(50.0))
    assert np.array_equal(pixels("d/4.png"), small.render(4))


def test_a_film_gives_its_own_rate_and_length(run: Run, here: Path):
    with VideoWriter("plate.mkv", (W, H), 12) as video:
        for shift in range(3):
            video.write(np.roll(PLATE, shift, axis=0))
    code, out, _ = run("render", "plate.mkv", "--snow", "light", "-o", "a/%d.png")
    assert (code, out.split()) == (0, ["a/0.png", "a/1.png", "a/2.png"])
    scene = Scene(None, "plate.mkv", effects=[Snow.preset("light")], fps=12.0)
    assert np.array_equal(pixels("a/2.png"), scene.render(2))


def test_help_and_version_go_to_stdout(run: Run):
    for arguments, word in (
        (["--version"], fl.__version__), (["-V"], fl.__version__), (["--help"], "corrupt"),
        (["render", "--help"], "%04d"), (["render", "-h"], "1-90 at 30"),
    ):  # fmt: skip
        code, out, err = run(*arguments)
        assert (code, err) == (0, "") and word in out and "None" not in out
    places = [out.index(f"  --{kind} ") for kind in ("snow", "rain", "mist", "tent-snow")]
    assert places == sorted(places), "what most users want comes first"


# What it offers ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", COMMANDS)
def test_help_says_each_option_its_default_and_an_example(name: str, run: Run):
    command = getattr(importlib.import_module(f"flurries.cli.{name}"), name)
    options = [one for one in command.params if isinstance(one, click.Option)]
    code, out, _ = run(name, "--help")
    words = " ".join(out.split())
    assert code == 0 and command.help.split(".")[0].split()[0] in words
    for one in options:
        assert " ".join(one.help.split())[:30].rsplit(" ", 1)[0] in words
        if not one.is_flag:
            assert "such as -" in one.help and ("default: " in one.help or one.required), one.opts
    assert command.examples and all(line in out for line in command.examples)
    assert {"-q", "-v"} <= {way for one in options for way in one.opts} or name == "completion"


@pytest.mark.parametrize("name", [n for n in COMMANDS if n not in ("demo", "view", "accuracy")])
def test_the_examples_of_the_help_run(name: str, run: Run, here: Path):
    Path("photos").mkdir()
    write_picture("photos/a.png", PLATE[:32, :48])
    write_picture("photo.jpg", PLATE)
    for number in (1, 2):
        write_picture(f"plate.{number:04d}.exr", (PLATE / 255.0).astype(np.float32))
    Path("shot.usda").write_text(
        '#usda 1.0\ndef Camera "camera" {\nfloat horizontalAperture = 24\n'
        "float verticalAperture = 16\n}\n"
    )
    if name == "check":
        assert run(*RENDER[:-1], "frames/%04d.png", "--frames", "1")[0] == 0
    command = getattr(importlib.import_module(f"flurries.cli.{name}"), name)
    for line in command.examples:
        words = shlex.split(line.split(" #")[0].split(">")[0].strip())
        words = shlex.split(words[1].strip("$()")) if words[0] == "eval" else words
        assert words[0] == "flurries"
        still = "%" not in line and line.endswith(".png")
        short = ["--frames", "1" if still else "1-2"] if name == "render" else []
        code, _, err = run(*words[1:], *short)
        assert code == 0, (line, err)


def test_the_commands_are_imported_one_by_one(here: Path):
    code = (
        "import sys; from flurries.cli import main; assert main(['--help']) == 0;"
        "assert 'flurries.scene' not in sys.modules and 'flurries.cli.render' not in sys.modules;"
        "assert main(['texture', '-h']) == 0; assert 'flurries.viewer' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in COMMANDS)


def test_knobs_choose_the_weather(run: Run):
    def made(*options: str) -> np.ndarray:
        code, _, err = run(
            "render", "plate.png", *options, "-o", "a.png", "--frames", "4", "--overwrite"
        )
        assert code == 0, err
        return pixels("a.png")

    def want(*effects: Any, **about: Any) -> np.ndarray:
        return Scene(None, PLATE, effects=effects, **about).render(4)

    assert np.array_equal(made("--severity", "3"), want(Snow(severity=3)))
    assert np.array_equal(made("--rate", "2.5"), want(Snow(rate_mm_h=2.5)))
    assert np.array_equal(made("--rain", "--rate", "4"), want(fl.Rain(rate_mm_h=4.0)))
    assert np.array_equal(made("--snow", "--amount", "0.5"), want(Snow(amount=0.5)))
    both = want(fl.Mist(severity=2), fl.Rain(severity=2))
    assert np.array_equal(made("--mist", "--rain", "--severity", "2"), both)
    assert np.array_equal(made("--snow", "severity=3"), want(Snow(severity=3)))
    assert np.array_equal(made("--snow", "big flakes"), want(Snow.preset("big flakes")))
    wind = {"wind": (1.0, 0.0, 0.0)}
    blown = want(fl.Mist.preset("fog", **wind), fl.Rain.preset("downpour", **wind))
    assert np.array_equal(made("--mist", "fog", "--rain", "downpour", "--wind", "1,0,0"), blown)
    cones = want(fl.ConeSnow.preset("light"), fl.ConeRain.preset("downpour"))
    assert np.array_equal(made("--cone-rain", "downpour", "--cone-snow", "light"), cones)
    far = want(fl.Mist.preset("mist", visibility=30.0))
    assert np.array_equal(made("--mist", "mist", "--visibility", "30"), far)
    near = want(fl.Rain.preset("downpour"), depth=2.5)
    assert np.array_equal(made("--rain", "downpour", "--depth", "2.5"), near)
    rows = "".join(f"0,0,{n},0,{0.01 * n},0\n" for n in range(5))
    Path("way.csv").write_text(f"x,y,z,rx,ry,rz\n{rows}")
    way = CameraPath.load("way.csv", LENS)
    turned = want(fl.Rain.preset("rain"), camera=way)
    assert np.array_equal(made("--rain", "rain", "--camera", "way.csv"), turned)
    # What does not look like a preset is the picture, also behind a bare option.
    assert run("render", "--snow", "plate.png", "-o", "b.png", "--frames", "4")[0] == 0
    assert np.array_equal(pixels("b.png"), want(Snow()))


COMPLETIONS = {
    "a command": (["ren"], {"render"}),
    "an option": (["render", "--sev"], {"--severity"}),
    "a preset": (["render", "photo.jpg", "--snow", "h"], {"heavy"}),
    "a choice": (["render", "--quality", "d"], {"draft"}),
    "an axis": (["accuracy", "sh"], {"shutter"}),
    "a look": (["texture", "--look", "b"], {"blizzard"}),
    "nothing": (["render", "--nothing-like-it"], set()),
}


@pytest.mark.parametrize("name", COMPLETIONS)
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete(
    shell: str, name: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    words, found = COMPLETIONS[name]
    line = " ".join(["flurries", *words])
    monkeypatch.setenv("_FLURRIES_COMPLETE", f"{shell}_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", words[-1] if shell == "fish" else str(len(words)))
    monkeypatch.setattr(sys, "argv", ["flurries"])
    assert main() == 0
    out = capfd.readouterr().out
    values = set(re.split(r"[,\t\n]", out))
    assert found <= values and ("heavy" in values) is (name == "a preset")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_for_a_shell(shell: str, run: Run):
    code, out, err = run("completion", shell)
    assert (code, err) == (0, "") and f"_FLURRIES_COMPLETE={shell}_complete" in out
    if shell == "bash":
        # The shell itself takes it, and knows the command afterwards.
        done = subprocess.run(["bash", "-c", f"{out}\ncomplete -p flurries"], capture_output=True)
        assert b"-F _flurries_completion" in done.stdout, done.stderr


# How much it says --------------------------------------------------------------------------------


def test_progress_is_for_terminals_and_logs_get_lines(run: Run, capfd: Any):
    code, _, err = run(*RENDER, "--frames", "1-3")
    assert code == 0 and err.count("\n") == 1 and "%|" not in err and "\r" not in err
    assert list(lines(range(4), "frame", every=0.0)) == [0, 1, 2, 3]
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 3 and said[0].startswith("flurries: 1 of 4 frames, ")


def test_a_terminal_sees_a_bar(here: Path):
    outer, inner = pty.openpty()
    fcntl.ioctl(inner, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
    process = subprocess.Popen(
        [sys.executable, "-m", "flurries", *RENDER, "--frames", "1-2"],
        cwd=here, stdout=subprocess.PIPE, stderr=inner,
    )  # fmt: skip
    os.close(inner)
    seen = b""
    while process.poll() is None or select.select([outer], [], [], 0.1)[0]:
        try:
            seen += os.read(outer, 4096)
        except OSError:
            break
    out, _ = process.communicate()
    assert process.returncode == 0 and b"2/2" in seen and b"2 frames rendered" in seen
    assert out.split() == [b"out/0001.png", b"out/0002.png"]


def test_quiet_says_nothing_and_verbose_more(run: Run):
    code, out, err = run(*RENDER, "--frames", "1-2", "--quiet")
    assert (code, err) == (0, "") and len(out.split()) == 2
    code, _, err = run(*RENDER, "--frames", "3", "--verbose")
    assert code == 0 and "Snow" in err and "ms a frame" in err and "flakes" in err
    code, _, err = run(*RENDER, "--frames", "x", "--verbose")
    assert code == 2 and "Traceback" in err, "where the error is, for who asks"


def test_a_warning_is_a_sentence(run: Run):
    warnings.simplefilter("always")
    code, _, err = run("texture", "-o", "t/%d.png", "--velocity", "40,0", "--frames", "4", "--size",
                       "64x64")  # fmt: skip
    first, *rest = err.splitlines()
    assert code == 0 and first.startswith("flurries: warning: velocity") and not rest


def test_a_reader_that_goes_is_no_error(here: Path):
    reader, writer = os.pipe()
    os.close(reader)
    process = subprocess.Popen(
        [sys.executable, "-m", "flurries", "accuracy", "--list"],
        stdout=writer, stderr=subprocess.PIPE,
    )  # fmt: skip
    os.close(writer)
    assert process.communicate()[1] == b"" and process.returncode == 141


def test_a_defect_is_a_sentence_too(run: Run, monkeypatch: pytest.MonkeyPatch):
    def broken(*_: Any, **__: Any) -> None:
        raise KeyError("lost")

    monkeypatch.setattr(Scene, "write", broken)
    code, out, err = run(*RENDER, "--frames", "1")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "KeyError: 'lost'" in err and "defect" in err


# How it says no ----------------------------------------------------------------------------------


def mistakes() -> dict[str, tuple[list[str], str]]:
    """Each: the arguments, and a word that the one line must hold."""
    options = [
        ("--size", "size", ["0x0", "abc", "131073x4", "5", "-5x5"]),
        ("--amount", "amount", ["nan", "2", "-0.1", "x"]),
        ("--wind", "wind", ["nan,0,0", "1,2", "a,b,c", "1e999,0,0"]),
        ("--fly", "", ["0,nan,0", "1"]),
        ("--frames", "frames", ["one", "5-1", "-3", "1-5x0", "1-", ""]),
        ("--seed", "seed", [str(2**63), "1.5", "x"]),
        ("--fps", "fps", ["0", "nan", "-24"]),
        ("--threads", "", ["0", "257", "two"]),
        ("--foreground", "no.png", ["no.png"]),
        ("--flakes", "--flakes", ["3"]),
        ("--quality", "quality", ["best"]),
    ]
    patterns = ["plate.png/%d.png", "plate.png/a/%d.png", "%d/%d.png", "%s.png", "a%d%d.png", "a",
                "a/", "", "%d.xyz", "a\n%d.png", "plate.png", "%d.toml", "."]  # fmt: skip
    inputs = {
        "missing": ["no.png", "no.png"], "damaged": ["cut.png", "cut.png"],
        "no picture": ["text.png", "text.png"], "empty": ["empty.png", "empty.png"],
        "a folder": [".", "folder"], "unknown key": ["bad.toml", "line 1.*fpps.*fps"],
        "no scene": ["no.toml", "no.toml"], "bad TOML": ["worse.toml", "worse.toml"],
        "deep TOML": ["deep.toml", "deep.toml"], "no sequence": ["no.%d.png", "no.%d.png"],
    }  # fmt: skip
    every = {f"{o} {v}": ([*RENDER, o, v], word) for o, word, vs in options for v in vs}
    every["layers of PNG"] = ([*RENDER, "--layers"], "layers")
    every |= {f"to {p!r}": ([*RENDER[:-1], p, "--frames", "1"], "") for p in patterns}
    for name, (given, word) in inputs.items():
        every[name] = (["render", given, "--snow", "light", "-o", "out/%d.png"], word)
    every["preset"] = (["render", "plate.png", "--snow", "hevy", "-o", "a.png"], "hevy")
    every["no snow"] = (["render", "plate.png", "-o", "a.png"], "--snow")
    every["no output"] = (["render", "plate.png", "--snow", "light"], "output")
    every["no command"] = ([], "COMMAND")
    every["bad command"] = (["rendr"], "'rendr'; did you mean 'render'?")
    every["near option"] = ([*RENDER, "--fames", "3"], "--frames")
    every["near preset"] = (["plan", "plate.png", "--rain", "drizle"], "mean 'drizzle'?")
    plate = ["render", "plate.png", "-o", "a.png"]
    every["no mist"] = ([*plate, "--visibility", "30"], "--mist")
    every["no such mist"] = ([*plate, "--mist", "smog"], "fog")
    every["no such cone"] = ([*plate, "--cone-rain", "none"], "downpour")
    every["no such rain"] = ([*plate, "--rain", "shower"], "'drizzle'")
    two = [*plate, "--rain", "rain", "--camera", "way.csv", "--fly", "0,0,1"]
    every["two cameras"] = (two, "--camera and --fly")
    every["no depth"] = ([*plate, "--rain", "rain", "--depth", "nope.exr"], "nope.exr")
    every["near kind"] = (["plan", "kind.toml"], "line 2.*mean 'snow'?")
    every["near weather"] = (["corrupt", ".", "../w", "--weather", "sonw"], "mean 'snow'?")
    every["near axis"] = (["accuracy", "blnd"], "mean 'blend'?")
    every["two ways"] = ([*RENDER, "--severity", "3"], "severity")
    every["no such knob"] = (["plan", "plate.png", "--mist", "--rate", "3"], "--rate.*--snow")
    every["which weather"] = (["plan", "scene.toml", "--severity", "3"], "--severity.*--rain")
    every["video rate"] = ([*RENDER[:-1], "a.mp4", "--frames", "1", "--fps", "5000"], "fps")
    every["demo size"] = (["demo", "-o", "d", "--size", "3"], "size")
    every["demo frames"] = (["demo", "-o", "d", "--frames", "0"], "frames")
    return every


MISTAKES = mistakes()


@pytest.mark.parametrize("name", MISTAKES, ids=ascii)
def test_a_mistake_is_one_sentence(name: str, run: Run, here: Path):
    Path("cut.png").write_bytes(Path("plate.png").read_bytes()[:3000])
    Path("text.png").write_text("no picture at all")
    Path("empty.png").touch()
    Path("bad.toml").write_text("fpps = 25\n")
    Path("kind.toml").write_text("[[effects]]\nkind = 'sonw'\n")
    Path("worse.toml").write_text("size = [1,\n")
    Path("deep.toml").write_text("size = " + "[" * 20000)
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


# When it is stopped ------------------------------------------------------------------------------


def start(here: Path, *arguments: str, **more: Any) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "flurries", *arguments],
        cwd=here, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more,
    )  # fmt: skip


def wait_for(count: int, folder: Path, process: subprocess.Popen[str]) -> None:
    """Wait until so many frames are there."""
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
    assert "Traceback" not in err and "flurries: stopped" in err and out == ""
    done = sorted(p.name for p in (here / "out").glob("*.png"))
    assert not list((here / "out").glob(".*"))
    assert 3 <= len(done) < 5000 and done == [f"{n:04d}.png" for n in range(1, len(done) + 1)]
    last = len(done) + 2
    process = start(here, *RENDER, "--frames", f"1-{last}")
    _, err = process.communicate(timeout=60)
    assert f"2 frames rendered, {len(done)} were there already" in err
    scene = Scene(None, PLATE, effects=[Snow.preset("light")])
    for number in (1, len(done), last):
        assert np.array_equal(pixels(here / "out" / f"{number:04d}.png"), scene.render(number))


def test_ctrl_c_leaves_no_half_a_film(here: Path):
    process = start(here, *RENDER[:-1], "out/film.mp4", "--frames", "1-5000")
    end = time.monotonic() + 60
    while not list(here.glob("out/.*")) and time.monotonic() < end:
        time.sleep(0.002)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert not list((here / "out").iterdir())
