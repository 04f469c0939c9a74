"""Print what pyproject.toml wants for the extras named, or without any the lowest versions."""

import re
import sys
from pathlib import Path

EXTRAS = ("test", "video", "view", "dask", "stores", "plots")


def wanted(text: str, extras: tuple[str, ...]) -> list[str]:
    found: list[str] = []
    for name in ("dependencies", *extras):
        part = re.search(rf"^{name} = \[(.*?)\]\n", text, re.M | re.S)
        assert part is not None, f"no {name}"
        found += re.findall(r'"([^"]+)"', part[1])
    return found


def lowest(text: str) -> list[str]:
    found: dict[str, str] = {}
    for line in wanted(text, EXTRAS):
        name, _, marker = line.partition(";")
        if "< '3.11'" in marker and sys.version_info >= (3, 11):
            continue
        bound = re.match(r"([\w-]+)(\[[\w,]+\])?>=([0-9.]+)", name)
        assert bound is not None, f"{line}: without a lowest version"
        found.setdefault(f"{bound[1]}{bound[2] or ''}", bound[3])
    return [f"{name}=={version}" for name, version in found.items()]


if __name__ == "__main__":
    project = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    print(*(wanted(project, extras) if (extras := (*sys.argv[1:],)) else lowest(project)), sep="\n")
