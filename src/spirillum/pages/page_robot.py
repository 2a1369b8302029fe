"""One robot of the page: what is set on it, how it came there, and how it swims."""

from __future__ import annotations

import base64
import math
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.errors import InputError, failure_sentence
from spirillum.notes import notes_in
from spirillum.pages.job import BackgroundJob, worker
from spirillum.pages.knobs import MODELS, Settings, report_fault
from spirillum.pages.robot_data import SERIES, SampleRecording, axial_forces_of, finite, quantity_list, shape_of
from spirillum.progress import Progress
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load, preset_names
from spirillum.robot.robot import Robot, robot_text

if TYPE_CHECKING:
    import xarray as xr

    from spirillum.dynamics.plant import Plant, Snapshot


_RESOLUTION = 96  # points along the plane
_COARSE: Mapping[str, Any] = {"tolerance": 0.05}  # of the tube's flow: the plane is a picture
_FASTEST = 0.98  # share of the points that are slower than what has the fullest colour


class Flowing(BackgroundJob):
    """Pending or completed computation of a flow plane."""

    def __init__(
        self, robot: Robot, model: str, run: Mapping[str, str], phase: float, announce: Callable[[], None]
    ) -> None:
        """Begin with `gap`, `pitch`, `flow` of the run where they are set; `announce` is called from a thread."""
        requested = {"robot": robot_text(robot), "model": model, "run": dict(run), "phase": phase}
        super().__init__(__name__, requested, announce)

    def describe(self) -> dict[str, Any]:
        """Progress, without the plane itself."""
        said = self.progress()
        return {name: said[name] for name in ("what", "failed", "done") if name in said}


def page_plane(plane: xr.Dataset, phase: float) -> dict[str, Any]:
    """Flow plane `xz` for the page: velocities along x and z in rows of rising z, m/s, NaN in solids."""
    velocity = [plane[name].transpose("z", "x").values for name in ("velocity_x", "velocity_z")]
    speed = np.hypot(*velocity)
    warnings = list(notes_in(plane.attrs))
    return {
        "model": plane.attrs["model"],
        "phase": phase,
        "size": [plane.sizes["x"], plane.sizes["z"]],
        "x": [float(plane["x"].min()), float(plane["x"].max())],
        "z": [float(plane["z"].min()), float(plane["z"].max())],
        "fastest": float(np.nanquantile(speed, _FASTEST)),
        "velocity": [base64.b64encode(part.astype("<f4").tobytes()).decode() for part in velocity],
        "warnings": warnings,
    }


def _flowing(request: dict[str, Any], progress: Progress) -> dict[str, Any]:
    from spirillum.fields.flow import FLOW_MODELS, flow

    model = request["model"] if request["model"] in FLOW_MODELS else "slender"
    walled = model == "tube"
    progress("solving for the flow", 0, 0)
    around = flow(
        tomllib.loads(request["robot"]),
        model=model,
        placement=request["run"] if walled else None,
        resolution=_COARSE if walled else None,
        phase=request["phase"],
    )
    shown = page_plane(around.plane("xz", resolution=_RESOLUTION, progress=progress), request["phase"])
    forces = axial_forces_of(around.prediction) if walled else []  # without walls they stand beside the numbers
    return {"plane": shown | {"forces": forces}}


if __name__ == "__main__":
    worker(_flowing)


_ONE_TURN = 1.0  # changes of one control within this time are one step of undo, s
_MOST_UNDO = 200


_Shape = tuple[Any, dict[str, Any]]  # parameters of a shape, and the shape


def _shaped(robot: Robot, before: _Shape | None) -> _Shape:
    """The shape of a robot; the one before where it is the same."""
    solid = (robot.body, robot.seal, robot.coupling, robot.tail, robot.channel, robot.motor)
    return before if before is not None and before[0] == solid else (solid, shape_of(robot))


@dataclass(frozen=True)
class Built:
    """Released robot, its model, and its warnings."""

    plant: Plant
    model: str
    reason: str
    caution: str
    provisional: bool  #: Whether it swims without walls only until the table of its tube is made.


