"""The arrows of the package and of the Rust tree: imports go one way, down to the kernels."""

import ast
import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

REPOSITORY = Path(__file__).parents[1]
ROOT = REPOSITORY / "python" / "flurries"

# From the bottom up; a module belongs to the longest name that it begins with. Modules of one level
# may import each other where that makes no circle.
LEVELS = (
    ("_build", "_core", "_contract", "_kept", "_ahead", "_threads", "_warnings", "_trace"),
    ("io",),
    # A camera is an argument of the array modules.
    ("camera.lens",),
    ("spectral", "particles", "gas", "cone", "composite", "stereo"),
    ("camera", "motion", "light"),
    ("frame",),
    ("effects",),
    ("scene",),
    ("output",),
    ("augment", "matching", "viewer"),
    ("cli", "__main__"),
)

# What a user may call on a scene although it stands above it, imported when it is called.
DOORS = {
    ("scene.rendering", "frame.plan"),
    ("scene.rendering", "scene.accuracy"),
    ("scene.rendering", "output.write"),
    ("scene.rendering", "output.cluster"),
    ("scene.scene", "scene.toml"),
    ("viewer", "viewer.widget"),
}

# Libraries that take long to import, or need not be there.
HEAVY = {
    "OpenImageIO", "PIL", "asyncio", "av", "dask", "distributed", "fileseq", "importlib.metadata",
    "matplotlib", "pxr", "pycocotools", "resource", "skimage", "tomli_w", "torch", "tqdm",
    "webbrowser",
}  # fmt: skip

# They import inside functions and are being cleaned: each must go from here, and none may come.
REMAINING = {"spectral.volume"}


class Arrow(NamedTuple):
    """An import: from a module of the package to another, or to a library."""

    source: str
    target: str
    inside: bool  # In a function.
    typing: bool  # For type checkers alone.
    own: bool  # Of the package.

    @property
    def at_a_door(self) -> bool:
        return (self.inside or self.typing) and (self.source, self.target) in DOORS


