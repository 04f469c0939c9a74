"""Build the documentation site into site/: pages, gallery, notebooks and a reference from the code.

    python docs/site/build.py                 # as `make docs`: notebooks are run, their outputs shown
    python docs/site/build.py --quick         # as CI: notebooks without outputs, stills for films

Every warning is an error, and so is a link that leads nowhere or a type that is Any. Nothing is loaded from elsewhere.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
import time
from pathlib import Path

from sphinx.cmd.build import main as sphinx

sys.path.insert(0, str(Path(__file__).parent))

import commands
import links
import looking
import notebooks
import pictures
import reference
import scenes
import untyped

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

# Pages of the repository that are no pages of the site, and what stands for them there.
ELSEWHERE = {
    "../README.md": "index.md",
    "README.md": "index.md",
    "../notebooks": "notebooks/index.md",
    "../CHANGELOG.md": "changelog.md",
    "../CONTRIBUTING.md": "contributing.md",
}
LINK = re.compile(r"\]\(((?:\.\./)*(?:README|CHANGELOG|CONTRIBUTING)\.md|(?:\.\./)+notebooks)\)")
# Files of the repository, such as sources, are named on the site and not linked.
SOURCE = re.compile(r"\[([^\]]+)\]\((?:\.\./)+(?:benches|src|tests|python|examples)[^)]*\)")


def main() -> None:
    parser = argparse.ArgumentParser(description="Build the documentation site.")
    parser.add_argument("--quick", action="store_true", help="notebooks as they are, no films")
    parser.add_argument("--output", type=Path, default=ROOT / "site")
    options = parser.parse_args()
    began = time.monotonic()
    stage = ROOT / "build" / "site"
    shutil.rmtree(stage, ignore_errors=True)
    lay_out(stage)
    say("pictures of presets")
    pictures.write(stage, films=not options.quick)
    looking.write(stage)
    say("reference")
    reference.write(stage / "reference")
    scenes.write(stage / "reference")
    commands.write(stage / "reference")
    say("notebooks as they are" if options.quick else "running notebooks")
    notebooks.write(ROOT / "notebooks", stage / "notebooks", run=not options.quick)
    say("pages")
    made = ROOT / "build" / "html"
    shutil.rmtree(made, ignore_errors=True)
    arguments = ["-b", "html", "-W", "--keep-going", "-q", "-c", str(Path(__file__).parent)]
    if code := sphinx([*arguments, "-d", str(stage / ".cache"), str(stage), str(made)]):
        sys.exit(code)
    lost = links.lost(made)
    if lost:
        sys.exit("links that lead nowhere, or out of the site:\n" + "\n".join(lost))
    if vague := untyped.untyped(made):
        sys.exit("types that say nothing:\n" + "\n".join(vague))
    shutil.rmtree(options.output, ignore_errors=True)
    made.rename(options.output)
    count = len(links.pages_of(options.output))
    say(f"{count} pages in {options.output}, {time.monotonic() - began:.0f} s")


def lay_out(stage: Path) -> None:
    """Copy the pages and their pictures to where Sphinx reads them."""
    stage.mkdir(parents=True)
    for page in [*DOCS.glob("*.md"), *(DOCS / "internals").glob("*.md")]:
        target = stage / page.relative_to(DOCS)
        if page.name == "README.md":
            if page.parent == DOCS:
                continue
            target = target.with_name("index.md")
        target.parent.mkdir(exist_ok=True)
        target.write_text(localized(page.read_text(encoding="utf-8"), page), encoding="utf-8")
    for name, source in (("changelog.md", "CHANGELOG.md"), ("contributing.md", "CONTRIBUTING.md")):
        text = (ROOT / source).read_text(encoding="utf-8")
        (stage / name).write_text(localized(text, ROOT / source), encoding="utf-8")
    # Users find what is inside by its pages' links; its place is below that of who changes the code.
    ours = stage / "contributing.md"
    ours.write_text(ours.read_text("utf-8") + tree_of("internals/index"), encoding="utf-8")
    inner = stage / "internals" / "index.md"
    names = "\n".join(sorted(p.stem for p in inner.parent.glob("*.md") if p != inner))
    inner.write_text(inner.read_text(encoding="utf-8") + tree_of(names), encoding="utf-8")
    guides = stage / "howto.md"
    guides.write_text(with_others(guides.read_text(encoding="utf-8"), stage), encoding="utf-8")
    shutil.copytree(DOCS / "images", stage / "images")


def tree_of(names: str) -> str:
    """Return what puts pages below the one that it ends."""
    return f"\n```{{toctree}}\n:hidden:\n\n{names}\n```\n"


def with_others(guides: str, stage: Path) -> str:
    """Return the list of guides with the pages that it does not name, so that each is reached."""
    named = set(re.findall(r"^[\w/-]+$", guides + (stage / "index.md").read_text("utf-8"), re.M))
    own = {"index", "howto", "contributing"}
    others = sorted({page.stem for page in stage.glob("*.md")} - named - own)
    return guides.rstrip().removesuffix("```") + "\n".join([*others, "```\n"])


def localized(text: str, page: Path) -> str:
    """Return a page whose links to files of the repository lead to pages of the site."""
    text = SOURCE.sub(r"`\1`", text)
    text = text.replace("](../notebooks/", "](notebooks/")
    if page.parent == ROOT:
        text = text.replace("](docs/", "](")
    inside = page.parent.name == "internals"

    def to_page(found: re.Match[str]) -> str:
        place = found[1].removeprefix("../") if inside else found[1]
        if inside and not found[1].startswith("../"):
            return "](index.md)"
        return f"]({'../' if inside else ''}{ELSEWHERE[place]})"

    text = LINK.sub(to_page, text)
    return re.sub(r"\]\((\S*?)internals/README\.md\)", r"](\1internals/index.md)", text)


def say(text: str) -> None:
    print(f"site: {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
