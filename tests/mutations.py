"""Take guards away, one at a time, and see a hard case fail for each: `make mutations`.

Python's are patched in a copy of the package. Rust's are patched in a copy of the crate and built,
which takes a minute or two each; `make mutations WHAT=python` leaves them out, and
`make mutations WHAT="near plane"` takes the guards with these words alone. Each line of the output
names the guard and the cases that failed without it; a guard that nothing misses ends the run with
an error.
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


@dataclass(frozen=True)
class Mutation:
    """A guard: what it is, where it stands, and the text without it."""

    guard: str
    file: str
    old: str
    new: str


PYTHON = [
    Mutation("tables and vectors are finite", "_contract.py",
             "if finite and not _within(array, math.inf):", "if False:"),
    Mutation("numbers are finite", "_contract.py", "if not math.isfinite(number):", "if False:"),
    Mutation("running sums carry their rounding", "motion/keys.py", "sums[i] = total + lost",
             "sums[i] = total"),
    Mutation("the last key holds outside", "motion/keys.py",
             "self._sums[-1] + values[-1] * (t - frames[-1])", "self._sums[-1]"),
    Mutation("a series for small rotations", "camera/lens.py", "if angle < 1e-8:", "if False:"),
    Mutation("no image behind the eye", "camera/lens.py", "px[depth <= 0.0] = np.nan", "pass"),
    Mutation("no division by the forward speed", "camera/lens.py",
             "(p[2] * x - view.focal * p[0])[None, :]",
             "(p[2] * (x - view.focal * p[0] / p[2]))[None, :]"),
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
    Mutation("the near plane", "particles/project.rs",
             "(images.ends[0][at] >= lens.near) & (images.ends[1][at] >= lens.near)", "true"),
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


def failures(package: Path) -> list[str]:
    """The names of the hard cases that fail with a package."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), str(ROOT / "tests")])}
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--tb=no", "-rfE"]
    words += [str(ROOT / "tests" / "test_hard_cases.py"), "--rootdir", str(ROOT)]
    said = subprocess.run(words, capture_output=True, text=True, env=environment, cwd=package)
    pattern = r"^(?:FAILED|ERROR) \S+?::test_hard_case\[(.*)-float(?:32|64)\]"
    found = re.findall(pattern, said.stdout, re.MULTILINE)
    if said.returncode not in (0, 1):
        # Not even importable: every case fails.
        found.append("all: the package does not import")
    return sorted(set(found))


def patched(text: str, mutation: Mutation) -> str:
    if text.count(mutation.old) != 1:
        times = text.count(mutation.old)
        raise SystemExit(f"{mutation.file}: {mutation.old!r} stands there {times} times")
    return text.replace(mutation.old, mutation.new)


def in_python(mutation: Mutation, folder: Path) -> list[str]:
    package = folder / "flurries"
    shutil.copytree(ROOT / "python" / "flurries", package)
    file = package / mutation.file
    file.write_text(patched(file.read_text(encoding="utf-8"), mutation), encoding="utf-8")
    return failures(folder)


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
    jobs = [(in_python, m) for m in PYTHON] * (what != "rust")
    jobs += [(in_rust, m) for m in RUST] * (what != "python")
    if what not in ("all", "python", "rust"):
        jobs = [(run, mutation) for run, mutation in jobs if what in mutation.guard]
    with tempfile.TemporaryDirectory() as name:
        shutil.copytree(ROOT / "python" / "flurries", Path(name) / "whole" / "flurries")
        if found := failures(Path(name) / "whole"):
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
