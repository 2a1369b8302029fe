"""One server and one browser for each file of tests; left open they would go on drawing beside all other tests."""

import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from shutil import which
from signal import SIGINT
from typing import Any, NoReturn

import pytest

from browser import LEFT_OUT

FLAGS = (
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-gpu-compositing",
)
"""WebGL without a graphics card; the rest of the page is drawn without it, which takes a third of the time."""

READ_BACK = "GPU stall due to ReadPixels"
"""What the browser says of itself, as it reads each picture of WebGL back into a page that it draws without it."""


def _left_out(why: str) -> NoReturn:
    """Skip a test of the page, or fail where a browser has to be there, as in `.ci/run`."""
    (pytest.fail if os.environ.get("SPIRILLUM_BROWSER") == "needed" else pytest.skip)(f"{why}: {LEFT_OUT}")


class Served:
    """A page that runs in a process of its own."""

    def __init__(self, *arguments: str, stderr: Any = None) -> None:
        command = [sys.executable, "-m", "spirillum", "page", "--no-browser", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=stderr, text=True)
        assert self.process.stdout is not None
        found = re.search(r"http://\S+", self.process.stdout.readline())
        assert found is not None
        self.address = found[0]
        self.base, self.key = self.address.split("/?key=")

    def ended(self, number: int) -> int:
        """Its exit code after a signal."""
        self.process.send_signal(number)
        with self.process:
            return self.process.wait(timeout=20)


@pytest.fixture(scope="module")
def served(cache_of_its_own: None) -> Iterator[Served]:
    page = Served()
    yield page
    assert page.ended(SIGINT) == 0


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    try:
        from playwright import sync_api
    except ImportError:
        _left_out("playwright is not installed (extra `test`)")
    system = next((path for name in ("chromium", "chromium-browser", "google-chrome") if (path := which(name))), None)
    with sync_api.sync_playwright() as playwright:
        try:
            found = playwright.chromium.launch(executable_path=system, args=list(FLAGS))
        except sync_api.Error:
            _left_out("no Chromium is installed (`playwright install chromium`)")
        yield found
        found.close()


@pytest.fixture(scope="session")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A short film of the virtual camera, with its setup and its truth."""
    pytest.importorskip("av")
    pytest.importorskip("cv2")
    import spirillum as sp

    film = tmp_path_factory.mktemp("trial") / "film.mp4"
    fast = {"model": "sbt"}  # without walls it goes far in 2 s
    camera = {"size": "320x240", "fps": 12.0}
    return sp.render("biorob2012-wide", film, motion=fast, trial={"duration": "2 s"}, camera=camera)


class Tab:
    """A tab that notes what goes wrong in it, and who it asks."""

    def __init__(self, page: Any) -> None:
        self.page, self.wrong, self.requested = page, [], []
        page.on("console", self.note)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("request", lambda request: self.requested.append(request.url))

    def note(self, said: Any) -> None:
        if said.type in ("error", "warning") and READ_BACK not in said.text:
            self.wrong.append(said.text)

    def value(self, script: str) -> Any:
        return self.page.evaluate(script)

    def until(self, script: str, longest: float = 300.0) -> None:
        """Wait for something; its policy forbids the page to evaluate text, so that it is asked from outside."""
        end = time.monotonic() + longest
        while not self.value(f"Boolean({script})"):
            assert time.monotonic() < end, f"{script} in {longest} s; {self.wrong}"
            time.sleep(0.1)

    def command(self, **what: Any) -> None:
        self.page.evaluate("what => spirillum.socket.send(JSON.stringify(what))", what)


@pytest.fixture(scope="module")
def tab(served: Served, browser: Any) -> Iterator[Tab]:
    """The page in a small window; its robot has begun to swim, and waits."""
    context = browser.new_context(viewport={"width": 800, "height": 480})
    found = Tab(context.new_page())
    found.page.goto(served.address)
    found.until("window.spirillum?.frame?.lanes[0].time > 0.1")
    found.command(do="play", value=False)  # what moves is drawn without a graphics card
    found.until("!spirillum.frame.playing && spirillum.scene.lanes[0].numbers")
    yield found
    context.close()
