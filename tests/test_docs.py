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


def test_the_page_on_matching_runs():
    text = (README.parent / "docs" / "matching.md").read_text(encoding="utf-8")
    assert run_blocks(text) == text.count("```python") >= 1


def test_the_page_on_augmentation_runs():
    text = (README.parent / "docs" / "augment.md").read_text(encoding="utf-8")
    assert run_blocks(text) == text.count("```python") >= 1


def test_the_readme_reader_runs_blocks_in_order():
    page = "```python\nx = 1\n```\nwords\n```text\nx = 1 / 0\n```\n"
    page += "```python\nassert x == {}\n```\n"
    assert run_blocks(page.format(1)) == 2
    with pytest.raises(AssertionError):
        run_blocks(page.format(2))
