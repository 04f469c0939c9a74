"""Make the README's links absolute and fill in project.urls, for a package index.

    python docs/site/absolute.py https://host/owner/flurries

The one place where the address of the repository is said. For a release's archive; not committed.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(!?)\[([^\]]*)\]\((?!https?://|#)([^)\s]+)\)")


def absolute(text: str, base: str) -> str:
    """Return a page whose links lead to the files of a repository, and pictures to their bytes."""

    def linked(found: re.Match[str]) -> str:
        bang, words, path = found.groups()
        return f"{bang}[{words}]({base}/{'raw' if bang else 'blob'}/main/{path})"

    return LINK.sub(linked, text)


def with_urls(project: str, base: str) -> str:
    """Return pyproject.toml with the addresses of a repository."""
    urls = (
        f'[project.urls]\nHomepage = "{base}"\nDocumentation = "{base}/blob/main/docs/README.md"\n'
        f'Changelog = "{base}/blob/main/CHANGELOG.md"\nIssues = "{base}/issues"\n\n'
    )
    return project.replace("[project.scripts]", urls + "[project.scripts]", 1)


def main() -> None:
    if len(sys.argv) != 2 or not re.fullmatch(r"https://\S+[^/]", sys.argv[1]):
        sys.exit(f"BASE must be an address like https://host/owner/flurries, got {sys.argv[1:]}")
    for name, change in (("README.md", absolute), ("pyproject.toml", with_urls)):
        path = ROOT / name
        path.write_text(change(path.read_text(encoding="utf-8"), sys.argv[1]), encoding="utf-8")


if __name__ == "__main__":
    main()
