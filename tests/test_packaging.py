"""What the package says of itself, and what it does without its extras."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import flurries as fl

ROOT = Path(__file__).parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text()
CORE = {"numpy", "openimageio", "pillow", "click", "fileseq", "tqdm", "tomli", "tomli-w"}


@pytest.mark.parametrize("call", [
    "fl.io.VideoWriter('new.mp4', (32, 24), 24)",
    "fl.Scene(size=(32, 24)).write('new.mp4', '1-2')",
    "fl.io.open_background('film.mkv')",
])  # fmt: skip
def test_without_the_library_for_films_the_error_names_the_extra(call: str, tmp_path: Path):
    with fl.io.VideoWriter(tmp_path / "film.mkv", (32, 24), 24) as film:
        film.write(np.zeros((24, 32, 3), np.uint8))
    code = f"import sys; sys.modules['av'] = None\nimport flurries as fl\ntry:\n    {call}\n"
    code += "except ImportError as error:\n    print(error)\n"
    code += "fl.Scene(size=(32, 24)).write('still.png', 1)"
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "pip install 'flurries[video]'" in ran.stdout
    left = {"film.mkv", "still.png", "flurries.jsonl"}
    assert {file.name for file in tmp_path.iterdir()} == left


def test_the_wheel_carries_the_notices_of_its_crates():
    lock = (ROOT / "Cargo.lock").read_text()
    crates = dict(re.findall(r'^name = "(.*)"\nversion = "(.*)"$', lock, re.M))
    notices = (ROOT / "LICENSE-CRATES").read_text()
    told = re.findall(r"^={8} (\S+) v(\S+) \((.+)\)\n\n(.+)", notices, re.M)
    # Ours, and what only builds: it leaves nothing in the extension.
    others = {"autocfg", "pyo3-build-config", "target-lexicon"}
    others |= {"flurries", "flurries-dispatch", "flurries-fft"}
    assert {name for name, *_ in told} == set(crates) - others
    assert all(crates[name] == version or name == "syn" for name, version, *_ in told)
    assert "LICENSE-CRATES" in re.findall(r"^license-files = .*", PROJECT, re.M)[0]


def test_the_citation_is_of_this_version_and_names_the_four_papers():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    cargo = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    (stands,) = re.findall(r'^version = "(.*)"$', cargo, re.M)[:1]
    assert f"\nversion: {stands}\n" in text
    assert re.findall(r"^    year: (\d+)$", text, re.M) == ["2004", "2003", "2005", "2004"]


def test_16_15_a_free_threaded_python_is_refused_with_a_sentence():
    code = (
        "import sys; sys.abiflags = 't'\ntry:\n    import flurries\nexcept ImportError as error:\n"
    )
    code += "    print(error)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.startswith("flurries does not run on a free-threaded Python: ")
    assert len(ran.stdout.splitlines()) == 1


def test_16_15_lowest_versions_are_those_that_the_project_names():
    done = subprocess.run(
        [sys.executable, ROOT / "tests" / "lowest.py"], capture_output=True, text=True, check=True
    )
    lowest = dict(line.split("==") for line in done.stdout.split())
    assert CORE - {"tomli"} <= {name.lower() for name in lowest} and lowest["numpy"] == "2.0"
    assert all(re.fullmatch(r"[0-9.]+", version) for version in lowest.values())
