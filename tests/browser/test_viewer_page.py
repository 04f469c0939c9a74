"""The viewer in a browser and in JupyterLab, whose screenshots stay in build/screenshots."""

import base64
import io
import json
import os
import secrets
import shutil
import socket
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, sync_playwright

import flurries as fl
from flurries.viewer.server import Server

SHOTS = Path(__file__).parents[2] / "build" / "screenshots"
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")

# A picture's pixels, read back from the canvas that the user sees.
PIXELS = "document.querySelector('.fl-picture').toDataURL('image/png').split(',')[1]"
PICTURES = "Number(document.querySelector('.flurries')?.dataset.pictures || 0)"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    assert CHROMIUM, "no chromium: `make test-browser` installs it"
    with sync_playwright() as play:
        # Everything that is shown comes from this machine; root has no sandbox.
        shown = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield shown
        shown.close()


def scene() -> fl.Scene:
    from skimage import data

    return fl.Scene(data.astronaut(), effects=[fl.effects.TentSnow("heavy", flakes=6000)])


@contextmanager
def opened(browser: Any, shown: fl.Scene, save: Path) -> Iterator[Page]:
    """A page of a scene, closed and without complaints at the end."""
    served = Server(shown, size=512, save=save)
    runner = threading.Thread(target=served.serve_forever, args=(0.01,), daemon=True)
    runner.start()
    tab = browser.new_page(viewport={"width": 900, "height": 940})
    said: list[str] = []
    tab.on("pageerror", lambda error: said.append(str(error)))
    tab.on("console", lambda line: said.append(line.text) if line.type == "error" else None)
    tab.goto(served.url)
    until(tab, f"{PICTURES} >= 3")
    yield tab
    tab.close()
    served.shutdown()
    served.server_close()
    runner.join()
    assert not said, said


@pytest.fixture
def page(browser: Any, tmp_path: Path) -> Iterator[Page]:
    with opened(browser, scene(), tmp_path / "tuned.toml") as tab:
        yield tab


def pixels(page: Page) -> np.ndarray:
    with Image.open(io.BytesIO(base64.b64decode(page.evaluate(PIXELS)))) as picture:
        return np.asarray(picture.convert("RGB"), dtype=float)


def stop(page: Page) -> None:
    page.click(".fl-play")
    settle(page)


def settle(page: Page) -> None:
    until(page, "document.querySelector('main').dataset.idle === 'true'")


def until(page: Page, condition: str, seconds: float = 30.0) -> None:
    """Wait for a condition; the page's policy forbids the eval of `wait_for_function`."""
    for _ in range(int(seconds / 0.05)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"{condition} did not come true in {seconds} s")


def drag(page: Page, key: str, share: float, steps: int = 12) -> int:
    """Drag a slider to a share of its length; return how many pictures were shown meanwhile."""
    slider = page.locator(f"[data-key='{key}']")
    box = slider.bounding_box()
    assert box is not None
    low, high, value = (float(slider.evaluate(f"(s) => s.{a}")) for a in ("min", "max", "value"))
    y = box["y"] + box["height"] / 2
    # The thumb's middle runs over the length less its own width.
    start = box["x"] + 8 + (box["width"] - 16) * (value - low) / (high - low)
    end = box["x"] + 8 + (box["width"] - 16) * share
    before = int(page.evaluate(PICTURES))
    page.mouse.move(start, y)
    page.mouse.down()
    for step in range(1, steps + 1):
        page.mouse.move(start + (end - start) * step / steps, y)
        page.wait_for_timeout(60)
    page.mouse.up()
    return int(page.evaluate(PICTURES)) - before


def test_the_picture_follows_a_dragged_slider(page: Page):
    stop(page)
    before = pixels(page)
    page.wait_for_timeout(500)
    assert np.array_equal(before, pixels(page)), "without a hand on a slider nothing changes"
    during = drag(page, "0.amount", 0.1)
    settle(page)
    after = pixels(page)
    # Bright weather over the whole picture goes: many pixels change, and the dark ones darken.
    changed = np.abs(after - before).max(axis=2)
    assert (changed > 8).mean() > 0.2
    assert after.mean() < before.mean() - 2.0
    # Not only after the mouse was let go.
    assert during >= 2
    assert "0.1" in page.locator(".fl-row.fl-touched output").inner_text()


