"""The examples in docstrings and in the README run."""

from __future__ import annotations

import doctest
import importlib
import importlib.util
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import flurries

README = Path(__file__).parents[1] / "README.md"
RUN = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


# Importing one runs the command line, the others need other libraries: tests/hosts has them.
ELSEWHERE = ("__main__", "augment.albumentations", "augment.kornia", "augment.torchvision")


def modules() -> Iterator[str]:
    yield "flurries"
    for found in pkgutil.walk_packages(flurries.__path__, "flurries."):
        if not found.name.endswith(ELSEWHERE):
            yield found.name


def run_examples(module: object) -> doctest.TestResults:
    return doctest.testmod(module, verbose=False, optionflags=doctest.ELLIPSIS)  # type: ignore[arg-type]


def run_blocks(text: str) -> int:
    """Run the marked blocks of a page, one after the other in one namespace; say how many."""
    namespace: dict[str, object] = {"__name__": "readme"}
    blocks = RUN.findall(text)
    for number, block in enumerate(blocks, 1):
        exec(compile(block, f"block {number}", "exec"), namespace)
    return len(blocks)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Examples may write files; they do so in a folder of the test's own."""
    monkeypatch.chdir(tmp_path)


def with_examples() -> list[str]:
    """Return the modules whose text has an example."""
    files = {name: importlib.util.find_spec(name).origin for name in modules()}  # type: ignore[union-attr]
    return sorted(
        name for name, file in files.items()
        if str(file).endswith(".py") and ">>> " in Path(str(file)).read_text("utf-8")
    )  # fmt: skip


@pytest.mark.parametrize("name", with_examples())
def test_docstring_examples(name: str):
    ran = run_examples(importlib.import_module(name))
    assert ran.attempted > 0 and ran.failed == 0


def test_there_are_examples_to_run():
    assert len(with_examples()) > 20


def test_a_wrong_example_is_noticed(capsys: pytest.CaptureFixture[str]):
    import types

    module = types.ModuleType("wrong", ">>> 1 + 1\n3\n")
    assert run_examples(module) == (1, 1)
    assert "Expected" in capsys.readouterr().out


def test_the_readme_runs():
    text = README.read_text(encoding="utf-8")
    assert run_blocks(text) == text.count("```python") >= 2


# `test_own_effect.py` runs the page on effects of one's own and looks at what comes out.
# Run by tests of their own: test_own_effect.py, test_shot_tasks.py.
APART = {"your-own-effect.md", "shot.md"}
RUNNING = [
    "start.md",
    "concepts.md",
    "film.md",
    "camera.md",
    "depth.md",
    "gas.md",
    "light.md",
    "stereo.md",
    "augment.md",
    "looks.md",
    "plan.md",
    "snow.md",
]


@pytest.mark.parametrize("name", RUNNING)
def test_a_page_for_users_runs(name: str):
    text = (README.parent / "docs" / name).read_text(encoding="utf-8")
    assert run_blocks(text) == text.count("```python") >= 1


def test_all_pages_for_users_with_python_run():
    pages = (README.parent / "docs").glob("*.md")
    found = {page.name for page in pages if "```python" in page.read_text(encoding="utf-8")}
    assert found == {*RUNNING, *APART}


def test_the_readme_reader_runs_blocks_in_order():
    page = "```python\nx = 1\n```\nwords\n```text\nx = 1 / 0\n```\n"
    page += "```python\nassert x == {}\n```\n"
    assert run_blocks(page.format(1)) == 2
    with pytest.raises(AssertionError):
        run_blocks(page.format(2))


PAGES = [*README.parent.glob("*.md"), *sorted((README.parent / "docs").rglob("*.md")),
         README.parent / "benches" / "history.md"]  # fmt: skip
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
FILE = re.compile(r"`((?:python|flurries|src|docs|tests|benches)/[\w./-]+\.\w+)`")
# Where files that a page names may stand; "flurries/" is short for "python/flurries/".
ROOTS = (README.parent, README.parent / "python")


def missing(page: Path, text: str) -> list[str]:
    """Return the links of a page that lead nowhere, and the files named that are not there."""
    links = [link for link in LINK.findall(text) if "://" not in link]
    lost = [link for link in links if not (page.parent / link).exists()]
    named = FILE.findall(text)
    return lost + [file for file in named if not any((root / file).exists() for root in ROOTS)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(README.parent)))
def test_links_and_files_of_a_page_are_there(page: Path):
    assert missing(page, page.read_text(encoding="utf-8")) == []


def test_a_lost_link_and_a_lost_file_would_be_seen():
    text = (
        "[a](docs/README.md) [b](docs/none.md#x) `src/lib.rs` `flurries/none.rs` [c](https://c.d/e)"
    )
    assert missing(README, text) == ["docs/none.md", "flurries/none.rs"]


def test_the_index_of_internals_answers_ten_questions_by_two_files_at_most():
    page = README.parent / "docs" / "internals" / "README.md"
    table = page.read_text(encoding="utf-8").split("## Where to look")[1]
    rows = [line.split(" | ") for line in table.splitlines() if "? |" in line]
    assert len(rows) == 10
    for question, answer in rows:
        named = FILE.findall(answer)
        assert 1 <= len(named) <= 2, question
        # What it says to look for in the first file stands in one of them.
        text = "".join((README.parent / file).read_text(encoding="utf-8") for file in named)
        words = re.findall(r"\(`([\w:]+)`", answer) + re.findall(r", `(\w+)`\)", answer)
        assert all(word.split("::")[-1] in text for word in words), question