def build(settings: Settings, robot: Robot) -> Built:
    """Lay a robot down; until the table of its tube is made it swims provisionally by a model without walls."""
    from spirillum.dynamics.plant import Plant  # loads compiled loops: the page is there before
    from spirillum.swimming.preparation import UNBOUNDED, WALLED, choose_model, has_table

    placed = settings.placement()
    if robot.drive is None:
        raise InputError(f"{robot.name} has no [drive]; allowed: a robot with one")
    requested = "auto" if settings.model == "tube" and robot.channel is not None else settings.model
    choice = choose_model(requested, robot, placement=placed)
    in_tube = choice.model == WALLED and robot.channel is not None
    provisional = in_tube and not has_table(RobotBatch.of(robot, placed), "yaw")
    model = UNBOUNDED if provisional else choice.model
    cautions = ["provisional, without walls: the table of its tube is being made"] if provisional else []
    if model != WALLED:
        placed = placed.model_copy(update={"flow": None})
        if settings.run.get("flow"):
            cautions.append("the imposed flow is left out, which only 'tube' knows")
    plant = Plant(robot, model=model, placement=placed)
    return Built(plant, model, choice.reason, "; ".join(cautions), provisional)


@dataclass
class PageRobot:
    """One robot; only the thread of the simulation writes to it."""

    settings: Settings
    robot: Robot
    remote: bool = True
    duty: float = 1.0
    built: Built | None = None
    moment: Snapshot | None = None
    numbers: dict[str, Any] | None = None  #: The prediction, as the page shows it.
    failure: str = ""  #: Why it does not swim, in a sentence.
    generation: int = 0  #: Counts what was set; what is built for an older one is dropped.
    revision: int = 0  #: Counts what changes the prediction, which duty and imposed flow do while the robot swims on.
    recording: SampleRecording = field(default_factory=SampleRecording)
    preparing: dict[str, Any] | None = None  #: Progress of a table that is being made.
    since: float = 0.0  #: When it was released, by the clock of `time.monotonic`, s.
    flowing: Flowing | None = None  #: Displayed or pending flow.
    _undo: list[Settings] = field(default_factory=list)
    _redo: list[Settings] = field(default_factory=list)
    _last: tuple[str, float] = ("", 0.0)
    _shape: _Shape | None = None

    @classmethod
    def of(cls, source: Any) -> PageRobot:
        """Create a robot of the page from a preset, a file or a robot."""
        robot = load(source)
        own = robot.drive.duty if robot.drive is not None else 1.0
        return cls(Settings(source), robot, duty=own)

    def set(self, name: str, value: str) -> None:
        """Change one field."""
        self._become(self.settings.changed(name, value), name)

    def preset(self, name: str, own: Any) -> None:
        """Start from another robot: a preset, or `own`, the one that the page was started with."""
        if name != "own" and name not in preset_names():
            raise InputError(f"preset {name[:60]!r}; allowed: {', '.join(preset_names())}")
        self._become(Settings(own if name == "own" else name), "")
        self.set_duty()

    def swap(self, source: Robot, overrides: Mapping[str, str]) -> None:
        """Another robot, with other values of some fields."""
        preset = source.name in preset_names() and load(source.name) == source
        chosen = source.name if preset else source  # a preset can be named on the command line
        self._become(replace(self.settings, source=chosen, overrides=dict(overrides)), "")
        self.set_duty()

    def set_duty(self, duty: float | None = None) -> None:
        """Turn the remote's duty; None: that of the robot's own drive."""
        if duty is None:
            duty = self.robot.drive.duty if self.robot.drive is not None else 1.0
        self.duty = duty
        self.void_numbers()

    def undo(self, *, forward: bool = False) -> None:
        """Undo one change, or redo it."""
        source, target = (self._redo, self._undo) if forward else (self._undo, self._redo)
        if source:
            target.append(self.settings)
            self.settings = source.pop()
            self.robot = self.settings.robot()
            self._last = ("", 0.0)
            self.start_anew()

    def start_anew(self) -> None:
        """Discard the run; the robot is released again once it is built."""
        self.generation += 1
        self.built = self.moment = None
        self.failure = ""
        self.preparing = None
        self.recording = SampleRecording()
        self.void_numbers()

    def void_numbers(self) -> None:
        """Show no prediction and no flow until those of the present robot, duty and imposed flow are there."""
        self.revision += 1
        self.numbers = None
        self.without_flow()

    def with_flow(self, announce: Callable[[], None]) -> None:
        """Compute the flow around it, with its tail as it is now."""
        if self.built is None or self.moment is None:
            raise InputError("flow: the robot does not swim yet; allowed: one that swims")
        self.without_flow()
        phase = self.moment.pose.tail_phase % (2.0 * math.pi)
        self.flowing = Flowing(self.predicted(), self.built.model, self.settings.run, phase, announce)

    def without_flow(self) -> None:
        """No flow is shown."""
        if self.flowing is not None:
            self.flowing.stop()
        self.flowing = None

    def take(self, built: Built) -> None:
        """Take over the released robot."""
        self.built, self.failure, self.since = built, "", time.monotonic()
        self.moment = built.plant.observe()
        self.recording = SampleRecording()
        self.recording.add(self.moment, self.duty if self.remote else 0.0)

    def advance(self, dt: float) -> None:
        """Swim on for a time, s."""
        if self.built is None or (self.moment is not None and self.moment.ended) or self.failure:
            return
        duty = self.duty if self.remote else 0.0
        try:
            self.moment = self.built.plant.step(dt, duty=duty)
        except Exception as error:  # the other robots swim on
            report_fault(error)
            self.failure = failure_sentence(error)
            return
        self.recording.add(self.moment, duty)

    def flow(self, value: str) -> bool:
        """Change the imposed flow in motion; False if the robot has to be released anew for it."""
        before = self.settings
        self.settings = self.settings.changed("run.flow", value)
        if self.built is None or self.built.model != "tube":
            self.settings = before
            return False
        try:
            self.built.plant.impose_flow(self.settings.placement().flow)
        except InputError:
            self.settings = before
            raise
        self.void_numbers()
        self._remember(before, "run.flow")
        return True

    def _become(self, settings: Settings, name: str) -> None:
        robot = settings.robot()
        settings.placement()
        self._shape = _shaped(robot, self._shape)
        self._remember(self.settings, name)
        self.settings, self.robot = settings, robot
        self.start_anew()

    def _remember(self, before: Settings, name: str) -> None:
        now = time.monotonic()
        if not (name and name == self._last[0] and now - self._last[1] < _ONE_TURN):
            self._undo.append(before)
            del self._undo[:-_MOST_UNDO]
        self._redo.clear()
        self._last = (name, now)

    def predicted(self) -> Robot:
        """The robot of the displayed prediction: at the duty of the remote."""
        drive = self.robot.drive
        if drive is None or self.duty == drive.duty:
            return self.robot
        return self.robot.model_copy(update={"drive": drive.model_copy(update={"duty": self.duty})})

    def command_settings(self) -> Settings:
        """Settings of that robot, as a command line gives them."""
        if self.predicted() is self.robot:
            return self.settings
        return replace(self.settings, overrides={**self.settings.overrides, "drive.duty": f"{self.duty:.6g}"})

    def scene(self) -> dict[str, Any]:
        """State that changes with settings: shape, knobs, model, prediction."""
        self._shape = _shaped(self.robot, self._shape)
        built = self.built
        return {
            "robot": self.robot.name,
            "description": self.robot.description or "",
            "source": self.settings.source if isinstance(self.settings.source, str) else "own",
            "shape": self._shape[1],
            "knobs": self.settings.knob_data(self.robot),
            "model": self.settings.model,
            "models": list(MODELS) if self.robot.channel is not None else [m for m in MODELS if m != "tube"],
            "drive": self.robot.drive.kind if self.robot.drive is not None else "",
            "swims_by": built.model if built else "",
            "reason": built.reason if built else "",
            "caution": built.caution if built else "",
            "provisional": built.provisional if built else False,
            "roughness": built.plant.roughness if built else None,
            "preparing": self.preparing,
            "flow": None if self.flowing is None else self.flowing.describe(),
            "trouble": self.failure,
            "numbers": self.numbers,
            "quantities": quantity_list(self.numbers["rows"] if self.numbers else None),
            "warnings": list(self.robot.warnings),
            "undo": len(self._undo),
            "redo": len(self._redo),
            "generation": self.generation,
            "remote": self.remote,
            "duty": self.duty,
        }

    def frame(self) -> dict[str, Any]:
        """State that changes with time: pose and quantities; SI."""
        moment = self.moment
        if moment is None:
            return {"generation": self.generation, "ready": False}
        return {
            "generation": self.generation,
            "ready": True,
            "time": moment.time,
            "position": moment.pose.position.tolist(),
            "attitude": moment.pose.attitude.tolist(),
            "tail_phase": moment.pose.tail_phase,
            "values": {name: finite(moment.values[name]) for name in SERIES if name in moment.values},
            "ended": moment.ended,
        }
