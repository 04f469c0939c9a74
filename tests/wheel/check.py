"""Check what `make wheel` made: its contents, and that it runs where there is no Rust.

    python tests/wheel/check.py dist [--all]
    python tests/wheel/check.py dist --bare python3.10 python3.12 python3.13

The suite runs against the wheel from a copy of tests/ in a new environment without `cargo`. Then a
wheel is built from the source archive, which must hold the same files. With --bare each Python
named gets an environment with the wheel alone, and its seconds and megabytes are held to a limit.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# What tests of the suite need beside the package, without the tools that build it.
NEEDS = ["pytest", "pytest-xdist", "hypothesis", "mpmath", "scipy", "matplotlib",
         "dask[array,distributed]", "av", "usd-core", "scikit-image"]  # fmt: skip
SMOKE = ["spectral_twin", "spectral_steps", "particles", "gas", "cone", "composite", "augment",
         "scene", "io_pictures", "gate", "cli", "public"]  # fmt: skip
# They read pages, notebooks, benches or examples, or build.
OF_THE_REPOSITORY = ["benches", "budget", "docs", "falling", "faults", "own_effect", "structure",
                     "types"]  # fmt: skip

WHEEL = re.compile(r"flurries-[\w.]+-cp310-abi3-(manylinux[\w.]+|macosx\w+|win\w+)\.whl")
IN_WHEEL = re.compile(
    r"flurries/.*\.(py|pyi|js|css|html|jpg)|flurries/py\.typed|flurries/_core\.\w*\.?(so|pyd)"
    r"|flurries-[^/]*\.dist-info/(METADATA|WHEEL|RECORD|entry_points\.txt|licenses/LICENSE[\w-]*)"
)
IN_ARCHIVE = re.compile(
    r"(PKG-INFO|Cargo\.(toml|lock)|pyproject\.toml|rustfmt\.toml|Makefile|\.gitignore"
    r"|(README|CHANGELOG|CONTRIBUTING)\.md|CITATION\.cff|deny\.toml|LICENSE[\w-]*"
    r"|(src|crates)/.*\.(rs|toml)|python/flurries/.*\.(py|pyi|js|css|html|jpg|typed)"
    r"|(tests|docs|benches|examples|notebooks)/.*\.(py|rs|md|txt|ipynb|npz|npy|png|jpg|css|js|exr|json|toml))"
)


def main() -> None:
    parser = argparse.ArgumentParser(description="Check a wheel and a source archive.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--all", action="store_true", help="run all tests that can run")
    parser.add_argument("--bare", nargs="+", metavar="PYTHON", help="install and render, no more")
    options = parser.parse_args()
    (wheel,) = options.folder.resolve().glob("*.whl")
    for python in options.bare or ():
        with tempfile.TemporaryDirectory() as folder:
            try_bare(python, wheel, Path(folder))
    if options.bare:
        return
    (archive,) = options.folder.resolve().glob("*.tar.gz")
    check_wheel(wheel)
    check_archive(archive)
    with tempfile.TemporaryDirectory() as folder:
        try_wheel(wheel, Path(folder), options.all)
        build_archive(archive, wheel, Path(folder))
    print(f"{wheel.name} and {archive.name}: in order")


def check_wheel(wheel: Path) -> None:
    assert WHEEL.fullmatch(wheel.name), f"{wheel.name}: not an abi3 wheel for a known platform"
    with zipfile.ZipFile(wheel) as opened:
        odd = [name for name in opened.namelist() if not IN_WHEEL.fullmatch(name)]
        assert not odd, f"stray files in the wheel: {odd}"
        have = {n for n in opened.namelist() if n.startswith("flurries/") and "_core." not in n}
        want = tracked("python/flurries") - {"flurries/_core.pyi"}
        assert have == want, f"differs from the repository: {sorted(have ^ want)}"
        for name in opened.namelist():
            for path in {str(Path.home()), str(ROOT)} - {"/"}:
                assert path.encode() + b"/" not in opened.read(name), f"{name} names {path}"


def check_archive(archive: Path) -> None:
    with tarfile.open(archive) as opened:
        names = [name.split("/", 1)[1] for name in opened.getnames()]
    odd = [name for name in names if not IN_ARCHIVE.fullmatch(name)]
    assert not odd, f"stray files in the source archive: {odd}"
    missing = {f"python/{name}" for name in tracked("python/flurries")} - set(names)
    assert not missing, f"not in the source archive: {sorted(missing)}"


def tracked(folder: str) -> set[str]:
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", folder], capture_output=True, text=True, check=True
    )
    return {name.split("/", 1)[1] for name in listed.stdout.split()}


PIP = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]

# What an install may bring, and how long the first picture may take.
MOST_MEGABYTES, MOST_SECONDS = 150.0, 60.0


def try_bare(python: str, wheel: Path, folder: Path) -> None:
    """Install the wheel into an environment of its own; print what that costs, and render."""
    home, env = folder / "bare", environment(folder / "bare")
    subprocess.run([python, "-m", "venv", str(home)], check=True)
    before, began = megabytes(home), time.monotonic()
    run(env, home / "bin" / "python", *PIP, wheel)
    installed, came = time.monotonic() - began, megabytes(home) - before
    write = "import flurries as fl; fl.io.write_picture('photo.png', fl.io.photograph())"
    run(env, home / "bin" / "python", "-c", write, cwd=folder)
    began = time.monotonic()
    words = ["render", "photo.png", "--snow", "heavy", "-o", "snowy.png"]
    run(env, home / "bin" / "flurries", *words, cwd=folder)
    took = time.monotonic() - began
    assert (folder / "snowy.png").stat().st_size > 10_000
    costs = f"installed in {installed:.1f} s, {came:.0f} MB; `flurries render` {took:.1f} s"
    print(f"{python}: {costs}", flush=True)
    assert came <= MOST_MEGABYTES, f"{came:.0f} MB came in, {MOST_MEGABYTES:g} at most"
    assert took <= MOST_SECONDS, f"a picture took {took:.0f} s, {MOST_SECONDS:g} at most"


def run(env: dict[str, str], *words: object, cwd: Path | None = None) -> None:
    subprocess.run([*map(str, words)], env=env, cwd=cwd, check=True)


def megabytes(folder: Path) -> float:
    said = subprocess.run(["du", "-sk", str(folder)], capture_output=True, text=True, check=True)
    return int(said.stdout.split()[0]) / 1000.0


def environment(home: Path) -> dict[str, str]:
    """Return variables under which no tool of Rust is found."""
    bare = {
        key: value for key, value in os.environ.items()
        if not key.startswith(("CARGO", "RUST", "PYTHON", "VIRTUAL_ENV"))
    }  # fmt: skip
    bare["PATH"] = f"{home / 'bin'}:/usr/bin:/bin"
    for tool in ("cargo", "rustc", "maturin"):
        assert shutil.which(tool, path=bare["PATH"]) is None, f"{tool} is on this machine's path"
    return bare


def try_wheel(wheel: Path, folder: Path, everything: bool) -> None:
    home, tests = folder / "bare", folder / "away" / "tests"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True)
    python, bare = home / "bin" / "python", environment(home)
    run(bare, python, *PIP, wheel)
    run(bare, python, *PIP, *NEEDS)
    shutil.copytree(ROOT / "tests", tests, ignore=shutil.ignore_patterns("__pycache__"))
    files = {path.stem.removeprefix("test_"): path for path in sorted(tests.glob("test_*.py"))}
    wanted = files.keys() - set(OF_THE_REPOSITORY) if everything else files.keys() & set(SMOKE)
    assert len(wanted) >= len(SMOKE)
    where = "import flurries, sys; sys.exit(not flurries.__file__.startswith(sys.prefix))"
    run(bare, python, "-c", where, cwd=tests)
    suite = ["-m", "pytest", "--quiet", "-n", "2", "-p", "no:cacheprovider"]
    run(bare, python, *suite, *(files[name] for name in sorted(wanted)), cwd=tests.parent)


def build_archive(archive: Path, wheel: Path, folder: Path) -> None:
    """Build a wheel from the source archive, as pip does where there is none for a platform."""
    # Libraries that are compiled already need not be again.
    env = {**os.environ, "CARGO_TARGET_DIR": str(ROOT / "target")}
    how = ["-m", "pip", "wheel", *PIP[3:], "--no-deps", "--wheel-dir", folder / "built"]
    run(env, sys.executable, *how, archive)
    (built,) = (folder / "built").glob("*.whl")
    with zipfile.ZipFile(built) as one, zipfile.ZipFile(wheel) as two:
        assert set(one.namelist()) == set(two.namelist()), "the archive's wheel is another"


if __name__ == "__main__":
    main()
