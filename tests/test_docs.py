"""Pages keep their word: examples run, what they name is there, and the site has all names."""

import ast
import doctest
import importlib
import importlib.util
import json
import os
import pkgutil
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image

import flurries as fl
from flurries import io
from flurries.cli import main
from flurries.cli.main import COMMANDS
from flurries.effects.kinds import OURS
from flurries.io import read_picture
from flurries.output.journal import check
from test_nothing_wrong import SMALL, contents

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
sys.path.insert(0, str(Path(__file__).parents[1] / "docs" / "site"))

import absolute
import links
import make_shot

README = Path(__file__).parents[1] / "README.md"
RUN = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


# Importing one runs the command line, the others need other libraries: tests/hosts has them.
ELSEWHERE = ("__main__", "augment.albumentations", "augment.kornia", "augment.torchvision")


def modules() -> Iterator[str]:
    yield "flurries"
    for found in pkgutil.walk_packages(fl.__path__, "flurries."):
        if not found.name.endswith(ELSEWHERE):
            yield found.name


def run_blocks(text: str) -> int:
    namespace: dict[str, object] = {"__name__": "page"}
    blocks = RUN.findall(text)
    for number, block in enumerate(blocks, 1):
        exec(compile(block, f"block {number}", "exec"), namespace)
    return len(blocks)


# Modules whose text has an example, and pages with Python; those of tests of their own apart
# (test_own_effect.py, and below).
EXAMPLES = sorted(
    name for name in modules()
    if ">>> " in Path(str(importlib.util.find_spec(name).origin)).read_text("utf-8", "ignore")  # type: ignore[union-attr]
)  # fmt: skip
RUNNING = [
    page for page in (README, *sorted((README.parent / "docs").glob("*.md")))
    if "```python" in page.read_text("utf-8") and page.name not in ("your-own-effect.md", "shot.md")
]  # fmt: skip


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", EXAMPLES)
def test_docstring_examples(name: str):
    ran = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert ran.attempted > 0 and ran.failed == 0


@pytest.mark.parametrize("page", RUNNING, ids=lambda page: page.stem)
def test_the_readme_and_pages_for_users_run(page: Path):
    text = page.read_text(encoding="utf-8")
    assert run_blocks(text) == text.count("```python")


def test_33_the_arrays_of_the_page_run():
    page = (README.parent / "docs" / "clusters.md").read_text()
    script, template = [b for b in page.split("```") if b[:4] in ("bash", "yaml") and "x4" in b]
    SMALL.save("scene.toml")
    run = yaml.safe_load(template[4:])["steps"][0]["script"]["actions"]["onRun"]
    words = " ".join([run["command"], *run["args"]])
    words = words.replace("{{Task.Param.First}}", "$SLURM_ARRAY_TASK_ID")
    assert shlex.split(words) == shlex.split(script.splitlines()[-1])
    words = f"{sys.executable} -m {words}"
    for number in range(1, 5):
        own = {**os.environ, "SLURM_ARRAY_TASK_ID": str(number)}
        subprocess.run(words, shell=True, env=own, check=True, capture_output=True)
    assert sorted(contents(Path("frames"))) == [f"{n:04}.png" for n in range(1, 13)]
    assert check("frames") == (12, [])


