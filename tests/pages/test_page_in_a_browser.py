"""The page in a real browser: it draws, it moves, its knobs ask Python, and nothing leaves the machine."""

import json
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from PIL import Image

import spirillum as sp

FRAME = "spirillum.frame.lanes[0]"
NUMBERS = "spirillum.scene.lanes[0].numbers"


def _picture(tab: Any) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(tab.page.locator(".scene").first.screenshot())).convert("RGB"), dtype=float)


def test_robot_is_drawn_and_moves_as_simulate_says(tab: Any) -> None:
    picture = _picture(tab)
    assert picture.std() > 10.0  # not blank
    stripes = (picture.max(axis=2) - picture.min(axis=2)) > 90.0  # only the robot has such colours
    assert stripes.mean() > 2e-3
    first = tab.value(FRAME)
    tab.command(do="play", value=True)
    tab.until(f"{FRAME}.time > {first['time'] + 0.5}")
    tab.command(do="play", value=False)
    tab.until("!spirillum.frame.playing")
    frame = tab.value(FRAME)
    assert frame["tail_phase"] > first["tail_phase"]
    run = sp.simulate("biorob2012-wide", timing={"duration": frame["time"]}, in_tube={"wait": 0.0})
    assert frame["position"] == pytest.approx(run.position.values[-1], rel=1e-6, abs=1e-9)
    assert frame["values"]["motor_current"] == pytest.approx(float(run.motor_current[-1]), rel=1e-6)
    assert np.abs(_picture(tab) - picture).max() > 50.0


def test_knob_gives_the_number_that_python_gives(tab: Any) -> None:
    tab.page.fill("#fluid-viscosity", "2 Pa s")
    tab.page.keyboard.press("Enter")
    tab.until("spirillum.scene.lanes[0].knobs.some(knob => knob.field == 'fluid.viscosity' && knob.value == 2)")
    tab.until(f"{NUMBERS} && spirillum.scene.lanes[0].swims_by")
    expected = sp.predict(sp.load("biorob2012-wide", **{"fluid.viscosity": "2 Pa s"})).forward_velocity
    tab.until(f"Math.abs({NUMBERS}.rows.forward_velocity.value / {expected!r} - 1) < 1e-9")
    shown = tab.page.locator("[data-quantity=forward_velocity] .steady[data-value]")
    assert shown.inner_text() == f"{1e3 * expected:.3f}"
    tab.page.keyboard.press("Control+z")
    tab.until("spirillum.scene.lanes[0].knobs.some(knob => knob.field == 'fluid.viscosity' && knob.value == 3.5)")


def test_nothing_is_cut_at_any_width(tab: Any) -> None:
    """All columns of the numbers lie inside their card, and the page is no wider than its window."""
    before = tab.page.viewport_size
    tab.until(f"{NUMBERS} && Object.values({NUMBERS}.columns).every(column => column)")
    for width in (390, 820, 1100, 1440):
        tab.page.set_viewport_size({"width": width, "height": 900})
        reach = tab.value("""() => {
          const end = (place) => document.querySelector(place).getBoundingClientRect().right;
          return [end("#numbers table"), end("#numbers"), document.documentElement.scrollWidth, innerWidth];
        }""")
        assert reach[0] <= reach[1], width
        assert reach[2] <= reach[3], width
    tab.page.set_viewport_size(before)


def test_forces_are_those_of_the_prediction(tab: Any) -> None:
    tab.page.select_option("#model", "slender")
    tab.until(f"spirillum.scene.lanes[0].swims_by == 'slender' && {NUMBERS}?.model == 'slender'")
    tab.page.click(".layers button:has-text('Forces')")
    tab.until("spirillum.lanes[0].stage.renderer.marks[0]?.tips.length == 3")
    forces = {one["name"]: one["value"] for one in tab.value("spirillum.lanes[0].stage.renderer.marks[0].tips")}
    weight = sp.load("biorob2012-wide").derived()["submerged_weight"].value
    assert forces["weight less buoyancy"] == pytest.approx(-weight)
    assert forces["drag of the body"] == pytest.approx(-forces["thrust of the tail"])
    tab.page.click(".layers button:has-text('Forces')")