def test_the_picture_is_what_the_scene_renders(page: Page):
    stop(page)
    t = page.evaluate("Number(document.querySelector('.fl-time').value)")
    # The slider rounds the time to a frame; go there.
    page.locator(".fl-time").evaluate("(s) => s.dispatchEvent(new Event('input'))")
    settle(page)
    shown = pixels(page)
    wanted = scene().render(t).astype(float)
    # JPEG's quantisation, about 2 levels rms at quality 90 on snow; another frame is 20 off.
    assert np.sqrt(np.mean((shown - wanted) ** 2)) < 5.0
    assert np.sqrt(np.mean((shown - scene().render(t + 9).astype(float)) ** 2)) > 10.0


def test_spectrum_and_tent_are_drawn(page: Page):
    stop(page)
    ink = """(name) => {
      const c = document.querySelector(name);
      const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
      let lit = 0;
      for (let i = 3; i < d.length; i += 4) lit += d[i] > 0;
      return lit / (d.length / 4);
    }"""
    assert page.evaluate(ink, ".fl-spectrum") > 0.3
    assert page.evaluate(ink, ".fl-tent") > 0.1
    before = page.locator(".fl-note").inner_text()
    drag(page, "0.speed", 0.95)
    settle(page)
    assert page.locator(".fl-note").inner_text() != before


def stand(page: Page, key: str) -> str:
    return str(page.evaluate(f"document.querySelector(`[data-key='{key}']`).value"))


def choose(page: Page, key: str, word: str) -> None:
    page.locator(f"select[data-key='{key}']").select_option(word)


def test_what_cannot_be_saved_is_said(page: Page, tmp_path: Path):
    # A folder is in the way of the scene's file: the page says so.
    (tmp_path / "tuned.toml").mkdir()
    page.click(".fl-save")
    page.wait_for_selector(".fl-error")
    assert "tuned.toml" in page.locator(".fl-status").inner_text()


def test_python_and_a_film(page: Page, tmp_path: Path):
    drag(page, "0.haze", 0.5)
    page.click(".fl-code")
    until(page, "!!document.querySelector('.flurries').dataset.python")
    said = page.evaluate("document.querySelector('.flurries').dataset.python")
    assert "haze=0." in said and "background=np.load(" in said
    page.click(".fl-film")
    until(page, "!!document.querySelector('.flurries').dataset.film", 120.0)
    assert (tmp_path / "tuned.mp4").exists()


def test_a_look_by_name_moves_its_sliders_and_can_be_undone_and_reset(page: Page):
    stop(page)
    usual, before = stand(page, "0.flakes"), pixels(page)
    drag(page, "0.haze", 0.6)
    choose(page, "0.preset", "light")
    until(page, "document.querySelector(`[data-key='0.flakes']`).value === '2500'")
    settle(page)
    assert np.abs(pixels(page) - before).max(axis=2).mean() > 2.0
    # What was tuned of the look before is gone with it, and comes again with undo.
    assert stand(page, "0.haze") == "0"
    page.click(".fl-undo")
    until(page, f"document.querySelector(`[data-key='0.flakes']`).value === '{usual}'")
    assert abs(float(stand(page, "0.haze")) - 0.6) < 0.1
    page.click(".fl-reset")
    settle(page)
    assert np.abs(pixels(page) - before).mean() < 1.0


def test_a_color_from_the_full_picker(page: Page):
    stop(page)
    page.locator("input[type=color][data-key='0.color']").evaluate(
        "(p) => { p.value = '#ff0000'; p.dispatchEvent(new Event('input')); }"
    )
    settle(page)
    red = pixels(page)
    assert stand(page, "0.color.word") == "own color"
    choose(page, "0.color.word", "ambient")
    settle(page)
    # Snow lies over much of it: it was red, and is of the picture's light now.
    shift = (red - pixels(page)).mean(axis=(0, 1))
    assert shift[1] < -5.0 and shift[2] < -5.0 and shift[0] > -5.0


