"""The command line: what its commands make and say, and its help."""

import fcntl
import os
import pty
import re
import select
import shlex
import struct
import subprocess
import sys
import termios
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest

import flurries as fl
from films import snowfall
from flurries.cli import demo, main
from flurries.cli.main import COMMANDS, commands
from flurries.cli.words import lines
from flurries.io import open_background, read_layers, read_picture, write_picture

CameraPath, Camera, Scene, Snow = fl.CameraPath, fl.camera.Camera, fl.Scene, fl.Snow
W, H = 96, 64
PLATE = np.random.default_rng(2).integers(0, 200, (H, W, 3)).astype(np.uint8)
MASK = np.zeros((H, W), np.uint8)
MASK[:, 48:] = 255
RENDER = ["render", "plate.png", "--snow", "light", "-o", "out/%04d.png"]
Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_picture("plate.png", PLATE)
    write_picture("mask.png", MASK)
    Path("way.csv").write_text("x,y,z\n" + "".join(f"0,0,{n}\n" for n in range(12)))
    Path("scene.toml").write_text(
        "format = 3\nbackground = 'plate.png'\nfps = 25\nseed = 4\n[camera]\nfocal = 100\n"
        "[[effects]]\nkind = 'tent_snow'\npreset = 'light'\nflakes = 100\n"
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
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def pixels(path: str | Path) -> np.ndarray:
    return read_picture(path).pixels


def test_a_picture_becomes_frames_and_again_only_what_is_missing(run: Run, here: Path):
    command = ["render", "plate.png", "--snow", "heavy", "-o", "frames/%04d.png", "--frames", "1-3"]
    names = [f"frames/000{n}.png" for n in (1, 2, 3)]
    for said in ("3 frames rendered", "0 frames rendered, 3 were", "1 frame rendered, 2 were"):
        code, out, err = run(*command)
        assert (code, out.splitlines()) == (0, names), "data, as if it had made them"
        assert said in err
        if said.startswith("0"):
            (here / "frames" / "0002.png").unlink()
    scene = Scene(PLATE, effects=[Snow("heavy")], fps=30)
    assert all(np.array_equal(pixels(n), scene.render(i)) for i, n in enumerate(names, 1))
    first = files(here / "frames")
    other = ["light" if word == "heavy" else word for word in command]
    code, out, err = run(*other)
    assert (code, out) == (2, "")
    assert err.startswith("flurries: frames/0001.png") and err.count("\n") == 1
    assert files(here / "frames") == first
    assert run(*other, "--overwrite")[0] == 0
    assert all(data != first[name] for name, data in files(here / "frames").items())


LENS = Camera(1.2 * W)
WAY = CameraPath(LENS, position=[(0, 0, n) for n in range(12)])
ON_ITS_WAY = {"wind": (1.0, 0.0, 0.0)}
# What is asked for: the weather that it is, and what it means for the scene.
OPTIONS: dict[str, tuple[list[Any], dict[str, Any]]] = {
    "--snow light": ([Snow("light")], {}), "--snow light --quiet": ([Snow("light")], {}),
    "--snow light --seed -7": ([Snow("light")], {"seed": -7}),
    "--snow --fps 12.5": ([Snow()], {"fps": 12.5}),
    "--snow light --wind 1,0.5,-2": ([Snow("light", wind=(1.0, 0.5, -2.0))], {}),
    "--snow --fly=-1,0,-2": ([Snow()], {"camera": CameraPath(LENS, velocity=(-1, 0, -2))}),
    "--snow light --amount 0.5": ([Snow("light", amount=0.5)], {}),
    "--snow --foreground mask.png": ([Snow()], {"foreground": MASK}),
    "--snow --lens 4,2": ([Snow()], {"lens": fl.camera.Lens(4.0, f_stop=2.0)}),
    "--snow --linear": ([Snow()], {"space": "linear"}),
    "--snow --depth 2.5": ([Snow()], {"depth": 2.5}),
    "--snow --camera way.csv": ([Snow()], {"camera": WAY}),
    "--severity 3": ([Snow(severity=3)], {}), "--rate 2.5": ([Snow(rate=2.5)], {}),
    "--rain --rate 4": ([fl.Rain(rate=4.0)], {}),
    "--mist --rain --severity 2": ([fl.Mist(severity=2), fl.Rain(severity=2)], {}),
    "--snow light --method tent --color #ff8000": (
        [fl.effects.TentSnow("light", color="#ff8000")], {}),
    "--rain --method cone": ([fl.effects.ConeRain()], {}),
    "--snow --density 90 --shutter 0.2 --near 0.5": (
        [Snow(density=90.0, shutter=0.2, near=0.5)], {}),
    "--snow --hide 3,5 --place 9,0,0,2,0.03 --wakes 0,0,4,1 --holdout mask.png": (
        [Snow(hide=(3, 5), place=[(9, 0, 0, 2, 0.03)], holdout=MASK,
              wakes=[fl.effects.Body((0, 0, 4), 1)])], {}),
    "--snow 'big flakes'": ([Snow("big flakes")], {}),
    "--mist fog --rain downpour --wind 1,0,0": (
        [fl.Mist("fog", **ON_ITS_WAY), fl.Rain("downpour", **ON_ITS_WAY)], {}),
    "--mist mist --visibility 30": ([fl.Mist("mist", visibility=30.0)], {}),
}  # fmt: skip


@pytest.mark.parametrize("asked", OPTIONS)
def test_what_options_mean(asked: str, run: Run):
    # What does not look like a preset is the picture, also behind a bare option.
    code, _, err = run("render", *shlex.split(asked), "plate.png", "-o", "a.png", "--frames", "9")
    assert code == 0, err
    effects, more = OPTIONS[asked]
    scene = Scene(PLATE, **{"effects": effects, "fps": 30, **more})
    assert np.array_equal(pixels("a.png"), scene.render(9))
    if more:
        assert not np.array_equal(pixels("a.png"), Scene(PLATE, effects=effects, fps=30).render(9))


def test_files_sizes_and_threads(run: Run, here: Path):
    for count in ("1", "3"):
        command = [*RENDER, "--frames", "2", "--threads", count, "--size", "50x40", "--overwrite"]
        assert run(*command)[0] == 0
        assert fl.settings().threads == int(count)
        (here / "out" / "0002.png").rename(here / f"{count}.png")
    assert (here / "1.png").read_bytes() == (here / "3.png").read_bytes()
    want = Scene(here / "plate.png", size=(50, 40), effects=[Snow("light")], fps=30).render(2)
    assert np.array_equal(pixels("1.png"), want)
    code, out, _ = run(*RENDER[:-1], "still.jpg", "--frames", "6")
    assert (code, out) == (0, "still.jpg\n")
    want = Scene(PLATE, effects=[Snow("light")], fps=30).render(6)
    assert np.abs(pixels("still.jpg").astype(int) - want).mean() <= 8


def test_a_scene_file(run: Run, here: Path):
    scene = fl.open("scene.toml")
    heavy = scene.replace(effects=[Snow("heavy")], seed=9)
    less = scene.replace(effects=[fl.effects.TentSnow("light", flakes=100, amount=0.3)])
    # Another size keeps the angle of view.
    small = scene.replace(size=(48, 32), camera=Camera(50.0))
    for words, wanted in {
        "": scene, "--snow heavy --seed 9": heavy, "--amount 0.3": less, "--size 48x32": small
    }.items():  # fmt: skip
        command = ["render", "scene.toml", "-o", "%d.png", "--frames", "1-7x3", "--overwrite"]
        code, out, _ = run(*command, *words.split())
        assert (code, out.split()) == (0, ["1.png", "4.png", "7.png"])
        assert np.array_equal(pixels("4.png"), wanted.render(4))


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


def test_how_much_it_says(run: Run, capfd: Any, monkeypatch: pytest.MonkeyPatch):
    code, _, err = run(*RENDER, "--frames", "1-3")
    assert code == 0 and err.count("\n") == 1 and "%|" not in err and "\r" not in err
    assert list(lines(range(4), "frame", every=0.0)) == [0, 1, 2, 3]
    said = capfd.readouterr().err.splitlines()
    assert len(said) == 3 and said[0].startswith("flurries: 1 of 4 frames, ")
    code, out, err = run(*RENDER, "--frames", "1-2", "--quiet")
    assert (code, err) == (0, "") and len(out.split()) == 2
    code, _, err = run(*RENDER, "--frames", "4", "--verbose")
    assert code == 0 and "Snow" in err and "ms a frame" in err and "flakes" in err
    code, _, err = run(*RENDER, "--frames", "x", "--verbose")
    assert code == 2 and "Traceback" in err, "where the error is, for who asks"
    warnings.simplefilter("always")
    fast = ["--velocity", "40,0", "--frames", "4", "--size", "64x64"]
    code, _, err = run("texture", "-o", "t/%d.png", *fast)
    first, *rest = err.splitlines()
    assert code == 0 and first.startswith("flurries: warning: velocity") and not rest

    def broken(*_: Any, **__: Any) -> None:
        raise KeyError("lost")

    monkeypatch.setattr(Scene, "write", broken)
    code, out, err = run(*RENDER, "--frames", "1")
    assert (code, out, err.count("\n")) == (1, "", 1)
    assert "KeyError: 'lost'" in err and "defect" in err


def test_a_reader_that_goes_is_no_error(here: Path):
    reader, writer = os.pipe()
    os.close(reader)
    process = subprocess.Popen(
        [sys.executable, "-m", "flurries", "completion", "bash"],
        stdout=writer, stderr=subprocess.PIPE,
    )  # fmt: skip
    os.close(writer)
    assert process.communicate()[1] == b"" and process.returncode == 141


def test_each_eye_of_a_pair_has_its_own_files(run: Run, here: Path):
    words = ["render", "plate_%V.####.png", "--snow", "heavy", "--eyes", "0.3,6", "-o"]
    plates = {"left": PLATE, "right": PLATE[::-1]}
    for view, picture in plates.items():
        write_picture(f"plate_{view}.0007.png", picture)
    assert run(*words, "snow_%V.####.png")[0] == 0
    for side, (view, picture) in enumerate(plates.items()):
        scene = fl.Scene(picture, effects=[fl.Snow("heavy")], fps=30)
        wanted = scene.stereo(7, distance=0.3, convergence=6.0)[side]
        assert np.array_equal(pixels(f"snow_{view}.0007.png"), wanted)
    assert run(*words, "snow.####.png")[0] == 2


@pytest.mark.parametrize("name", [n for n in COMMANDS if n not in ("demo", "view")])
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
    if name == "match":
        with fl.io.VideoWriter("snow.mp4", (320, 180), 25) as film:
            for frame in snowfall():
                film.write(frame)
    if name == "check":
        assert run(*RENDER[:-1], "frames/%04d.png", "--frames", "1")[0] == 0
    command = commands.get_command(click.Context(commands), name)
    for line in command.examples:
        words = shlex.split(line.split(" #")[0].split(">")[0].strip())
        words = shlex.split(words[1].strip("$()")) if words[0] == "eval" else words
        assert words[0] == "flurries"
        still = "%" not in line and line.endswith(".png")
        short = ["--frames", "1" if still else "1-2"] if name == "render" else []
        code, _, err = run(*words[1:], *short)
        assert code == 0, (line, err)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_says_each_option_its_default_and_an_example(name: str, run: Run):
    command = commands.get_command(click.Context(commands), name)
    options = [one for one in command.params if isinstance(one, click.Option)]
    code, out, err = run(name, "--help")
    words = " ".join(out.split())
    assert (code, err) == (0, "") and command.help.split(".")[0].split()[0] in words
    for one in options:
        assert " ".join(one.help.split())[:30].rsplit(" ", 1)[0] in words
        if not one.is_flag:
            assert "such as -" in one.help and ("default: " in one.help or one.required), one.opts
    assert command.examples and all(line in out for line in command.examples)
    assert {"-q", "-v"} <= {way for one in options for way in one.opts} or name == "completion"
    assert run("-V")[:2] == (0, f"flurries {fl.__version__}\n")


def test_the_commands_are_imported_one_by_one(here: Path):
    code = (
        "import sys; from flurries.cli import main; assert main(['--help']) == 0;"
        "assert 'flurries.scene' not in sys.modules and 'flurries.cli.render' not in sys.modules;"
        "assert main(['texture', '-h']) == 0; assert 'flurries.viewer' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0 and all(name in done.stdout for name in COMMANDS), done.stderr


@pytest.mark.parametrize(("words", "found"), [
    ("ren", {"render"}), ("render --sev", {"--severity"}), ("render a.jpg --snow h", {"heavy"}),
    ("render --quality d", {"draft"}), ("texture --look b", {"blizzard"}), ("render --none", set()),
])  # fmt: skip
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_shells_complete(
    shell: str, words: str, found: set[str], monkeypatch: pytest.MonkeyPatch, run: Run,
    capfd: pytest.CaptureFixture[str],
):  # fmt: skip
    code, script, _ = run("completion", shell)
    assert code == 0 and f"_FLURRIES_COMPLETE={shell}_complete" in script
    parts = words.split()
    monkeypatch.setenv("_FLURRIES_COMPLETE", f"{shell}_complete")
    monkeypatch.setenv("COMP_WORDS", f"flurries {words}")
    monkeypatch.setenv("COMP_CWORD", parts[-1] if shell == "fish" else str(len(parts)))
    monkeypatch.setattr(sys, "argv", ["flurries"])
    assert main() == 0
    values = set(re.split(r"[,\t\n]", capfd.readouterr().out))
    assert found <= values and ("heavy" in values) is ("heavy" in found)


SIZE = 128
PICTURE = demo.io.photograph("rocket", size=(SIZE, SIZE))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    folder = tmp_path_factory.mktemp("demo") / "new"
    assert main(["demo", "-q", "-o", str(folder), "--size", str(SIZE), "--frames", "4"]) == 0
    return folder, [path for path in folder.iterdir() if path.suffix != ".jsonl"]


def test_the_films_and_stills(made: tuple[Path, list[Path]]):
    folder, files = made
    names = {"three.mp4", "three.png", "flight.mp4", "flight.png", "flight.exr"}
    assert {p.name for p in files} == names
    scenes = demo.three(PICTURE)
    triple = np.hstack([scene.render(2) for scene in scenes])
    flying = demo.flight(PICTURE)
    for name, still, size in (
        ("three", triple, (3 * SIZE, SIZE)),
        ("flight", flying.render(2), (SIZE, SIZE)),
    ):
        film = open_background(folder / f"{name}.mp4")
        assert (film.count, film.size, film.fps) == (4, size, demo.FPS)
        assert np.array_equal(read_picture(folder / f"{name}.png").pixels, still)
        shown = film.frame(1).pixels.astype(int)  # the second of the film is frame 2
        assert np.abs(shown - still).mean() < 12


def test_the_layers_are_those_of_the_flight(made: tuple[Path, list[Path]]):
    layers = read_layers(made[0] / "flight.exr")
    want = demo.flight(PICTURE).replace(space="linear").layers(2)
    assert {"rgba", "snow", "snow.depth", "snow.forward", "snow.coverage"} <= set(layers)
    assert np.abs(layers["snow"][..., 3] - want.alpha).max() <= 2.0**-9
