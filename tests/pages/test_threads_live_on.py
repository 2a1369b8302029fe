"""The threads of the page: what one robot's numbers meet is told, and the next robot is answered for."""

import io
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from spirillum.dynamics.prediction import predict
from spirillum.errors import InputError
from spirillum.pages import simulation_thread as module
from spirillum.pages.job import BackgroundJob, worker
from spirillum.pages.page_robot import PageRobot
from spirillum.pages.simulation_thread import SimulationThread
from spirillum.swimming import preparation


@pytest.fixture
def simulation() -> Iterator[SimulationThread]:
    found = SimulationThread("ecoli", lambda: None)
    yield found
    found.stop()


def swimmer_of(simulation: SimulationThread) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(simulation.scene)["lanes"][0]
    return found


def until(true: Callable[[], Any], seconds: float = 600.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("error", "said"),
    [(MemoryError(), "does not fit into memory; allowed: a smaller one"), (RuntimeError("odd"), "RuntimeError: odd")],
)
def test_numbers_go_on_after_any_exception(
    simulation: SimulationThread, monkeypatch: pytest.MonkeyPatch, error: Exception, said: str
) -> None:
    honest = module.build

    def failing(*arguments: Any) -> Any:
        monkeypatch.setattr(module, "build", honest)
        raise error

    monkeypatch.setattr(module, "build", failing)
    simulation.start()
    until(lambda: said in swimmer_of(simulation)["trouble"])
    simulation.ask({"do": "restart"}, lambda _text: None)
    until(lambda: swimmer_of(simulation)["numbers"] and not swimmer_of(simulation)["trouble"])
    assert swimmer_of(simulation)["swims_by"] == "slender"


def test_motion_goes_on_after_any_exception(simulation: SimulationThread, monkeypatch: pytest.MonkeyPatch) -> None:
    honest, refused = PageRobot.set, list[str]()

    def failing(self: PageRobot, name: str, value: str) -> None:
        monkeypatch.setattr(PageRobot, "set", honest)
        raise MemoryError

    monkeypatch.setattr(PageRobot, "set", failing)
    simulation.start()
    simulation.ask({"do": "set", "field": "fluid.viscosity", "value": "2 mPa.s"}, refused.append)
    until(lambda: refused)
    assert "does not fit into memory" in json.loads(refused[0])["sentence"]
    simulation.ask({"do": "set", "field": "fluid.viscosity", "value": "2 mPa.s"}, refused.append)
    until(lambda: swimmer_of(simulation)["undo"] == 1)
    assert len(refused) == 1


def test_thin_wires_and_fine_coils_are_refused_and_the_page_goes_on(simulation: SimulationThread) -> None:
    """One message each; the first once took gigabytes, and the page's numbers for good."""
    refused = list[str]()
    simulation.start()
    simulation.ask({"do": "set", "field": "tail.wire_diameter", "value": "1 nm"}, refused.append)
    until(lambda: "stations along the tail" in swimmer_of(simulation)["trouble"])
    simulation.ask({"do": "undo"}, refused.append)
    until(lambda: swimmer_of(simulation)["swims_by"])
    coil = {"do": "set", "field": "tail.wavelength", "value": "7.2 nm"}
    simulation.ask(coil, refused.append)
    until(lambda: refused or swimmer_of(simulation)["trouble"])
    simulation.ask({"do": "preset", "value": "ecoli"}, refused.append)
    until(lambda: swimmer_of(simulation)["swims_by"] and swimmer_of(simulation)["numbers"])


class Made:
    """A table in preparation, as the page sees it."""

    requested: list[Any] = []  # noqa: RUF012 - emptied by the test

    def __init__(self, robot: Any, _tell: Callable[[], None]) -> None:
        self.robot, self.running, self.said = robot, True, {"what": "table"}
        Made.requested.append(self)

    def progress(self) -> dict[str, Any]:
        return self.said

    def stop(self) -> None:
        self.running, self.said = False, {"failed": "it was left off"}


def test_a_robot_without_a_table_swims_provisionally_until_its_table_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparation, "has_table", lambda *_: bool(Made.requested) and not Made.requested[-1].running)
    monkeypatch.setattr(module, "Preparing", Made)
    monkeypatch.setattr(module, "_UNTOUCHED", 0.1)
    Made.requested.clear()
    simulation = SimulationThread("biorob2012-wide", lambda: None)
    simulation.look(True)
    simulation.start()
    try:
        until(lambda: swimmer_of(simulation)["numbers"] and Made.requested)
        shown = swimmer_of(simulation)
        assert (shown["provisional"], shown["swims_by"], shown["numbers"]["model"]) == (True, "slender", "slender")
        assert shown["caution"].startswith("provisional, without walls")
        Made.requested[0].said, Made.requested[0].running = {"done": True}, False
        until(lambda: swimmer_of(simulation)["swims_by"] == "tube" and swimmer_of(simulation)["numbers"])
        assert not swimmer_of(simulation)["provisional"]
        assert len(Made.requested) == 1
    finally:
        simulation.stop()


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError("gap = 1 nm; allowed: more"), 2, "gap = 1 nm; allowed: more"),
        (MemoryError(), 2, "the request does not fit into memory; allowed: a smaller one"),
        (ZeroDivisionError("odd"), 1, "a fault of the program ended this request (ZeroDivisionError: odd)"),
    ],
)
def test_a_process_beside_the_page_tells_why_it_failed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: Exception, code: int, said: str
) -> None:
    def work(_request: dict[str, Any], progress: Callable[[str, int, int], None]) -> dict[str, Any]:
        progress("half", 1, 2)
        raise error

    monkeypatch.setattr("sys.stdin", io.StringIO("{}"))
    with pytest.raises(SystemExit) as left:
        worker(work)
    describe = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert left.value.code == code
    assert describe[0]["what"] == "half"
    assert said in describe[-1]["failed"]


def test_a_process_that_was_ended_says_so_and_what_it_prints_besides_is_no_progress(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = ["import os, signal", "print('a library speaks')", "print('[1, 2]', flush=True)"]
    (tmp_path / "ended_from_outside.py").write_text("\n".join([*lines, "os.kill(os.getpid(), signal.SIGKILL)"]))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    job = BackgroundJob("ended_from_outside", {})
    until(lambda: not job.running)
    assert "ended from outside" in job.progress()["failed"]


def test_trial_and_steady_motion_come_beside_the_held_numbers() -> None:
    """One column after the other, with the values of `predict`; a robot that has no tube has none."""
    page = SimulationThread("biorob2012-wide", lambda: None)
    page.start()
    try:
        until(lambda: swimmer_of(page)["numbers"])
        assert swimmer_of(page)["numbers"]["columns"] == {"trial": None, "steady": None}  # being computed
        until(lambda: all(swimmer_of(page)["numbers"]["columns"].values()))
        columns = swimmer_of(page)["numbers"]["columns"]
        page.ask({"do": "preset", "value": "ecoli"}, lambda _text: None)
        until(lambda: (swimmer_of(page)["numbers"] or {}).get("model") == "slender")
        assert swimmer_of(page)["numbers"]["columns"] == {}
    finally:
        page.stop()
    answer = predict("biorob2012-wide", band=False)
    for name in ("trial", "steady"):
        speed = getattr(answer, name).values["forward_velocity"]
        assert columns[name]["rows"]["forward_velocity"] == pytest.approx(speed, rel=1e-9)
        assert "contact assumed, not validated" in columns[name]["title"]
