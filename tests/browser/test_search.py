"""The site's search in a real browser: what a new user types leads to the page that answers."""

import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote_plus

import pytest
from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).parents[2]
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
ROWS = "[...document.querySelectorAll('#search-results ul.search > li > a')].map(a => a.pathname)"

# The question; what is typed, in two ways; the pages that answer it.
QUESTIONS: list[tuple[str, tuple[str, str], set[str]]] = [
    ("Which key makes the snow stop?", ("stop snow", "emission"), {"film", "faq"}),
    ("How do I get only the layer?", ("only the layer", "transparent png"), {"layers", "faq"}),
    ("What does severity mean?", ("severity", "intensity"), {"snow", "augment"}),
    ("How do I use my tracker's camera?", ("tracker camera", "nuke camera"), {"camera"}),
    ("What is written where?", ("files written", "output folder"), {"film", "faq"}),
    ("Why are my files refused?", ("file exists", "overwrite"), {"film", "faq"}),
    ("How do I get more or larger flakes?", ("more flakes", "flake size"), {"snow", "faq"}),
    ("How do I ask for real amounts?", ("mm per hour", "snowfall rate"), {"snow", "faq"}),
    ("How do I get the same snow again?", ("same snow again", "random seed"), {"faq"}),
    ("How long does it take?", ("how long", "render time"), {"plan", "faq"}),
    ("How does it become faster?", ("faster", "speed up"), {"plan", "faq"}),
    ("How do I hide snow behind things?", ("hide snow behind", "depth map"), {"depth", "faq"}),
    ("How does a film loop?", ("seamless loop", "loop"), {"film"}),
    ("How do I light it with a lamp?", ("street lamp", "night"), {"light", "looks"}),
    ("Where are labels for training?", ("bounding boxes", "pytorch"), {"augment", "faq"}),
    ("How do I make an anaglyph?", ("3d glasses", "anaglyph"), {"stereo", "reference/stereo"}),
    ("Does it know ACES?", ("aces", "ocio"), {"shot"}),
    ("How do I render on a farm?", ("render farm", "slurm"), {"clusters"}),
    ("Can I make my own effect?", ("custom effect", "plugin"), {"your-own-effect"}),
    ("Which keys has a scene file?", ("scene.toml", "scene file"), {"reference/scene-toml"}),
    ("How do I install and cite it?", ("install", "bibtex"), {"start", "cite"}),
    ("What if I mistype?", ("shuter angle", "coco yolo xylophone"), {"faq", "augment"}),
    ("Is there a plug-in, or snow on things?", ("after effects", "snow on the ground"), {"limits"}),
    ("Is there a texture for a game?", ("game engine", "tileable texture"), {"faq"}),
]


class Quiet(SimpleHTTPRequestHandler):
    """Files of a folder, without a line for each."""

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture(scope="module")
def search(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], list[str]]]:
    """What the search of the site says: the pages, best first."""
    assert CHROMIUM, "no chromium: `make test-browser` installs it"
    site = tmp_path_factory.mktemp("site") / "html"
    build = [sys.executable, str(ROOT / "docs" / "site" / "build.py"), "--quick", "--output"]
    subprocess.run([*build, str(site)], check=True, cwd=ROOT)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(site)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = browser.new_page(viewport={"width": 1400, "height": 900})
        yield partial(answers, tab, f"http://127.0.0.1:{server.server_port}/search.html?q=")
        browser.close()
    server.shutdown()
    server.server_close()


def answers(tab: Page, address: str, words: str) -> list[str]:
    tab.goto(address + quote_plus(words))
    tab.wait_for_function(
        "document.querySelector('.search-summary')?.innerText.match(/found|did not/)"
    )
    tab.wait_for_load_state("networkidle")
    return [str(path).strip("/").removesuffix(".html") for path in tab.evaluate(ROWS)]


@pytest.mark.parametrize(("question", "typed", "pages"), QUESTIONS, ids=[q for q, *_ in QUESTIONS])
def test_the_search_answers(
    question: str, typed: tuple[str, str], pages: set[str], search: Callable[[str], list[str]]
):
    for words in typed:
        found = search(words)[:3]
        print(f"{question} {words!r}: {', '.join(found)}")
        assert pages & set(found), (words, found)


def test_what_stands_nowhere_is_not_found(search: Callable[[str], list[str]]):
    assert search("xylophone") == []
