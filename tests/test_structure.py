"""The arrows of the package: imports go one way, from the user's side to the kernels.

Read from the sources, so that an import counts wherever it stands: at the top of a module, inside a
function, or for type checkers alone.
"""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent / "python" / "flurries"

# From the bottom up; a module belongs to the longest name that it begins with. Modules of one level
# may import each other where that makes no circle.
LEVELS = (
    ("_build", "_core", "_contract", "_threads", "_warnings", "trace"),
    ("io",),
    # A camera is an argument of the array modules.
    ("camera.lens", "camera.rotation"),
    ("spectral", "particles", "gas", "cone", "composite", "stereo"),
    ("camera", "motion", "light"),
    ("frame",),
    ("effects",),
    ("scene",),
    ("output",),
    ("augment", "viewer"),
    ("cli", "__main__"),
)

# What a user may call on a scene although it stands above it, imported when it is called.
DOORS = {
    ("scene.rendering", "frame.plan"),
    ("scene.rendering", "scene.accuracy"),
    ("scene.rendering", "output.write"),
    ("scene.rendering", "output.groups"),
    ("scene.scene", "scene.toml"),
    ("viewer", "viewer.widget"),
    # The way of a camera is read from a file, and made of keys.
    ("io", "camera.csv"),
}

# Libraries that take long to import, or need not be there.
HEAVY = {
    "OpenImageIO", "PIL", "av", "dask", "distributed", "fileseq", "importlib.metadata",
    "matplotlib", "pxr", "skimage", "tomli_w", "tqdm", "webbrowser",
}  # fmt: skip

# Modules that import inside functions on 22 November 2026 and are being cleaned. Each must go from
# here, and none may come.
REMAINING = {"spectral.export"}


@dataclass(frozen=True)
class Arrow:
    """An import.

    Attributes
    ----------
    source, target : str
        Modules of the package without its name, or a library.
    inside : bool
        Whether it stands in a function.
    typing : bool
        Whether it is for type checkers alone.
    own : bool
        Whether the target is a module of the package.
    """

    source: str
    target: str
    inside: bool = False
    typing: bool = False
    own: bool = True

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"

    @property
    def at_a_door(self) -> bool:
        """Whether it is for a call that users like, or for the type of what that returns."""
        return (self.inside or self.typing) and (self.source, self.target) in DOORS


def modules(root: Path) -> dict[str, Path]:
    """Return the package's modules; its own `__init__`, which has names only, is none."""
    found = {}
    for path in sorted(root.rglob("*.py")):
        parts = list(path.relative_to(root).with_suffix("").parts)
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name:
            found[name] = path
    return found


def targets(node: ast.Import | ast.ImportFrom, known: set[str]) -> list[tuple[str, bool]]:
    """Return what a statement imports, and whether that is of the package."""
    if isinstance(node, ast.Import):
        return [
            (name.name.removeprefix("flurries."), "flurries" in name.name) for name in node.names
        ]
    module = node.module or ""
    if module.split(".")[0] != "flurries":
        return [(module, False)]
    base = module.removeprefix("flurries").removeprefix(".")
    found = set()
    for name in node.names:
        inner = f"{base}.{name.name}".removeprefix(".")
        # The version is the extension's.
        inner = "_core" if inner == "__version__" else inner
        found.add(inner if inner in known or not base else base)
    return [(name, True) for name in sorted(found)]


def arrows(sources: dict[str, str]) -> list[Arrow]:
    """Return all imports of modules given by their text."""
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


def folder(name: str) -> str:
    """Return the folder of a module."""
    return name.split(".")[0]


def level(name: str) -> int:
    """Return how high a module stands; what nobody placed stands above all."""
    fits = [
        (len(start), number)
        for number, starts in enumerate(LEVELS)
        for start in starts
        if name == start or name.startswith(start + ".")
    ]
    return max(fits)[1] if fits else len(LEVELS)


def breaches(found: list[Arrow]) -> set[str]:
    """Return the arrows that must not be, in words."""
    wrong = set()
    for arrow in found:
        if arrow.at_a_door:
            continue
        if arrow.own and level(arrow.target) > level(arrow.source):
            wrong.add(f"{arrow}: upwards")
        if arrow.inside and not (set(HEAVY) & {arrow.target, arrow.target.split(".")[0]}):
            wrong.add(f"{arrow}: inside a function")
    return wrong


