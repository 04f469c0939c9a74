"""Print the lowest versions that pyproject.toml lets in, as pip takes them: `make test-lowest`."""

import re
import sys
from pathlib import Path

EXTRAS = ("test", "video", "view", "dask", "stores", "plots")


def lowest(text: str) -> list[str]:
    parts = [re.search(r"^dependencies = \[(.*?)^\]", text, re.M | re.S)]
    parts += [re.search(rf"^{extra} = \[(.*?)\]\n", text, re.M | re.S) for extra in EXTRAS]
    found: dict[str, str] = {}
    for part in parts:
        assert part is not None
        lines = re.findall(r'"([^"]+)"', part[1])
        for line in lines:
            wanted, _, marker = line.partition(";")
            if "< '3.11'" in marker and sys.version_info >= (3, 11):
                continue
            bound = re.match(r"([\w-]+)(\[[\w,]+\])?>=([0-9.]+)", wanted)
            assert bound is not None, f"{line}: without a lowest version"
            found.setdefault(f"{bound[1]}{bound[2] or ''}", bound[3])
    return [f"{name}=={version}" for name, version in found.items()]


if __name__ == "__main__":
    project = Path(__file__).parents[1] / "pyproject.toml"
    print(*lowest(project.read_text(encoding="utf-8")), sep="\n")