def read(root: Path) -> dict[str, str]:
    """Return the modules' texts; the package's own `__init__`, which has names only, is none."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        name = ".".join(part for part in parts if part != "__init__")
        if name:
            found[name] = path.read_text("utf-8")
    return found


def targets(node: ast.Import | ast.ImportFrom, known: set[str]) -> list[tuple[str, bool]]:
    """Return what a statement imports, and whether that is of the package."""
    if isinstance(node, ast.Import):
        return [(n.name.removeprefix("flurries."), "flurries" in n.name) for n in node.names]
    module = node.module or ""
    if module.split(".")[0] != "flurries":
        return [(module, False)]
    base = module.removeprefix("flurries").removeprefix(".")
    inner = {f"{base}.{name.name}".removeprefix(".") for name in node.names}
    # The version is the extension's.
    inner = {"_core" if one == "__version__" else one for one in inner}
    return [(name, True) for name in {one if one in known or not base else base for one in inner}]


def arrows(sources: dict[str, str]) -> list[Arrow]:
    known, found = {*sources, "_core"}, []

    def walk(name: str, node: ast.AST, inside: bool, typing: bool) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.Import, ast.ImportFrom)):
                for target, own in targets(child, known):
                    found.append(Arrow(name, target, inside, typing, own))
            function = isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
            checked = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.dump(child.test)
            walk(name, child, inside or function, typing or checked)

    for name, text in sources.items():
        walk(name, ast.parse(text), False, False)
    return found


def level(name: str) -> int:
    """Return how high a module stands; what nobody placed stands above all."""
    fits = [
        (len(start), number)
        for number, starts in enumerate(LEVELS)
        for start in starts
        if f"{name}.".startswith(f"{start}.")
    ]
    return max(fits)[1] if fits else len(LEVELS)


def breaches(found: list[Arrow]) -> set[tuple[str, str]]:
    free = [arrow for arrow in found if not arrow.at_a_door]
    up = {(a.source, "upwards") for a in free if a.own and level(a.target) > level(a.source)}
    light = [a for a in free if a.inside and not HEAVY & {a.target, a.target.split(".")[0]}]
    return up | {(arrow.source, "inside") for arrow in light}


def circle(found: list[Arrow]) -> set[str]:
    """Return the modules of a ring that import, by whatever way, themselves."""
    after: dict[str, set[str]] = {}
    for arrow in found:
        # Types of a file beside it are no arrow, and doors are closed while a module is imported.
        beside = arrow.typing and arrow.source.split(".")[0] == arrow.target.split(".")[0]
        package = f"{arrow.source}.".startswith(f"{arrow.target}.")
        if arrow.own and not (beside or arrow.at_a_door or package):
            after.setdefault(arrow.source, set()).add(arrow.target)

    try:
        TopologicalSorter(after).prepare()
    except CycleError as error:
        return set(error.args[1])
    return set()


def test_arrows_go_one_way_without_circles_and_imports_stand_at_the_top():
    sources = read(ROOT)
    found = arrows(sources)
    assert len(found) > 300
    assert [name for name in sources if level(name) == len(LEVELS)] == []
    assert circle(found) == set()
    assert breaches(found) == {(name, "inside") for name in REMAINING}


GOOD = {
    "_contract": "", "scene.scene": "", "frame.a": "import numpy\nfrom flurries.io import fit",
    "io": "from flurries._contract import real",
    "scene.rendering": "def write():\n    from flurries.output.write import write",
    "output.write": "from flurries.scene.scene import Scene\ndef film():\n    import av.video",
    "frame.b": "from flurries.frame.a import A",
}  # fmt: skip


@pytest.mark.parametrize(("module", "line", "wrong"), [
    ("frame.a", "from flurries.scene import scene", "upwards"),
    ("frame.a", "import flurries.scene.scene", "upwards"),
    ("io", "if TYPE_CHECKING:\n    from flurries.scene.scene import Scene", "upwards"),
    ("output.write", "class A:\n    def f(self):\n        import json", "inside"),
    ("frame.a", "def f():\n    from flurries.frame import b", "circle"),
])  # fmt: skip
def test_a_wrong_arrow_would_be_seen(module: str, line: str, wrong: str):
    assert breaches(arrows(GOOD)) == circle(arrows(GOOD)) == set()
    spoilt = arrows({**GOOD, module: f"{GOOD[module]}\n{line}"})
    if wrong == "circle":
        assert circle(spoilt) == {"frame.a", "frame.b"}
    else:
        assert (module, wrong) in breaches(spoilt)


SUBJECTS = {"air", "cone", "encode", "falling", "gas", "particles", "spectral"}

# What a folder may read besides itself.
BELOW = {
    "base": set(), "frame": {"base", "particles", "spectral"},
    "python": {"base", "frame", *SUBJECTS}, "lib.rs": set(),
    **{subject: {"base"} for subject in SUBJECTS}, "falling": {"air", "base", "particles"},
}  # fmt: skip

# Rust without its comments, by file.
CODE = {
    path.relative_to(REPOSITORY): re.sub(r"//.*", "", path.read_text("utf-8"))
    for path in sorted((REPOSITORY / "src").rglob("*.rs"))
}


def folders_of(text: str) -> set[str]:
    found = set(re.findall(r"\bcrate::(\w+)", text))
    for several in re.findall(r"\bcrate::\{([^;]*)\};", text):
        found |= set(re.findall(r"(?:^|,)\s*(\w+)", several))
    return found


def test_no_arrow_points_up_or_across():
    assert {path.parts[1] for path in CODE} == set(BELOW)
    wrong = {path: folders_of(text) - {path.parts[1]} - BELOW[path.parts[1]]
             for path, text in CODE.items()}  # fmt: skip
    assert {path: names for path, names in wrong.items() if names} == {}
    seen = "use crate::{base, cone::area}; let hash = crate::particles::torus::hash();"
    assert folders_of(seen) == {"base", "cone", "particles"}


def test_unsafe_stands_where_the_page_says():
    page = (REPOSITORY / "docs" / "internals" / "architecture.md").read_text()
    part = page.split("\n## Unsafe\n")[1].split("\n## ")[0]
    found = sorted(str(path) for path, text in CODE.items() if re.search(r"\bunsafe\b", text))
    assert sorted(re.findall(r"`(src/[\w/]+\.rs)`", part)) == found
    assert f"These {len(found)} files" in part
    for file, word in (("src/lib.rs", "deny"), ("crates/fft/src/lib.rs", "forbid")):
        assert f"#![{word}(unsafe_code)]" in (REPOSITORY / file).read_text()
