"""Settings of all tests, and robots that many of them share."""

import gc
import os
import runpy
import signal
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock

import numpy as np
import pytest
from hypothesis import Phase, settings

from browser import LEFT_OUT
from commands import Outcome, run_command
from learnt_once import learnt_once
from remembered import remembered

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in a shell's background job: children would never see Ctrl-C
    signal.signal(signal.SIGINT, signal.default_int_handler)

# What is collected lives as long as the tests do. To look for cycles in it again and again takes half of the time that
# collecting takes, and a thirtieth of all that follows.
gc.disable()

# Without the phase that explains a failure: it can take a minute.
phases = (Phase.explicit, Phase.generate, Phase.shrink)
settings.register_profile("spirillum", deadline=None, derandomize=True, database=None, phases=phases, max_examples=50)
settings.load_profile("spirillum")


_DURATIONS = Path(__file__).with_name("durations.txt")
_SLOW_FILE = 4.0
"""Duration from which a file of tests is listed, s."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """An option that writes the list of slow files anew."""
    parser.addoption(
        "--record-durations", action="store_true", help=f"write {_DURATIONS.name}, the order of slow files"
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The slowest files first: workers end at about the same time."""
    rank = {line.split()[1]: number for number, line in enumerate(_DURATIONS.read_text().splitlines())}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


class _Durations:
    """Sums of the durations of each file's tests."""

    def __init__(self) -> None:
        self.of_file: Counter[str] = Counter()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Add a phase of a test."""
        self.of_file[Path(report.location[0]).name] += report.duration

    def pytest_sessionfinish(self) -> None:
        """Write the files that are slow, the slowest first."""
        slow = [f"{seconds:4.0f} {name}\n" for name, seconds in self.of_file.most_common() if seconds >= _SLOW_FILE]
        _DURATIONS.write_text("".join(slow))


def pytest_configure(config: pytest.Config) -> None:
    """In the process that sees all reports: compile csrc/ where it has changed, record durations where asked to."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        return
    build = runpy.run_path(str(Path(__file__).parents[1] / "csrc" / "build.py"))
    if not build["is_current"]():
        build["compile_all"]()
    if config.getoption("--record-durations"):
        config.pluginmanager.register(_Durations())


def pytest_collection_finish() -> None:
    """From here on the collector looks at what tests make, and not at each few hundred of new objects."""
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)
    gc.enable()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """One line where the tests of the page were left out for want of a browser."""
    reasons = [str(report.longrepr[-1]) for report in terminalreporter.stats.get("skipped", ())]
    if left := [reason for reason in reasons if reason.endswith(LEFT_OUT)]:
        terminalreporter.write_line(f"{left[0].removeprefix('Skipped: ')} ({len(left)})", yellow=True)


@pytest.fixture(scope="session", autouse=True)
def cache_of_its_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No answer comes from another run; within a run the workers share what one of them has solved."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SPIRILLUM_CACHE", str(folder / "solved"))
        yield


@pytest.fixture(scope="session", autouse=True)
def wide_terminal() -> Iterator[None]:
    """Each sentence is printed as one line; tests of layouts set the width that they look at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "1000")
        yield


@pytest.fixture(scope="session")
def flat_pictures() -> ModuleType:
    """The module `flat_pictures`: `flat_pictures.flat(velocity=1e-3, ...)` is a film."""
    import flat_pictures

    return flat_pictures


@pytest.fixture(scope="module")
def learning_shared() -> Iterator[None]:
    """The tracker learns from the same frames once for all tests of a file."""
    with learnt_once():
        yield


@pytest.fixture(scope="session", autouse=True)
def _without_progress() -> Iterator[None]:
    """A slow machine prints no lines of progress, for tests compare what a command prints."""
    with mock.patch("spirillum.cli.progress.FIRST", 600.0):
        yield


@pytest.fixture
def run() -> Callable[..., Outcome]:
    """Run a command and return its exit code and output."""
    return run_command


@pytest.fixture(scope="session")
def batch_of() -> Callable[..., Any]:
    """One robot as a batch: a preset and overrides, dotted fields with dots or with double underscores."""
    from spirillum.robot.batch import RobotBatch
    from spirillum.robot.load import load

    def make(*, preset: str = "biorob2012-wide", **overrides: Any) -> RobotBatch:
        return RobotBatch.of(load(preset, **{name.replace("__", "."): value for name, value in overrides.items()}))

    return remembered(make)


@pytest.fixture(scope="session")
def wide(batch_of: Callable[..., Any]) -> Any:
    """The paper's robot in the wide channel, with the tail that Fig. 5 names (25 mm, 2.5 mm)."""
    return batch_of()