@pytest.mark.slow
def test_flow_is_drawn_on_the_plane(tab: Any) -> None:
    tab.page.select_option("#model", "slender")
    tab.until("spirillum.scene.lanes[0].swims_by == 'slender' && spirillum.frame.lanes[0].ready")
    before = _picture(tab)
    tab.page.click(".layers button:has-text('Flow')")
    tab.until("spirillum.lanes[0].plane && spirillum.lanes[0].stage.renderer.planes.length", 300.0)
    tab.until("spirillum.lanes[0].note.textContent.includes('Flow of steady swimming (slender)')")
    assert (np.abs(_picture(tab) - before).max(axis=2) > 15.0).mean() > 0.1
    tab.page.click(".layers button:has-text('Flow')")
    tab.until("!spirillum.lanes[0].plane")


def test_wrong_value_gets_a_sentence_at_its_knob(tab: Any) -> None:
    tab.page.fill("#tail-amplitude", "40")
    tab.page.keyboard.press("Enter")
    tab.until("document.getElementById('tail-amplitude-error').textContent.includes('tail.amplitude = 40 mm; allowed')")
    assert tab.value("spirillum.scene.lanes[0].knobs.find(knob => knob.field == 'tail.amplitude').value") == 2.5


def test_run_replays_alone_and_equals_its_file(tab: Any, browser: Any, tmp_path: Path) -> None:
    run = sp.simulate("biorob2012-narrow", model="tube", timing={"duration": "0.4 s"})
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    tab.page.click("#tab-replay")
    tab.page.set_input_files("#run-file", tmp_path / "run.nc")
    tab.until("spirillum.replay")
    last = len(run.time) - 1
    tab.value(f"spirillum.replay.seek({last})")
    shown = tab.value("spirillum.replay.shown")
    assert shown["time"] == float(run.time[last])
    assert shown["position"] == run.position.values[last].tolist()
    assert shown["values"]["forward_velocity"] == float(run.forward_velocity[last])
    tab.page.click("#tab-compare")
    tab.until("spirillum.scene.lanes.length === 2 && !document.getElementById('live').hidden")
    assert tab.page.get_attribute("#tab-compare", "aria-selected") == "true"
    tab.page.click("#tab-swim")
    tab.until("spirillum.scene.lanes.length === 1")

    tab.command(do="step")
    tab.command(do="step")
    tab.until(f"{FRAME}.ready && {FRAME}.time > 0.06")
    kept = tab.page.context.request.get(tab.page.url + "keep/run.html").text()
    (tmp_path / "run.html").write_text(kept, encoding="utf-8")
    context = browser.new_context(viewport={"width": 500, "height": 400}, offline=True)
    alone, wrong, requested = context.new_page(), [], []
    alone.on("pageerror", lambda error: wrong.append(str(error)))
    alone.on("request", lambda request: requested.append(request.url))
    alone.goto((tmp_path / "run.html").as_uri())
    alone.locator(".stage .scene").wait_for()
    held = json.loads(alone.locator("#run").inner_text())
    assert held["run"]["time"][-1] == tab.value(f"{FRAME}.time")
    assert np.asarray(Image.open(BytesIO(alone.locator(".scene").screenshot())).convert("L")).std() > 5.0
    assert not wrong
    assert all(url.startswith(("file:", "data:", "blob:")) for url in requested)
    context.close()


def test_long_replay_leaves_who_has_gone_to_another_view(tab: Any, tmp_path: Path) -> None:
    sp.simulate("biorob2012-narrow", model="tube", timing={"duration": "0.4 s"}).to_netcdf(
        tmp_path / "run.nc", engine="h5netcdf"
    )
    waiting: list[Any] = []

    def hold(route: Any) -> None:  # the answer comes when the test lets it
        waiting.append(route)

    tab.page.route("**/replay", hold)
    tab.page.click("#tab-replay")
    tab.value("spirillum.replay && document.querySelector('#replay button.wordy:last-of-type').click()")
    tab.page.set_input_files("#run-file", tmp_path / "run.nc")
    tab.until("!document.getElementById('run-status').hidden")
    assert "Reading run.nc" in tab.page.locator("#run-status").inner_text()
    while not waiting:
        tab.page.wait_for_timeout(20)
    tab.page.click("#tab-swim")
    waiting[0].continue_()
    tab.until("spirillum.replay")
    assert tab.value("spirillum.tab") == "swim"
    assert not tab.value("document.getElementById('live').hidden")
    tab.page.click("#tab-replay")
    tab.until("spirillum.replay.stage.canvas.clientWidth > 0")
    tab.page.click("#tab-swim")
    tab.page.unroute("**/replay")


