"""Film the page in use for the documentation: docs/images/page.webp with its first picture, page.png; page-measure.png.

    python tools/film_page.py

Needs Chromium and playwright (extra `test`). The robot is moved step by step and a picture is taken after each, so that
the film runs at the robot's own pace on any machine.
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import time
from pathlib import Path
from shutil import which
from signal import SIGINT
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from playwright.sync_api import Page, sync_playwright

import spirillum as sp

IMAGES = Path(__file__).parent.parent / "docs" / "images"
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
SIZE = {"width": 1180, "height": 680}
STEPS = 3  # of the robot between two pictures
LANE = "spirillum.frame.lanes[0]"
SCENE = "spirillum.scene.lanes[0]"


def until(page: Page, script: str, longest: float = 300.0) -> None:
    """Wait for something that the page says of itself."""
    end = time.monotonic() + longest
    while not page.evaluate(f"Boolean({script})"):
        if time.monotonic() > end:
            raise TimeoutError(script)
        time.sleep(0.02)


def command(page: Page, **what: Any) -> None:
    """Tell the server something, as the page's buttons do."""
    page.evaluate("what => spirillum.socket.send(JSON.stringify(what))", what)


def ready(page: Page) -> None:
    """Wait until the robot swims by its model and its numbers stand there."""
    until(page, f"window.spirillum?.frame?.lanes[0].ready && {SCENE}.numbers && {SCENE}.swims_by")


def swimming(page: Page, count: int) -> list[Image.Image]:
    """Pictures of a robot that swims."""
    pictures = []
    for _ in range(count):
        for _ in range(STEPS):
            before = page.evaluate(f"{LANE}.time")
            command(page, do="step")
            until(page, f"{LANE}.time > {before}")
        page.evaluate("Object.assign(spirillum.lanes[0].stage, { sharpness: 1, slow: [] })")
        page.evaluate("new Promise(drawn => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
        pictures.append(Image.open(io.BytesIO(page.screenshot())).convert("RGB"))
    return pictures


def filmed(page: Page) -> list[Image.Image]:
    """It swims; its tail becomes shorter in wavelength; the fluid thinner; it is switched off."""
    ready(page)
    command(page, do="play", value=False)
    until(page, "!spirillum.frame.playing")
    pictures = swimming(page, 24)
    for knob, value in (("tail-wavelength", "20"), ("fluid-viscosity", "2")):
        page.fill(f"#{knob}", value)
        page.keyboard.press("Enter")
        time.sleep(1.0)
        ready(page)
        pictures += swimming(page, 20)
    page.click("#remote")
    return pictures + swimming(page, 8)


def measured(page: Page, film: Path) -> None:
    """A film with its setup, and the magnifier over its ruler."""
    page.click("#tab-measure")
    until(page, "spirillum.measure?.state")
    page.set_input_files("#film-files", film)
    until(page, "spirillum.measure.pointer.image && spirillum.measure.strips.length")
    setup = {
        "markers-spacing": "2 mm",
        "markers-height": "0 mm",
        "camera-height": "210 mm",
        "tank-surface": "60 mm",
        "tank-index": "1.4",
        "robot-axis_height": "11.5 mm",
    }
    for name, value in setup.items():  # that of the film
        page.fill(f"#{name}", value)
        page.keyboard.press("Enter")
    page.click("#point-ruler")
    box = page.locator(".pointing").bounding_box() or {}
    page.mouse.move(box["x"] + 0.51 * box["width"], box["y"] + 0.26 * box["height"])
    time.sleep(1.0)
    page.screenshot(path=IMAGES / "page-measure.png")


def main() -> None:
    """Start the page, film it, end it."""
    server = subprocess.Popen(
        [sys.executable, "-m", "spirillum", "page", "--no-browser", "biorob2012-wide"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        address = re.search(r"http://\S+", server.stdout.readline() if server.stdout else "")
        if address is None:
            raise RuntimeError("the page did not start")
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=which("chromium"), args=FLAGS)
            page = browser.new_page(viewport=SIZE, color_scheme="light")
            page.goto(address[0])
            pictures = filmed(page)
            with TemporaryDirectory() as folder:
                sp.render("biorob2012-wide", Path(folder) / "film.mp4", model="tube", trial={"duration": "2 s"})
                page.set_viewport_size({"width": 1440, "height": 900})
                measured(page, Path(folder) / "film.mp4")
            browser.close()
    finally:
        server.send_signal(SIGINT)
        server.wait(20)
    pictures[0].save(IMAGES / "page.png", optimize=True)
    small = [picture.resize((900, round(900 * picture.height / picture.width)), Image.LANCZOS) for picture in pictures]
    small[0].save(
        IMAGES / "page.webp", save_all=True, append_images=small[1:], duration=1000 * STEPS // 30, quality=55, method=4
    )


if __name__ == "__main__":
    main()