@pytest.fixture
def unplaced(monkeypatch: pytest.MonkeyPatch) -> None:
    """Panels and words stay where they are made: finding room for them takes most of the time of a figure."""
    monkeypatch.setattr("spirillum.view.figures.sheet.lay_out", lambda _figure: None)


@dataclass(frozen=True)
class StokesSphere:
    """The exact flow around a sphere at the origin: a stand-in for a robot's flow with a known truth; SI."""

    radius: float = 0.012
    viscosity: float = 3.5
    velocity: tuple[float, float, float] = (1.2e-3, 0.0, 0.3e-3)
    rotation: tuple[float, float, float] = (-0.2, 0.1, 0.0)

    def inside(self, points: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points, axis=1) < self.radius

    def fields(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        from spirillum import InputError

        if self.inside(points).any():
            raise InputError("point lies inside the sphere")
        r = np.linalg.norm(points, axis=1, keepdims=True)
        n, a, speed = points / r, self.radius, np.array(self.velocity)
        along = (n @ speed)[:, None]
        moved = 0.75 * a / r * (speed + along * n) + 0.25 * (a / r) ** 3 * (speed - 3 * along * n)
        turned = (a / r) ** 3 * np.cross(np.array(self.rotation), points)
        return moved + turned, (1.5 * self.viscosity * a * along / r**2)[:, 0]

    def wrench(self) -> np.ndarray:
        """6 pi mu a U and 8 pi mu a^3 Omega."""
        drag = 6 * np.pi * self.viscosity * self.radius
        return np.concatenate([drag * np.array(self.velocity), 4 / 3 * drag * self.radius**2 * np.array(self.rotation)])


@pytest.fixture(scope="session")
def sphere() -> StokesSphere:
    """The flow around a sphere that moves and turns."""
    from spirillum.fields.fluid_field import FluidField

    FluidField.register(StokesSphere)  # not derived from it: modules may be imported only once their hooks are set
    return StokesSphere()


# A made-up resistance beside that of resistive force theory: symmetric, N s/m, N s, N m s.
_WALLS = np.array(
    [
        [1.1, 2e-5, -0.25, 3e-5],
        [2e-5, 4e-5, -4e-5, -6e-7],
        [-0.25, -4e-5, 0.6, 1e-4],
        [3e-5, -6e-7, 1e-4, 6e-6],
    ]
)
_WRENCH_PER_FLOW = np.array([[2.1, -3e-5, 0.9, 4e-4]])
_PLUG = (0.2, 1e-5, 0.15, -2e-5)


@pytest.fixture
def walled(monkeypatch: pytest.MonkeyPatch) -> Any:
    """A model with made-up walls and a made-up imposed flow, known by its name: its truth is linear algebra."""
    from spirillum.envelope import quantity
    from spirillum.fluid.closed.rft import Rft
    from spirillum.fluid.model import AxialFlow
    from spirillum.fluid.registry import MODELS, SWIMMER_MODELS
    from spirillum.robot.limits import Limit

    class Walled(Rft):
        name = "walled"
        title = "made up"
        placed = True

        def domain(self, batch: Any) -> list[Limit]:
            gap = np.full(1, batch.placement.gap or 0.0)
            return [
                *super().domain(batch),
                Limit.of("placement.gap", gap, "at most", 5e-3, "mm", "the body has to fit", "gap-too-wide"),
            ]

        def axial(self, batch: Any) -> np.ndarray:
            return super().axial(batch) + _WALLS

        def axial_flow(self, batch: Any) -> AxialFlow:
            flow = batch.placement.flow or 0.0
            return AxialFlow(self.axial(batch), flow * _WRENCH_PER_FLOW, np.array([[*_PLUG, 0.7 * flow]]))

        def placement_of(self, batch: Any) -> dict[str, Any]:
            place = batch.placement
            ends = place.ends_of(float(batch.channel_length[0]))
            return {"kind": "in the channel", "gap": quantity(place.gap, "m"), "ends": ends}

    model = Walled()
    monkeypatch.setitem(SWIMMER_MODELS, model.name, model)
    monkeypatch.setitem(MODELS, model.name, model)
    return model