NOTEBOOKS = sorted((README.parent / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_is_kept_without_outputs(path: Path):
    namespace: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [] and cell["execution_count"] is None
            exec(compile("".join(cell["source"]), f"{path.name}, {number}", "exec"), namespace)


def test_there_is_something_to_run_in_order():
    assert len(EXAMPLES) > 10 and len(RUNNING) > 10 and NOTEBOOKS
    page = "```python\nx = 1\n```\nwords\n```python\nassert x == {}\n```\n"
    assert run_blocks(page.format(1)) == 2
    with pytest.raises(AssertionError):
        run_blocks(page.format(2))


PAGES = [*README.parent.glob("*.md"), *sorted((README.parent / "docs").rglob("*.md"))]
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
FILE = re.compile(r"`((?:python|flurries|src|docs|tests|benches)/[\w./-]+\.\w+)`")
TEST = re.compile(r"`([\w/]+\.py)?::(test_\w+)`")  # "::test" belongs to the file before it.
# Where files that a page names may stand; "flurries/" is short for "python/flurries/".
ROOTS = (README.parent, README.parent / "python")


def named_tests(text: str) -> set[str]:
    found, file = set(), ""
    for match in TEST.finditer(text):
        file = (match[1] or file).removeprefix("tests/")
        found.add(f"{file}::{match[2]}")
    return found


def declared(file: str) -> set[str]:
    path = README.parent / "tests" / file
    tree = ast.parse(path.read_text("utf-8") if path.exists() else "")
    return {f"{file}::{node.name}" for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def missing(page: Path, text: str) -> list[str]:
    links = [link for link in LINK.findall(text) if "://" not in link]
    lost = [link for link in links if not (page.parent / link).exists()]
    named = FILE.findall(text)
    lost += [file for file in named if not any((root / file).exists() for root in ROOTS)]
    tests = named_tests(text)
    there = {name for file in {test.split("::")[0] for test in tests} for name in declared(file)}
    return lost + sorted(tests - there)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(README.parent)))
def test_links_files_and_tests_of_a_page_are_there(page: Path):
    assert missing(page, page.read_text(encoding="utf-8")) == []


def test_every_erratum_and_every_soak_test_has_its_line():
    internals = README.parent / "docs" / "internals"
    table = (internals / "deviations.md").read_text("utf-8").split("## Errata of Langer 2004")[1]
    rows = re.findall(r"^\| ([\d, ]+) \|(.*)", table.split("\n## ")[0], re.M)
    assert all(named_tests(row) for _, row in rows)
    assert sorted(int(n) for numbers, _ in rows for n in numbers.split(",")) == list(range(1, 21))
    promised = named_tests((internals / "reliability.md").read_text("utf-8"))
    soak = {
        name for path in (README.parent / "tests" / "soak").glob("test_*.py")
        for name in declared(f"soak/{path.name}") if "::test_" in name
    }  # fmt: skip
    assert len(promised) > 50 and soak and soak <= promised


def test_the_readmes_film_is_what_the_commands_below_it_make(tmp_path: Path):
    text = README.read_text("utf-8")
    assert len(text.split()) <= 700
    draw, render = map(str.split, re.findall(r"^(.* examples/street.*?) +#", text, re.M))
    shutil.copy(README.parent / "examples" / "street.toml", tmp_path)
    runpy.run_path(str(README.parent / draw[1]))["main"](tmp_path)
    scene = [str(tmp_path / Path(render[2]).name), "--frames", "0,20", *render[5:]]
    assert main(["render", *scene]) == 0
    film = Image.open(README.parent / "docs" / "images" / "snow.webp")
    for number, other in ((0, 10), (20, 30)):
        made = read_picture(f"street/{number:04d}.png").pixels.astype(float)
        film.seek(number)
        off = np.abs(np.asarray(film.convert("RGB")) - made).mean()
        film.seek(other)
        assert 2.0 * off < np.abs(np.asarray(film.convert("RGB")) - made).mean()


@pytest.mark.parametrize("look", ["overcast_street", "night_street", "portrait"])
def test_a_photograph_of_the_readme_is_what_its_command_makes(look: str, tmp_path: Path):
    render, scene, *_, name = re.search(rf"render \S+{look}.toml -o .*", README.read_text())[
        0
    ].split()  # type: ignore[index]
    shown = read_picture(README.parent / "docs" / "images" / name).pixels.astype(float)
    off = []
    for seed in ((), ("--seed", "99")):
        out = str(tmp_path / f"{len(off)}.jpg")
        assert main([render, str(README.parent / scene), "-o", out, *seed]) == 0
        off.append(np.abs(read_picture(out).pixels - shown).mean())
    assert off[0] < 0.5 * off[1]


def test_what_is_lost_would_be_seen():
    text = (
        "[a](docs/README.md) [b](docs/none.md#x) `src/lib.rs` `flurries/none.rs` [c](https://c.d/e)"
        " `test_docs.py::test_nobody`, `::test_docstring_examples`"
    )
    lost = ["docs/none.md", "flurries/none.rs", "test_docs.py::test_nobody"]
    assert missing(README, text) == lost


def test_the_index_of_internals_answers_ten_questions_by_two_files_at_most():
    page = README.parent / "docs" / "internals" / "README.md"
    table = page.read_text(encoding="utf-8").split("## Where to look")[1]
    rows = [line.split(" | ") for line in table.splitlines() if "? |" in line]
    assert len(rows) >= 10
    for question, answer in rows:
        named = FILE.findall(answer)
        assert 1 <= len(named) <= 2, question
        # What it says to look for in the first file stands in one of them.
        text = "".join((README.parent / file).read_text(encoding="utf-8") for file in named)
        words = re.findall(r"\(`([\w:]+)`", answer) + re.findall(r", `(\w+)`\)", answer)
        assert all(word.split("::")[-1] in text for word in words), question


def test_a_lost_link_a_lost_place_and_a_strange_load_are_seen(tmp_path: Path):
    (tmp_path / "a.html").write_text(
        "<a href='b.html#there'></a><a href='b.html#gone'></a><a href='c.html'></a>"
        "<img src='https://elsewhere/x.png'><a href='https://elsewhere'></a>"
    )
    (tmp_path / "b.html").write_text("<h1 id='there'>x</h1>")
    assert links.lost(tmp_path) == [
        "a.html: b.html#gone", "a.html: c.html", "a.html: loads https://elsewhere/x.png",
    ]  # fmt: skip


def test_every_variable_that_the_code_reads_has_a_row():
    page = (README.parent / "docs" / "site" / "commands.py").read_text(encoding="utf-8")
    files = [*(README.parent / "python").rglob("*.py"), *(README.parent / "src").rglob("*.rs")]
    read = {
        name for file in files
        for name in re.findall(r"\bFLURRIES_[A-Z_]+\b", file.read_text(encoding="utf-8"))
    }  # fmt: skip
    # Set by the shell's completion itself.
    read = {name for name in read if not name.endswith("_")}
    assert read - {"FLURRIES_COMPLETE"} == set(re.findall(r"^\| `(FLURRIES_\w+)`", page, re.M))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    import commands
    import reference
    import scenes

    folder = tmp_path_factory.mktemp("site") / "reference"
    reference.write(folder)
    scenes.write(folder)
    commands.write(folder)
    return folder


def test_no_public_name_is_without_a_page(made: Path):
    text = "".join(page.read_text(encoding="utf-8") for page in made.glob("*.rst"))
    for name in fl.__all__:
        thing = getattr(fl, name)
        shown = getattr(thing, "__all__", None) if type(thing).__name__ == "module" else [name]
        for own in shown or []:
            if callable(getattr(thing, own, thing)):
                assert re.search(rf"^\.\. auto\w+:: flurries[\w.]*\.{own}$", text, re.M), own


def test_every_key_of_a_scene_file_has_its_row_and_every_command_its_section(made: Path):
    text = (made / "scene-toml.md").read_text(encoding="utf-8")
    for kind, effect in OURS.items():
        part = text.split(f'kind = "{kind}"\n', 2)[-1].split("\n## ")[0]
        for field in fields(effect):
            row = re.search(rf"^\| `{field.name}` \| (.*)$", part, re.M)
            assert row and "see the class" not in row[1], f"{kind}: {field.name}"
    assert "| `amount` | float | `1.0` | 0 to 1 |" in text
    commands = (made / "commands.md").read_text(encoding="utf-8")
    assert re.findall(r"^## flurries (\w+)$", commands, re.M) == list(COMMANDS)


def test_links_for_a_package_index_are_absolute():
    text = absolute.absolute(README.read_text(encoding="utf-8"), "https://h/o/f")
    found = re.findall(r"(!?)\[[^\]]*\]\(([^)\s]+)\)", text)
    assert len(found) > 10
    assert all(link.startswith(("https://", "#")) for _, link in found)
    assert "](https://h/o/f/raw/main/docs/images/snow.webp)" in text
    project = (README.parent / "pyproject.toml").read_text(encoding="utf-8")
    assert 'Homepage = "https://h/o/f"' in absolute.with_urls(project, "https://h/o/f")


def test_the_page_of_a_shot_has_six_tasks_of_six_lines_at_most():
    found = make_shot.tasks()
    assert len(found) == 6
    assert all(1 <= lines.count("\n") <= 6 for _, lines in found.values()), found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("shot")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(made)
        make_shot.material((96, 64))
        for kind, lines in make_shot.tasks().values():
            make_shot.run(kind, lines)
        assert make_shot.picture().shape == (128, 288, 3)
    return made


def test_every_frame_is_there_and_the_walker_hides_the_snow_behind(folder: Path):
    for name in ("snow", "aces_snow", "tracked"):
        numbers = sorted(int(file.name.split(".")[-2]) for file in folder.glob(f"{name}.*.exr"))
        assert numbers == list(make_shot.FRAMES)
    for frame in (1001, 1008):
        layers = io.read_layers(folder / f"snow.{frame}.exr")
        walker = io.read_picture(folder / f"roto.{frame}.exr").pixels[..., 0] > 0.99
        before, beside = (layers["snow"][..., 3][part].mean() for part in (walker, ~walker))
        assert before < 0.5 * beside
        depth = layers["snow.depth"][walker]
        assert depth[np.isfinite(depth)].max() <= 4.5


def test_the_others_have_what_the_page_says(folder: Path):
    wide = io.read_picture(folder / "aces_snow.1003.exr", overscan=True)
    assert wide.pixels.shape[:2] == (64, 96)
    assert io.read_picture(folder / "aces_snow.1003.exr").pixels.shape[:2] == (58, 88)
    left, right = io.read_views(folder / "pair.1005.exr")
    assert left.shape == right.shape and not np.array_equal(left, right)
    assert (folder / "flakes.usdc").stat().st_size > 10_000
    film = make_shot.over_grey(folder / "snow.mov", 0)
    # Squares of .22 and .32, and flakes in the plate's light: .486 and .274; no veil whitens them.
    assert film.max() > 0.45 and film.min() < 0.3
