"""`fl.view` in JupyterLab, in a real browser: a slider is dragged, the picture follows."""

from __future__ import annotations

import json
import secrets
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, sync_playwright
from test_viewer_page import CHROMIUM, PICTURES, SHOTS, drag, until

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


@pytest.fixture
def page(lab: tuple[str, Path]) -> Iterator[Page]:
    url, _ = lab
    assert CHROMIUM, "no chromium: `make test-browser` installs it"
    with sync_playwright() as play:
        shown = play.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        tab = shown.new_page(viewport={"width": 1300, "height": 1300})
        for _ in range(60):
            try:
                with urllib.request.urlopen(url.replace("/lab/tree/look.ipynb", "/api")):
                    break
            except OSError:
                tab.wait_for_timeout(500)
        tab.goto(url)
        yield tab
        shown.close()


def test_the_widget_in_a_notebook(page: Page, lab: tuple[str, Path]):
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
    amount = lab[1] / "amount"
    for _ in range(200):
        if amount.exists() and amount.read_text():
            break
        page.wait_for_timeout(100)
    assert abs(float(amount.read_text()) - 0.3) < 0.05
