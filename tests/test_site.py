"""The site's own parts: links that are judged, the pages made from the code, and what they lack."""

import re
import sys
from dataclasses import fields
from pathlib import Path

import pytest

import flurries as fl
from flurries.cli.main import COMMANDS
from flurries.effects.kinds import OURS

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "site"))

import absolute  # noqa: E402
import links  # noqa: E402


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
    page = (ROOT / "docs" / "site" / "commands.py").read_text(encoding="utf-8")
    files = [*(ROOT / "python").rglob("*.py"), *(ROOT / "src").rglob("*.rs")]
    read = {
        name for file in files
        for name in re.findall(r"\bFLURRIES_[A-Z_]+\b", file.read_text(encoding="utf-8"))
    }  # fmt: skip
    # Set by the shell's completion itself.
    read = {name for name in read if not name.endswith("_")}
    assert read - {"FLURRIES_COMPLETE"} == set(re.findall(r"^\| `(FLURRIES_\w+)`", page, re.M))


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages that come from the code."""
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
    text = absolute.absolute((ROOT / "README.md").read_text(encoding="utf-8"), "https://h/o/f")
    found = re.findall(r"(!?)\[[^\]]*\]\(([^)\s]+)\)", text)
    assert len(found) > 10
    assert all(link.startswith(("https://", "#")) for _, link in found)
    assert "](https://h/o/f/raw/main/docs/images/snow.webp)" in text
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert 'Homepage = "https://h/o/f"' in absolute.with_urls(project, "https://h/o/f")
