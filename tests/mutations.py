"""Take guards away, one at a time, and see a test fail for each: `make mutations`.

Hard cases miss those of the kernels and of geometry, `test_public.py` those of the contract.
Python's are patched in a copy of the package. Rust's are patched in a copy of the crate and built,
which takes a minute or two each; `make mutations WHAT=python` leaves them out, `WHAT=contract`
takes those of the contract alone, `make mutations WHAT="near plane"` the guards with these words.
Each line of the output names the guard and the cases that failed without it, of the contract the
first one; a guard that nothing misses ends the run with an error.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
CONTRACTS = str(ROOT / "tests" / "test_public.py")


@dataclass(frozen=True)
class Mutation:
    """A guard: what it is, where it stands, and the text without it."""

    guard: str
    file: str
    old: str
    new: str


PYTHON = [
    Mutation("running sums carry their rounding", "motion/keys.py", "sums[i] = total + lost",
             "sums[i] = total"),
    Mutation("the last key holds outside", "motion/keys.py",
             "self._sums[-1] + values[-1] * (t - frames[-1])", "self._sums[-1]"),
    Mutation("a series for small rotations", "camera/rotation.py", "if angle < 1e-8:", "if False:"),
    Mutation("no image behind the eye", "camera/lens.py", "px[depth <= 0.0] = np.nan", "pass"),
    Mutation("no division by the forward speed", "camera/tiles.py",
             "(ahead * x - fx * right)[None, :]", "(ahead * (x - fx * right / ahead))[None, :]"),
    Mutation("paths go on linearly", "camera/path.py", "before + (t - i) * (after - before)",
             "before + min(max(t - i, 0.0), 1.0) * (after - before)"),
    Mutation("billboard errors have a domain", "gas/billboards.py",
             "    result[~seen] = np.nan\n    return result\n\n\ndef _share",
             "    return result\n\n\ndef _share"),
    Mutation("parallax errors are no difference of two", "gas/billboards.py",
             'if choice("form", form, FORMS) == "printed":\n        eyes',
             "if True:\n        eyes"),
    Mutation("the cone's axis keeps its side", "cone/path.py",
             "(axis, pace) if axis @ last >= 0.0 else (-axis, -pace)", "(axis, pace)"),
]  # fmt: skip

# Without `_contract.py` the rest of the package would take anything. Two of its lines are not here,
# since NumPy and a kernel refuse the same: arrays as numbers, and overlaps as large as the tile.
CONTRACT = [
    Mutation(guard, "_contract.py", old, new) for guard, old, new in (
        ("a bool is no integer",
         "if isinstance(value, (bool, np.bool_)):\n        raise", "if False:\n        raise"),
        ("a float is no integer", "number = operator.index(value)", "number = int(value)"),
        ("integers have a range",
         "if not low <= number <= high:\n        raise", "if False:\n        raise"),
        ("no range at the short way", "type(value) is int and low <= value <= high",
         "type(value) is int"),
        ("a word is no number",
         "(str, bytes, bool, np.bool_, complex, np.complexfloating)", "(bool, np.bool_, complex)"),
        ("a bool is no number", "(str, bytes, bool, np.bool_, complex", "(str, bytes, complex"),
        ("too large an integer is no number", "except OverflowError:", "except RecursionError:"),
        ("what is no number is named", "except (TypeError, ValueError):\n        raise TypeError(f",
         "except RecursionError:\n        raise TypeError(f"),
        ("numbers are finite", "if not math.isfinite(number):", "if False:"),
        ("numbers above 0", "if number <= above:", "if False:"),
        ("numbers within bounds", "if not low <= number <= high:\n        wanted",
         "if False:\n        wanted"),
        ("a flag is a bool", "if isinstance(value, (bool, np.bool_)):\n        return bool(value)",
         "if True:\n        return bool(value)"),
        ("a choice is a word", "if not isinstance(value, str):", "if False:"),
        ("a choice is one of a few", "if value not in options:", "if False:"),
        ("a shape is a row", "if isinstance(value, (str, bytes)) or not rows:", "if False:"),
        ("a shape is two", "if len(value) != 2:", "if False:"),
        ("a shape has a pixel", "1 <= tall <= 2**16", "tall <= 2**16"),
        ("a height is at least 1", "value[0], low=1", "value[0], low=-9"),
        ("a width is at least 1", "value[1], low=1", "value[1], low=-9"),
        ("a picture fits somewhere", "if height * width > MOST_ELEMENTS:", "if False:"),
        ("an overlap is less than the tile", "0 <= overlap < tile <= 2**15",
         "tile <= 2**15"),
        ("a seed fits 64 bits", "low=-(2**63), high=2**63 - 1", "low=-(2**90), high=2**90"),
        ("a dtype is of floats", "if dtype is None or wanted not in", "if False and wanted not in"),
        ("a dtype is a dtype",
         "TypeError:\n        raise TypeError(f\"dtype",
         "RecursionError:\n        raise TypeError(f\"dtype"),
        ("rows are alike", "    except ValueError:\n", "    except RecursionError:\n"),
        ("arrays hold real numbers", "if array.dtype.kind not in \"iuf\":", "if False:"),
        ("a bool is no array of numbers", "not in \"iuf\"", "not in \"iufb\""),
        ("tables are float64 in C order",
         "np.ascontiguousarray(_numeric(name, value), dtype=np.float64)",
         "np.asarray(_numeric(name, value), dtype=np.float64)"),
        ("tables are aligned",
         "    if not array.flags.aligned:\n        array = array.copy()\n", ""),
        ("tables have dimensions", "if ndim is not None and array.ndim != ndim:", "if False:"),
        ("tables are finite", "if finite and not _within(array, math.inf):", "if False:"),
        ("vectors are moderate", "> LARGEST:\n", "> math.inf:\n"),
        ("bounds are looked at", "if not _within(array, LARGEST):", "if False:"),
        ("NaN is not within", "size <= most and size < math.inf", "not size > most"),
        ("vectors have a length", "if array.shape != (length,):", "if False:"),
        ("pixels have dimensions", "    if array.ndim != ndim:", "    if False:"),
        ("pixels are there", "if 0 in array.shape:", "if False:"),
        ("integers are numbers in float64", "np.dtype(np.float64), np.dtype(np.float64)",
         "np.dtype(np.float32), np.dtype(np.float32)"),
        ("half comes back as half", "np.dtype(np.float32), np.dtype(np.float16)",
         "np.dtype(np.float32), np.dtype(np.float32)"),
        ("pixels keep their dtype", "working = kept = array.dtype.newbyteorder(\"=\")",
         "working = kept = np.dtype(np.float32)"),
        ("pixels are native", "array.dtype.newbyteorder(\"=\")", "array.dtype"),
        ("depths are more than 0", "require(name, array, array > 0.0, wanted)", "pass"),
        ("pixels are in C order", "np.ascontiguousarray(array, dtype=dtype)",
         "np.asarray(array, dtype=dtype)"),
        ("pixels are aligned", "result if result.flags.aligned else result.copy()", "result"),
        ("out is an array", "if not isinstance(out, np.ndarray):", "if False:"),
        ("out has a dtype", "if out.dtype != dtype or not out.dtype.isnative:", "if False:"),
        ("out has a shape", "if out.shape != shape:", "if False:"),
        ("out is in C order", "if not (out.flags.c_contiguous and out.flags.aligned):",
         "if not out.flags.aligned:"),
        ("out is aligned",
         "out.flags.c_contiguous and out.flags.aligned", "out.flags.c_contiguous"),
        ("out may be written", "if not out.flags.writeable:", "if False:"),
        ("out is no input", "if any(np.may_share_memory(out, given) for given in inputs):",
         "if False:"),
        ("messages are short", "text if len(text) <= 60 else", "text if True else"),
    )
]  # fmt: skip

RUST = [
    Mutation("no numerator on an axis' own Nyquist line", "spectral/grid.rs",
             "if is_nyquist(k, n) { 0.0 } else { k as f64 / n as f64 }", "k as f64 / n as f64"),
    Mutation("half a cycle is cut with a margin", "spectral/filter.rs", "0.5 - 1e-12",
             "0.5 + 1e-12"),
    Mutation("the shutter's lobes keep their sign", "spectral/filter.rs",
             "else { libm::sin(angle) / angle }", "else { (libm::sin(angle) / angle).abs() }"),
    Mutation("the band is half open", "spectral/band.rs",
             "radius * self.shortest.powi(2) < limit", "radius * self.shortest.powi(2) <= limit"),
    Mutation("the band is not empty", "spectral/band.rs",
             "if !(low >= 2.0 && low < high)", "if false"),
    Mutation("phases in float64", "spectral/tent.rs",
             "reduce(phase + motion.step_at(row, col, shape))",
             "reduce(phase + f64::from(motion.step_at(row, col, shape) as f32))"),
    Mutation("phases of the texture in float64", "spectral/spectrum.rs",
             "*out = motion.step((ty, tx), (0.0, 0.0));",
             "*out = f64::from(motion.step((ty, tx), (0.0, 0.0)) as f32);"),
    Mutation("places below the box are folded", "particles/torus.rs",
             "if folded < -0.5 * side", "if false"),
    Mutation("flakes have a least width", "base/sampling.rs",
             "const LEAST_VARIANCE: f64 = 0.38", "const LEAST_VARIANCE: f64 = 0.01"),
    Mutation("short streaks by a series", "particles/streak.rs",
             "let short = length < P::SHORT;", "let short = length < 1e-30;"),
    Mutation("the near plane, crossed", "particles/sprite.rs",
             "let (from, to) = kept(middle[2], flake.travel[2], lens.near)?;",
             "let (from, to) = kept(middle[2], flake.travel[2], 1e-9)?;"),
    Mutation("alpha 0 keeps the background's bits", "frame/mix.rs",
             ".replaced(alpha, zero, behind)", ""),
    Mutation("alpha 0 keeps the background's bits, one by one", "frame/mix.rs",
             "if alpha == T::zero()", "if false"),
    Mutation("integers are rounded", "frame/sample.rs", ".min(Self::splat(most))",
             ".min(Self::splat(most)).sub(Self::splat(0.5))"),
    Mutation("integers are rounded one by one", "frame/sample.rs", "clipped + 8_388_608.0",
             "clipped.floor() + 8_388_608.0"),
    Mutation("gas is integrated over small pixels", "gas/footprint.rs",
             "pub const POINT_FROM: f64 = 2.0", "pub const POINT_FROM: f64 = 0.0"),
    Mutation("1 + cos without cancellation", "cone/basis.rs",
             "let one_plus_cos = 0.5 * dot(sum, sum);",
             "let one_plus_cos = 1.0 + dot(DOWN, axis);"),
    Mutation("denominators of the mapping have a floor", "cone/view.rs",
             "const FLOOR: f64 = 1e-6", "const FLOOR: f64 = 0.0"),
    Mutation("azimuth 1 is 0", "cone/view.rs", "if azimuth >= 1.0 { 0.0 } else { azimuth }",
             "azimuth"),
]  # fmt: skip


def failures(package: Path, *tests: str) -> list[str]:
    """The names of the cases that fail with a package: of all hard ones, or the first of others."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), str(ROOT / "tests")])}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=no", "-rfE"]
    words += ["--rootdir", str(ROOT)]
    words += ["-x", *tests] if tests else [str(ROOT / "tests" / "test_hard_cases.py")]
    said = subprocess.run(words, capture_output=True, text=True, env=environment, cwd=package)
    found = re.findall(r"^(?:FAILED|ERROR) \S+?::(.*?)(?: - .*)?$", said.stdout, re.MULTILINE)
    found = [re.sub(r"^test_hard_case\[(.*)\]$", r"\1", name) for name in found]
    if said.returncode not in (0, 1):
        # Not even importable: every case fails.
        found.append("all: the package does not import")
    return sorted(set(found))


