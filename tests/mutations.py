"""Change the package in one place at a time, at random, and see a test fail: `make mutations`.

Places are drawn from the syntax tree of the folders below; the same `--seed` draws the same ones.
Each change runs in a copy of its own, the tests that import the module first, up to the first
failure; a test counts that passes in a copy without the change.
"""

import argparse
import ast
import copy
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

ROOT = Path(__file__).parents[1]
TESTS, PACKAGE = ROOT / "tests", ROOT / "python" / "flurries"
FOLDERS = (
    "effects", "frame", "output", "augment", "scene", "camera", "motion", "light", "spectral",
)  # fmt: skip

# What an operator becomes: a boundary that moves, a comparison that turns round.
SWAPPED: dict[type[ast.AST], tuple[type[ast.AST], ...]] = {
    ast.Add: (ast.Sub,), ast.Sub: (ast.Add,), ast.Mult: (ast.Div,), ast.Div: (ast.Mult,),
    ast.And: (ast.Or,), ast.Or: (ast.And,), ast.Lt: (ast.LtE, ast.GtE), ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE), ast.GtE: (ast.Gt, ast.Lt), ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,), ast.Is: (ast.IsNot,), ast.IsNot: (ast.Is,), ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}  # fmt: skip
EXTREMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}


def is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def changed(node: ast.AST) -> Iterator[ast.AST]:
    """Yield a node with one thing changed, in each way that there is."""

    def edited(**fields: object) -> ast.AST:
        twin = copy.deepcopy(node)
        for name, value in fields.items():
            setattr(twin, name, value)
        return twin

    if isinstance(node, ast.BinOp) and not (is_text(node.left) or is_text(node.right)):
        yield from (edited(op=kind()) for kind in SWAPPED.get(type(node.op), ()))
    elif isinstance(node, ast.BoolOp):
        yield from (edited(op=kind()) for kind in SWAPPED[type(node.op)])
    elif isinstance(node, ast.Compare):
        for i, op in enumerate(node.ops):
            for kind in SWAPPED[type(op)]:
                yield edited(ops=[*node.ops[:i], kind(), *node.ops[i + 1 :]])
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield node.operand
    elif isinstance(node, ast.IfExp):
        yield edited(body=node.orelse, orelse=node.body)
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield edited(value=node.value + 1 if type(node.value) is int else 1.5 * node.value + 0.01)
    elif isinstance(node, ast.Name) and node.id in EXTREMES:
        yield edited(id=EXTREMES[node.id])
    elif isinstance(node, ast.Attribute) and node.attr in EXTREMES:
        yield edited(attr=EXTREMES[node.attr])


def parts(node: ast.AST) -> Iterator[tuple[ast.AST, str, int | None, ast.AST]]:
    """Yield the nodes below one with their place in it: no annotations, messages, type checks."""
    if isinstance(node, ast.Raise) or (
        isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
    ):
        return
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for i, child in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(child, ast.AST):
                yield node, name, i, child
                yield from parts(child)


def mutants(text: str) -> Iterator[tuple[ast.AST, ast.AST, ast.AST]]:
    """Yield a node, what stands there now, and the tree, which is changed until the next one."""
    tree = ast.parse(text)
    for parent, name, i, node in parts(tree):
        for other in changed(node):
            held = getattr(parent, name)
            setattr(parent, name, other if i is None else [*held[:i], other, *held[i + 1 :]])
            yield node, other, tree
            setattr(parent, name, held)


def tests_of(module: str) -> list[str]:
    """Return the test files, those first that import a module, then those of its package."""
    package, _, name = module.rpartition(".")
    own = rf"{re.escape(module)}\b|from {re.escape(package)} import .*\b{name}\b"
    ranks = [own, re.escape(package) + r"\b", r"import flurries|from flurries"]

    def rank(file: Path) -> int:
        text = file.read_text(encoding="utf-8")
        return next((i for i, words in enumerate(ranks) if re.search(words, text)), len(ranks))

    ranked = sorted((rank(file), str(file)) for file in TESTS.glob("test_*.py"))
    return [file for i, file in ranked if i < len(ranks)]


def first_failure(copied: Path, tests: list[str], seconds: float) -> str | None:
    """Return the first test that fails with a copy; None where all pass, "" if time was up."""
    paths = os.pathsep.join([str(copied), str(TESTS)])
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "--tb=no",
               "-rfE", "--rootdir", str(ROOT), *tests]  # fmt: skip
    running = subprocess.Popen(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": paths}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
    )  # fmt: skip
    try:
        said, _ = running.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        running.communicate()
        return ""
    if running.returncode == 0:
        return None
    found = re.search(r"^(?:FAILED|ERROR) (\S+)", said, re.MULTILINE)
    return found[1] if found else tests[0]


def verdict(number: int, path: Path, text: str, folder: Path, seconds: float) -> str:
    copied = folder / str(number)
    shutil.copytree(PACKAGE, copied / "flurries")
    (copied / "flurries" / path.relative_to(PACKAGE)).write_text(text, encoding="utf-8")
    module = ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
    tests = tests_of(module.removesuffix(".__init__"))
    while failed := first_failure(copied, tests, seconds):
        if first_failure(folder / "whole", [failed.split("[")[0]], seconds) is None:
            return f"caught by {failed}"
        print(f"  without any change {failed} fails too: left out", flush=True)
        tests += ["--deselect", failed]
    return "MISSED" if failed is None else f"MISSED in {seconds:.0f} s"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=60, help="how many changes")
    parser.add_argument("--seed", type=int, default=1, help="which of them")
    parser.add_argument("--seconds", type=float, default=600.0, help="the longest of one change")
    parser.add_argument("--list", action="store_true", help="print the changes and run nothing")
    given = parser.parse_args()
    files = sorted(path for name in FOLDERS for path in (PACKAGE / name).rglob("*.py"))
    places = [(path, i) for path in files for i, _ in enumerate(mutants(path.read_text("utf-8")))]
    drawn = random.Random(given.seed).sample(places, min(given.count, len(places)))
    caught = 0
    with tempfile.TemporaryDirectory() as name:
        shutil.copytree(PACKAGE, Path(name) / "whole" / "flurries")
        for number, (path, i) in enumerate(drawn):
            node, other, tree = next(islice(mutants(path.read_text("utf-8")), i, None))
            said = "drawn" if given.list else verdict(
                number, path, ast.unparse(tree), Path(name), given.seconds
            )  # fmt: skip
            caught += said.startswith("caught")
            where = f"{path.relative_to(PACKAGE)}:{getattr(node, 'lineno', 0)}"
            print(f"{where}: {ast.unparse(node)} -> {ast.unparse(other)}: {said}", flush=True)
    print(f"{caught} of {len(drawn)} caught, seed {given.seed}, of {len(places)} places")
    return 0 if given.list or caught == len(drawn) else 1


if __name__ == "__main__":
    sys.exit(main())
