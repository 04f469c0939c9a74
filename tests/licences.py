"""The licences of all packages that flurries needs, and of those that they need: `make audit`."""

import re
import sys
from importlib import metadata

# What may stand beside MIT or Apache-2.0 without asking anything of who uses flurries.
FREE = re.compile(
    r"MIT|BSD|Apache|ISC|PSF|Python Software Foundation|HPND|Zlib|0BSD|Unlicense|MPL|CC0", re.I
)


def needed(name: str, found: dict[str, str]) -> dict[str, str]:
    key = re.sub(r"[-_.]+", "-", name).lower()
    if key in found:
        return found
    try:
        about = metadata.distribution(key)
    except metadata.PackageNotFoundError:
        return found
    said = about.metadata
    told = [said.get("License-Expression") or "", (said.get("License") or "").split("\n")[0]]
    told += [line for line in said.get_all("Classifier") or [] if line.startswith("License")]
    found[key] = "; ".join(filter(None, told))
    for line in about.requires or []:
        if "extra ==" not in line:
            needed(re.match(r"[\w.-]+", line)[0], found)  # type: ignore[index]
    return found


def main() -> int:
    found = needed("flurries", {})
    for extra in ("av", "dask", "distributed", "fsspec", "anywidget", "matplotlib"):
        needed(extra, found)
    for name, licence in sorted(found.items()):
        print(f"{name}: {licence[:100] or 'nothing said'}")
    unfree = [name for name, licence in found.items() if not FREE.search(licence)]
    print(
        f"{len(found)} packages, of {len(unfree)} no known licence: {', '.join(unfree) or 'none'}"
    )
    return 1 if unfree else 0


if __name__ == "__main__":
    sys.exit(main())