def test_numbers_of_the_robot_before_are_not_shown(tab: Any) -> None:
    tab.value("""() => {
      const seen = window.seen = [];
      const holder = document.getElementById("numbers");
      window.watcher = new MutationObserver(() => {
        const cell = holder.querySelector("[data-quantity=forward_velocity] .steady");
        const name = spirillum.scene.lanes[0].robot;
        if (cell) seen.push([name, cell.textContent, spirillum.scene.lanes[0].numbers !== null]);
      });
      watcher.observe(holder, { childList: true, subtree: true, characterData: true });
    }""")
    tab.command(do="preset", value="biorob2012-narrow")
    tab.until(f"spirillum.scene.lanes[0].robot == 'biorob2012-narrow' && {NUMBERS}")
    tab.command(do="preset", value="biorob2012-wide")
    tab.until(f"spirillum.scene.lanes[0].robot == 'biorob2012-wide' && {NUMBERS}")
    seen = tab.value("seen")
    tab.value("watcher.disconnect()")
    expected = {
        name: f"{1e3 * sp.predict(name).forward_velocity:.3f}" for name in ("biorob2012-narrow", "biorob2012-wide")
    }
    assert {name for name, _, known in seen if known} == set(expected)
    assert all(text == (expected[name] if known else "\u2013") for name, text, known in seen)


def test_other_servers_of_this_machine_learn_nothing(tab: Any, served: Any) -> None:
    """Cookies know no ports: what the page leaves in the browser must not reach a server beside it."""
    heard: list[str] = []

    class Other(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            heard.append(f"{self.requestline}\n{self.headers}")
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: Any) -> None:
            """Say nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Other) as other:
        Thread(target=other.serve_forever, daemon=True).start()
        there = tab.page.context.new_page()
        there.goto(served.address)
        there.goto(f"http://127.0.0.1:{other.server_port}/")
        there.close()
        other.shutdown()
    assert heard
    assert not tab.page.context.cookies()
    assert all(served.key not in words and "cookie" not in words.lower() for words in heard)


def _pointed(tab: Any, what: str, points: list[tuple[float, float]]) -> str:
    """Point at pixels of the film, and wait for what is said of it."""
    canvas = tab.page.locator(".pointing")
    box, (width, height) = canvas.bounding_box(), tab.value("spirillum.measure.state.films[0].size")
    scale = min(box["width"] / width, box["height"] / height)
    corner = [0.5 * (box["width"] - scale * width), 0.5 * (box["height"] - scale * height)]
    tab.page.click(f"#point-{what}")
    for u, v in points:
        canvas.click(position={"x": corner[0] + (u + 0.5) * scale, "y": corner[1] + (v + 0.5) * scale})
    if what == "stripes":
        tab.page.click("#take-stripes")
    tab.until(f"spirillum.measure.said['{what}']?.text")
    return str(tab.value(f"spirillum.measure.said['{what}'].text"))


def _columns_of_marks(picture: np.ndarray, strip: list[float]) -> np.ndarray:
    """Columns of the ruler's dark lines, as an eye sees them: local minima of brightness."""
    left, top, right, bottom = (round(x) for x in strip)
    bright = picture[top:bottom, left:right].mean(axis=(0, 2))
    dark = (bright[1:-1] < bright[:-2]) & (bright[1:-1] <= bright[2:])
    return left + 1 + np.flatnonzero(dark)


