"""What the command line offers: help, examples that run, completion in shells, the demo."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

import flurries as fl
from films import snowfall
from flurries.cli import demo, main
from flurries.cli.main import COMMANDS, commands
from flurries.io import open_background, read_layers, read_picture, write_picture
from test_cli import PLATE, RENDER, Run, here, run


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