def circles(found: list[Arrow]) -> list[list[str]]:
    """Return the groups of modules of which each imports, by whatever way, all others."""
    after: dict[str, set[str]] = {}
    for arrow in found:
        # Types of a file beside it are no arrow, and doors are closed while a module is imported;
        # the type of what comes through one is for checkers alone.
        beside = arrow.typing and folder(arrow.source) == folder(arrow.target)
        package = arrow.source.startswith(arrow.target + ".") or arrow.target == arrow.source
        if arrow.own and not beside and not arrow.at_a_door and not package:
            after.setdefault(arrow.source, set()).add(arrow.target)

    def reach(start: str) -> set[str]:
        seen, waiting = set(), [start]
        while waiting:
            for name in after.get(waiting.pop(), ()):
                if name not in seen:
                    seen.add(name)
                    waiting.append(name)
        return seen

    reached = {name: reach(name) for name in after}
    groups = {
        tuple(sorted(other for other in ends if name in reached.get(other, ())))
        for name, ends in reached.items()
        if name in ends
    }
    return [list(group) for group in sorted(groups)]


@pytest.fixture(scope="module")
def package() -> list[Arrow]:
    """The imports of the package."""
    found = arrows({name: path.read_text("utf-8") for name, path in modules(ROOT).items()})
    assert len(found) > 300
    return found


def test_modules_make_no_circle(package: list[Arrow]):
    assert circles(package) == []


def test_arrows_go_one_way_and_imports_stand_at_the_top(package: list[Arrow]):
    wrong = breaches(package)
    inside = {one.split(" ")[0] for one in wrong if one.endswith("inside a function")}
    assert {one for one in wrong if one.endswith("upwards")} == set()
    assert inside - REMAINING == set(), sorted(wrong)
    # One that is mended must be taken from the list.
    assert REMAINING - inside == set()


def test_every_module_has_a_level():
    assert [name for name in modules(ROOT) if level(name) == len(LEVELS)] == []


GOOD = {
    "_contract": "",
    "io": "from flurries._contract import real",
    "frame.layer": "import numpy\nfrom flurries.io import fit",
    "scene.scene": "",
    "scene.rendering": "from flurries.frame.layer import Frame\n"
                       "def write():\n    from flurries.output.write import write",
    "output.write": "from flurries.scene.scene import Scene\ndef film():\n    import av.video",
}  # fmt: skip


@pytest.mark.parametrize(
    ("module", "line", "wrong"),
    [
        ("frame.layer", "from flurries.scene.scene import Scene", "upwards"),
        ("frame.layer", "from flurries.scene import scene", "upwards"),
        ("frame.layer", "import flurries.scene.scene", "upwards"),
        ("io", "if TYPE_CHECKING:\n    from flurries.scene.scene import Scene", "upwards"),
        ("io", "def fit():\n    from flurries.frame.layer import Frame", "upwards"),
        ("_contract", "from flurries import Scene", "upwards"),
        ("output.write", "def f():\n    from flurries.io import fit", "inside a function"),
        ("output.write", "class A:\n    def f(self):\n        import json", "inside a function"),
        ("io", "from flurries.output.write import write", "upwards"),
    ],
)
def test_a_wrong_arrow_would_be_seen(module: str, line: str, wrong: str):
    assert breaches(arrows(GOOD)) == set()
    spoilt = breaches(arrows({**GOOD, module: f"{GOOD[module]}\n{line}"}))
    assert len(spoilt) >= 1 and any(one.endswith(wrong) for one in spoilt)


def test_a_circle_would_be_seen():
    assert circles(arrows(GOOD)) == []
    ring = {
        "frame.a": "from flurries.frame.b import B",
        "frame.b": "def f():\n    from flurries.frame.c import C",
        "frame.c": "from flurries.frame import a",
        "frame.d": "from flurries.frame.a import A",
    }
    assert circles(arrows(ring)) == [["frame.a", "frame.b", "frame.c"]]
    # Types of another folder count, those of the same one do not.
    beside = "if TYPE_CHECKING:\n    from flurries.{}.b import B"
    for where, count in (("frame", 0), ("io", 1)):
        pair = {"frame.a": beside.format(where), f"{where}.b": "from flurries.frame.a import A"}
        assert len(circles(arrows(pair))) == count