def patched(text: str, mutation: Mutation) -> str:
    if text.count(mutation.old) != 1:
        times = text.count(mutation.old)
        raise SystemExit(f"{mutation.file}: {mutation.old!r} stands there {times} times")
    return text.replace(mutation.old, mutation.new)


def in_python(mutation: Mutation, folder: Path, *tests: str) -> list[str]:
    package = folder / "flurries"
    shutil.copytree(ROOT / "python" / "flurries", package)
    file = package / mutation.file
    file.write_text(patched(file.read_text(encoding="utf-8"), mutation), encoding="utf-8")
    return failures(folder, *tests)


def in_contract(mutation: Mutation, folder: Path) -> list[str]:
    return in_python(mutation, folder, CONTRACTS)


def in_rust(mutation: Mutation, folder: Path) -> list[str]:
    for name in ("src", "crates", "benches"):
        shutil.copytree(ROOT / name, folder / name)
    for name in ("Cargo.toml", "Cargo.lock"):
        shutil.copy(ROOT / name, folder / name)
    file = folder / "src" / mutation.file
    file.write_text(patched(file.read_text(encoding="utf-8"), mutation), encoding="utf-8")
    target = ROOT / "target" / "mutations"
    fast = {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16",
            "CARGO_TARGET_DIR": str(target), "PYO3_PYTHON": sys.executable}  # fmt: skip
    subprocess.run(["cargo", "build", "--release", "--lib", "--features", "python", "--quiet"],
                   cwd=folder, env={**os.environ, **fast}, check=True)  # fmt: skip
    package = folder / "package"
    shutil.copytree(ROOT / "python" / "flurries", package / "flurries")
    libraries = (target / "release").glob("*_core.*")
    built = next(path for path in libraries if path.suffix in (".so", ".dylib"))
    shutil.copy(built, package / "flurries" / "_core.abi3.so")
    return failures(package)


def main(what: str) -> int:
    missed = 0
    jobs = [(in_python, m) for m in PYTHON] * (what not in ("rust", "contract"))
    jobs += [(in_contract, m) for m in CONTRACT] * (what != "rust")
    jobs += [(in_rust, m) for m in RUST] * (what not in ("python", "contract"))
    if what not in ("all", "python", "contract", "rust"):
        jobs = [(run, mutation) for run, mutation in jobs if what in mutation.guard]
    with tempfile.TemporaryDirectory() as name:
        shutil.copytree(ROOT / "python" / "flurries", Path(name) / "whole" / "flurries")
        for tests in ((), (CONTRACTS,)):
            if found := failures(Path(name) / "whole", *tests):
                raise SystemExit(f"cases fail with every guard in its place: {found}")
        for number, (run, mutation) in enumerate(jobs):
            folder = Path(name) / str(number)
            folder.mkdir()
            found = run(mutation, folder)
            missed += not found
            shown = "; ".join(found[:3]) + (
                f"; and {len(found) - 3} more" if len(found) > 3 else ""
            )
            print(f"{mutation.guard}: {shown or 'NOTHING MISSES IT'}", flush=True)
            shutil.rmtree(folder)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else "all"))