def test_dropped_film_is_measured_as_on_the_command_line(tab: Any, trial: Any, tmp_path: Path) -> None:
    """The setup is made by clicks and typed heights alone; its file gives the same numbers without the page."""
    tab.page.click("#tab-measure")
    tab.until("spirillum.measure?.state")
    tab.page.set_input_files("#film-files", trial.path)
    tab.until("spirillum.measure.pointer.image && spirillum.measure.strips.length")
    content = tab.page.context.request.get(tab.page.url + "bench/picture?film=trial-1&time=0").body()
    picture = np.asarray(Image.open(BytesIO(content)).convert("RGB"), dtype=float)
    strip = tab.value("spirillum.measure.strips[0]")
    marks, row = _columns_of_marks(picture, strip), 0.5 * (strip[1] + strip[3])
    tab.page.fill("#ruler-length", "40 mm")
    assert "20 spacings of 2 mm" in _pointed(tab, "ruler", [(marks[3], row), (marks[23], row)])

    colourful = (picture.max(axis=2) - picture.min(axis=2)) > 90.0
    rows, columns = np.nonzero(colourful & (np.arange(picture.shape[1]) > 0.3 * picture.shape[1]))
    rear, middle = (columns.min(), 0.5 * (rows.min() + rows.max())), round(float(np.median(columns)))
    assert "right" in _pointed(tab, "body", [(rear[0] + 60.0, rear[1]), rear])
    seen = np.quantile(rows, [0.15, 0.5, 0.85])
    assert "as in the robot file" in _pointed(tab, "stripes", [(middle, v) for v in seen])

    typed = {
        "camera-height": "210 mm",
        "tank-surface": "60 mm",
        "markers-height": "0 mm",
        "robot-axis_height": "1.15cm",
    }
    for name, value in typed.items():
        tab.page.fill(f"#{name}", value)
    tab.page.keyboard.press("Tab")
    tab.until("spirillum.measure.whole && spirillum.measure.said.look.text.includes('a pixel')")
    tab.page.click("#measure-go")
    tab.until("spirillum.measure.state.results.measure", 180.0)

    setup = tmp_path / "setup.toml"
    setup.write_bytes(tab.page.context.request.get(tab.page.url + "bench/file?name=setup.toml").body())
    found = sp.measure(trial.path, setup, annotated=False, figures=False).trials[0].quantities
    for name in ("forward_velocity", "tail_rotation_rate", "body_rotation_rate"):
        shown = tab.page.locator(f"[data-measured={name}]").first
        assert float(shown.get_attribute("data-si")) == found[name].value
    assert found["forward_velocity"].value == pytest.approx(trial.rates["forward_velocity"], rel=5e-3)
    tab.until("document.getElementById('annotated').readyState >= 2")  # the browser shows the annotated film
    assert tab.value("document.getElementById('annotated').videoWidth") == 320

    tab.page.click("[data-beside=trial-1]")  # film and simulated robot on one slider
    tab.until("spirillum.replay?.video?.readyState >= 2 && spirillum.replay.drawn.length == 3")
    middle = tab.value("Math.floor(spirillum.replay.run.time.length / 2)")
    tab.value(f"spirillum.replay.seek({middle})")
    tab.until("Math.abs(spirillum.replay.video.currentTime - spirillum.replay.time) < 0.02")
    tab.page.click("#tab-swim")


def test_two_robots_start_together(tab: Any) -> None:
    tab.page.click("#tab-compare")
    tab.until("spirillum.lanes.length == 2 && spirillum.frame.lanes.length == 2")
    tab.until("spirillum.frame.lanes.every(lane => lane.ready)")
    tab.page.click("#study-paper")
    tab.page.click(".tail[data-tail='0 2']")
    tab.until("spirillum.scene.lanes[0].knobs.some(knob => knob.field == 'tail.wavelength' && knob.value == 10)")
    tab.page.keyboard.press("Control+z")
    tab.until("spirillum.scene.lanes[0].knobs.some(knob => knob.field == 'tail.wavelength' && knob.value == 25)")
    tab.until("spirillum.frame.lanes.every(lane => lane.ready)")
    tab.command(do="duty", lane=1, value=0.5)
    tab.command(do="step")
    tab.until("spirillum.scene.lanes[1].duty == 0.5")
    tab.until("spirillum.frame.lanes[1].time > 0 && spirillum.frame.lanes[0].time == spirillum.frame.lanes[1].time")
    tab.page.click("#tab-swim")
    tab.until("spirillum.lanes.length == 1")


def test_nothing_went_wrong_and_nobody_else_was_asked(tab: Any, served: Any) -> None:
    """The last one: what all the others did."""
    assert not tab.wrong
    hosts = {url.split("/")[2] for url in tab.requested if url.startswith(("http", "ws"))}
    assert hosts == {served.base.removeprefix("http://")}