def test_a_scene_file_with_lamp_lens_and_depth_is_tuned_and_saved(browser: Any, tmp_path: Path):
    snow = fl.Snow("heavy")
    dark = fl.Scene("#1e1e1e", size=(320, 240), effects=[snow], depth=3.0)
    dark.save(tmp_path / "a.toml")
    shown = []
    with opened(browser, fl.open(tmp_path / "a.toml"), tmp_path / "b.toml") as tab:
        stop(tab)
        power = tab.locator(".fl-row[data-row='lamp.power']")
        assert power.get_attribute("title") == "Changes nothing now: the lamp is off"
        for key, word in (("scene.depth", "off"), ("lamp.on", "on"), ("lens.on", "on")):
            shown.append(tab.evaluate(PIXELS))
            choose(tab, key, word)
            settle(tab)
        shown.append(tab.evaluate(PIXELS))
        assert "fl-inert" not in str(power.get_attribute("class"))
        drag(tab, "0.amount", 0.5)
        SHOTS.mkdir(parents=True, exist_ok=True)
        tab.screenshot(path=SHOTS / "lamp.png", full_page=True)
        tab.click(".fl-save")
        until(tab, "!!document.querySelector('main').dataset.saved")
    assert len(set(shown)) == 4
    saved = fl.open(tmp_path / "b.toml")
    assert len(saved.lights) == 1 and saved.lens is not None and saved.depth is None
    assert abs(saved.effects[0].amount - 0.5) < 0.05


CELLS = [
    "import flurries as fl\nfrom skimage import data\n"
    "snow = fl.effects.TentSnow('heavy', flakes=6000)\n"
    "viewer = fl.view(fl.Scene(data.astronaut(), effects=[snow]))\nviewer",
    "from pathlib import Path\nPath('amount').write_text(str(viewer.scene.effects[0].amount))",
]


def notebook() -> dict[str, Any]:
    about = {"name": "python3", "display_name": "Python 3", "language": "python"}
    cells = [
        {"cell_type": "code", "id": f"c{i}", "metadata": {}, "source": text}
        | {"outputs": [], "execution_count": None}
        for i, text in enumerate(CELLS)
    ]
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": about}, "cells": cells}


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    folder = tmp_path_factory.mktemp("lab")
    (folder / "look.ipynb").write_text(json.dumps(notebook()), encoding="utf-8")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    token = secrets.token_hex(16)
    words = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"]
    words += [f"--port={port}", f"--IdentityProvider.token={token}"]
    words += [f"--ServerApp.root_dir={folder}"]
    with (folder / "log").open("w") as log:
        running = subprocess.Popen(words, stdout=log, stderr=log, cwd=folder)
        try:
            yield f"http://127.0.0.1:{port}/lab/tree/look.ipynb?token={token}", folder
        finally:
            running.terminate()
            running.wait(timeout=30)


def test_the_widget_in_a_notebook(browser: Any, lab: tuple[str, Path]):
    url, folder = lab
    page = browser.new_page(viewport={"width": 1300, "height": 1300})
    for _ in range(60):
        with suppress(OSError), urllib.request.urlopen(url.replace("/lab/tree/look.ipynb", "/api")):
            break
        page.wait_for_timeout(500)
    page.goto(url)
    page.wait_for_selector(".jp-Cell", timeout=90_000)
    # A cell that is run before the kernel is there is not run.
    until(page, "document.body.innerText.includes('| Idle')", seconds=60)
    page.locator(".jp-Cell").first.click()
    page.keyboard.press("Shift+Enter")
    until(page, f"{PICTURES} >= 3", seconds=90)
    before = int(page.evaluate(PICTURES))
    drag(page, "0.amount", 0.3)
    assert int(page.evaluate(PICTURES)) >= before + 2
    page.locator(".fl-play").click()
    SHOTS.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=SHOTS / "notebook.png")
    # The scene in Python is where the slider stands.
    page.locator(".jp-Cell").nth(1).locator(".cm-content").click()
    page.keyboard.press("Shift+Enter")
    amount = folder / "amount"
    for _ in range(200):
        if amount.exists() and amount.read_text():
            break
        page.wait_for_timeout(100)
    assert abs(float(amount.read_text()) - 0.3) < 0.05
    page.close()
