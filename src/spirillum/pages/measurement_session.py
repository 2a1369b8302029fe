"""Measurement session of the page: uploaded videos, the form of their setup, measurement and calibration.

All files lie in one temporary folder, under names that the page gives, and are removed with it.
"""

from __future__ import annotations

import atexit
import math
import shutil
import threading
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spirillum.calibration.methods import METHODS
from spirillum.data_tables import records_of
from spirillum.errors import InputError, check_choice, clipped
from spirillum.files import scratch_folder
from spirillum.pages.job import BackgroundJob
from spirillum.pages.video_store import VideoStore, plain, plain_names
from spirillum.robot.load import load, preset_names
from spirillum.robot.model_options import CALIBRATED
from spirillum.robot.robot import Robot, robot_text
from spirillum.swimming.preparation import AUTO, WALLED
from spirillum.units import KINDS, parse_option

if TYPE_CHECKING:
    from spirillum.arrays import Samples
    from spirillum.vision.camera.ruler import Lines
    from spirillum.vision.camera.scale import CalibratedCamera

_LONGEST = 200  # characters of a field


@dataclass(frozen=True)
class Entry:
    """One field of the setup file."""

    field: str
    label: str
    group: str
    example: str  #: Placeholder of an empty field: its meaning, or an example.
    note: str
    choices: tuple[str, ...] = ()
    number: bool = False  #: Whether it is a bare number, without a unit.
    uncertain: bool = False  #: Whether it has a standard uncertainty in a field of its own.


FORM = records_of("pages/setup_form.csv", Entry)  #: Fields of the form, without the robot's file.

_NUMBERS = {entry.field for entry in FORM if entry.number} | {"tank.index_uncertainty"}
_KNOWN = {entry.field for entry in FORM} | {f"{entry.field}_uncertainty" for entry in FORM if entry.uncertain}


def form_fields(given: Mapping[str, Any], robots: tuple[str, ...]) -> dict[str, Any]:
    """Fields of a setup from a form or a file, without empty ones."""
    found: dict[str, Any] = {}
    for name, value in given.items():
        if name != "robot.file" and name not in _KNOWN:
            raise InputError(f"{str(name)[:60]} is no field of this form; allowed: {', '.join(sorted(_KNOWN))}")
        if isinstance(value, list) and name == "robot.stripes":
            value = ", ".join(map(str, value))  # noqa: PLW2901
        known = isinstance(value, (str, int, float)) and not isinstance(value, bool)
        text = str(value).strip() if known else clipped(value)
        if not known or len(text) > _LONGEST or not text.isprintable():
            raise InputError(f"{name} = {text[:60]!r}; allowed: a text of at most {_LONGEST} printable characters")
        if name == "robot.file" and text not in robots:
            raise InputError(f"robot.file = {text[:60]!r}; allowed: {', '.join(robots)}")
        if text:
            found[name] = _typed(name, text)
    return found


def _typed(name: str, text: str) -> Any:
    if name == "robot.stripes":
        return [part.strip() for part in text.split(",") if part.strip()]
    if name in _NUMBERS:
        with suppress(ValueError):
            number = float(text.replace(",", "."))
            if math.isfinite(number):  # JSON has no others; as text its field refuses it
                return number
    return text


ROBOT_FILE, _SETUP = "robot.toml", "setup.toml"
_START: Mapping[str, Any] = {"robot.file": "biorob2012-wide", "robot.direction": "right", "camera.view": "top"}
_SIZE_APART = 0.06  # relative difference of a clicked body's length from that of its file above which it is reported
_MOST_STILLS = 4


class SetupEditor:
    """Setup of some videos; its methods are thread-safe."""

    def __init__(self, folder: Path, films: VideoStore) -> None:
        self._folder, self._films = folder, films
        self._lock = threading.RLock()
        self._fields: dict[str, Any] = dict(_START)
        self._stills: dict[tuple[Any, ...], Samples] = {}

    def add_text(self, text: str) -> None:
        """Take a setup file, or a robot file."""
        from spirillum.files import parse_toml
        from spirillum.measurement.setup_template import setup_fields

        table = parse_toml(text, "the file", "a setup file or a robot file (TOML)")
        if "camera" in table or "markers" in table:
            self.set_fields(setup_fields(text, "the file"))
            return
        base = table.get("extends")
        if base is not None and base not in preset_names():
            raise InputError(f"extends = {str(base)[:60]!r}; allowed on the page: {', '.join(preset_names())}")
        with plain_names(self._folder):
            self.take_robot(load(table))

    def take_robot(self, robot: Robot) -> None:
        """Measure this robot."""
        with self._lock:
            (self._folder / ROBOT_FILE).write_text(robot_text(robot), encoding="utf-8")
            self._fields["robot.file"] = ROBOT_FILE

    def set_fields(self, given: Mapping[str, Any]) -> None:
        """Fill in the setup."""
        found = form_fields(given, self.robots())
        with self._lock:
            self._fields = {"robot.file": self._fields["robot.file"], **found}

    def robots(self) -> tuple[str, ...]:
        """Names that the robot may have: the presets, and the robot file that was sent."""
        own = (ROBOT_FILE,) if (self._folder / ROBOT_FILE).is_file() else ()
        return (*own, *preset_names())

    def setup_text(self) -> str:
        """The setup file as it stands."""
        from spirillum.measurement.setup_template import setup_file

        with self._lock:
            return setup_file(self._fields)

    def robot_text(self) -> str:
        """Text of the robot file."""
        return robot_text(self._robot())

    def fields(self) -> dict[str, Any]:
        """Values of the fields."""
        with self._lock:
            return dict(self._fields)

    def _robot(self) -> Robot:
        name = self._fields["robot.file"]
        return load(self._folder / name if name == ROBOT_FILE else name)

    def checked(self) -> dict[str, Any]:
        """What is wrong in the setup, or what its uncertain heights do to lengths."""
        from spirillum.measurement.setup_template import setup_answer, setup_problems

        problems = setup_problems(self._fields)
        if problems:
            return {"problems": problems}
        try:
            with plain_names(self._folder):
                answer = setup_answer(self.written())
        except InputError as error:
            return {"problems": [str(error)]}
        return {
            "problems": [],
            "scale_uncertainty": answer["scale_uncertainty"],
            "scale_sources": answer["scale_sources"],
            "warnings": answer.get("warnings", []),
        }

    def written(self) -> Path:
        """Write the setup file."""
        path = self._folder / _SETUP
        path.write_text(self.setup_text(), encoding="utf-8")
        return path

    def click(self, what: str, name: str, time: float, points: list[tuple[float, float]], length: str = "") -> str:
        """Fill in `ruler`, `body` or `stripes` by pointing at pixels of the picture; what came of it, in a sentence."""
        from spirillum.measurement.clicks import across, nose_side, stripe_names, stripes_in_order

        if what == "stripes":
            robot = self._robot()
            stated = robot.seal.stripes if robot.seal else ()
            places = across(points, self._fields.get("robot.direction", "right"))
            seen = stripe_names(self._films.frame(name, time), places, stated)
            stripes, sentence = stripes_in_order(seen, stated)
            self._put("robot.stripes", list(stripes))
            return f"{', '.join(seen)}: {sentence}"
        if len(points) != 2:
            raise InputError(f"{len(points)} clicks; allowed: two")
        one, other = points
        if what == "body":
            side = nose_side(one, other)
            self._put("robot.direction", side)
            return f"the nose points to the {side}{self._clicked_size_ratio(name, one, other)}"
        if what != "ruler":
            raise InputError(f"what = {what[:20]!r}; allowed: ruler, body, stripes")
        return self._ruled(name, one, other, parse_option("length", length, KINDS["length"]))

    def _put(self, field: str, value: Any) -> None:
        with self._lock:
            self._fields.pop(field, None)
            if value:
                self._fields[field] = value

    def _ruled(self, name: str, one: tuple[float, float], other: tuple[float, float], length: float) -> str:
        from spirillum.measurement.clicks import length_per_pixel_between, spacing_between

        lines = self._lines(name)
        if lines is not None:
            spacing = spacing_between(lines, one, other, length)
            self._put("markers.length_per_pixel", "")
            self._put("markers.spacing", f"{1e3 * spacing:.9g} mm")
            return f"{round(length / spacing)} spacings of {1e3 * spacing:.4g} mm"
        needed = ("camera.height", "markers.height", "robot.axis_height")
        missing = [entry.label.lower() for entry in FORM if entry.field in needed and entry.field not in self._fields]
        if missing:
            raise InputError(
                "no ruler of equally spaced lines is seen, so that the marks give a length per pixel: the heights "
                f"({', '.join(missing)}) have to be set in the form first"
            )
        heights = {name: parse_option(name, self._fields[name], KINDS["length or zero"]) for name in needed}
        surface, index = self._fields.get("tank.surface"), self._fields.get("tank.index", 1.4)
        if not isinstance(index, (int, float)):
            raise InputError(f"tank.index = {str(index)[:40]!r}; allowed: a number")
        scale = length_per_pixel_between(
            one,
            other,
            length,
            heights=(heights["markers.height"], heights["robot.axis_height"]),
            camera=heights["camera.height"],
            surface=None if surface is None else parse_option("tank.surface", surface, KINDS["length"]),
            index=index,
        )
        self._put("markers.spacing", "")
        self._put("markers.length_per_pixel", f"{1e3 * scale:.6g} mm")
        return f"no ruler of equally spaced lines is seen: {1e3 * scale:.4g} mm a pixel at the robot's axis"

    def _still(self, name: str) -> Samples:
        """The static background of a video; the last ones are cached."""
        from spirillum.vision.camera.camera import samples_of
        from spirillum.vision.camera.ruler import still_picture

        key = (name, self._fields.get("start"), self._fields.get("end"))
        if key not in self._stills:
            with plain_names(self._folder):
                frames = samples_of(self._films.video(name), self._time("start") or 0.0, self._time("end"))
            while len(self._stills) >= _MOST_STILLS:
                self._stills.pop(next(iter(self._stills)))
            self._stills[key] = still_picture([frame.image for frame in frames])
        return self._stills[key]

    def _time(self, field: str) -> float | None:
        text = self._fields.get(field)
        return None if text is None else parse_option(field, text, KINDS["time"])

    def _lines(self, name: str) -> Lines | None:
        from spirillum.vision.camera.ruler import lines_in

        still = self._still(name)
        return lines_in(still, (0, 0, still.shape[1], still.shape[0]))

    def _clicked_size_ratio(self, name: str, nose: tuple[float, float], rear: tuple[float, float]) -> str:
        """Clicked length of the body over that of its file, if the setup is complete and the ratio is far from 1."""
        if self.checked()["problems"]:
            return ""
        scale = self._sight(name).scale.length_per_pixel
        ratio = math.hypot(nose[0] - rear[0], nose[1] - rear[1]) * scale / self._robot().body.length
        if abs(ratio - 1.0) < _SIZE_APART:
            return f"; the body is as long as that of its file, to {100 * abs(ratio - 1.0):.0f} %"
        return f"; the body is {ratio:.2f} times as long as that of its file: look at robot, heights and spacing"

    def _sight(self, name: str) -> CalibratedCamera:
        from spirillum.vision.camera.camera import sight_of
        from spirillum.vision.setup import load_setup

        with plain_names(self._folder):
            setup, _ = load_setup(self.written())
            return sight_of(self._films.video(name), setup, self._still(name), self._folder)

    def propose(self, name: str) -> list[dict[str, Any]]:
        """Fill in what a video alone determines, as `spirillum setup propose` does; return it with its uncertainty."""
        from spirillum.measurement.proposal import propose_setup

        chosen = self._fields["robot.file"]
        robot = str(self._folder / chosen) if chosen == ROBOT_FILE else chosen
        with plain_names(self._folder):
            found = propose_setup(self._films.video(name).path, robot).findings
        for finding in found:
            if finding.confidence == "clear" and finding.field in ("robot.direction", "robot.stripes"):
                self._put(finding.field, finding.value)
        return [{"name": one.name, "sentence": one.sentence, "confidence": one.confidence} for one in found]

    def look(self, name: str) -> dict[str, Any]:
        """Initial detection in a video: the strips of its ruler, and with a complete setup its scale."""
        import numpy as np

        lines = self._lines(name)
        strips: list[list[float]] = []
        if lines is not None:
            for label in np.unique(lines.strip):
                pixels = lines.pixels[lines.strip == label]
                strips.append([*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist()])
        found: dict[str, Any] = {"strips": strips, "lines": 0 if lines is None else lines.lines}
        if not self.checked()["problems"]:
            scale = self._sight(name).scale
            found |= {"length_per_pixel": scale.length_per_pixel, "uncertainty": scale.relative_uncertainty}
        return found


_MODELS = (AUTO, *CALIBRATED, WALLED)


class MeasurementSession:
    """Videos, setup and results; its methods are thread-safe."""

    def __init__(self) -> None:
        self._kept = ExitStack()
        self._folder = self._kept.enter_context(scratch_folder())
        atexit.register(self._kept.close)  # where the process ends before it has served
        self._lock = threading.RLock()
        self.films = VideoStore(self._folder)
        self.editor = SetupEditor(self._folder, self.films)
        self._job: BackgroundJob | None = None
        self._kind, self._runs = "", 0
        self._results: dict[str, dict[str, Any]] = {}
        self._folders: dict[str, Path] = {}

    def close(self) -> None:
        """Stop what runs, and remove all files."""
        self.stop()
        self._kept.close()

    def measure(self) -> None:
        """Start to measure all videos."""
        with self._lock:
            films = [str(path) for path in self.films.paths()]
            if not films:
                raise InputError("no video is uploaded; allowed: at least one")
            problems = self.editor.checked()["problems"]
            if problems:
                raise InputError(problems[0])
            self._start("measure", {"films": films, "setup": str(self.editor.written())})

    def compare_with_run(self, name: str) -> dict[str, Any]:
        """A measured trial beside the simulated robot; see `spirillum.pages.replay`."""
        from spirillum.dynamics.run_file import open_run
        from spirillum.pages.replay import trial_with_run

        with self._lock:
            trials = self._results.get("measure", {}).get("trials", [])
            folder = self._folders.get("measure", self._folder)
        if name not in [trial["name"] for trial in trials]:
            raise InputError(f"trial {name[:40]!r}; allowed: one that was measured")
        with plain_names(self._folder):
            return trial_with_run(open_run(folder / f"{name}.nc"), f"{name}.annotated.mp4")

    def calibrate(self, model: str, method: str) -> None:
        """Begin to calibrate with what was measured."""
        for word, value, allowed in (("model", model, _MODELS), ("method", method, METHODS)):
            check_choice(word, value, allowed)
        with self._lock:
            table = self._folders.get("measure", self._folder) / "observations.csv"
            if not table.is_file():
                raise InputError("no trial gave a speed or a rate of a robot in a channel; allowed: to measure first")
            robot = self._folders["measure"] / ROBOT_FILE
            robot.write_text(self.editor.robot_text(), encoding="utf-8")
            requested = {"observations": str(table), "robot": str(robot), "model": model, "method": method}
            self._start("calibrate", requested)

    def _start(self, kind: str, request: dict[str, Any]) -> None:
        if self._job is not None and self._job.running:
            raise InputError("something is being computed; allowed: one thing at a time")
        for later in ("measure", "calibrate") if kind == "measure" else ("calibrate",):
            self._results.pop(later, None)
            if (old := self._folders.pop(later, None)) is not None:
                shutil.rmtree(old, ignore_errors=True)
        self._runs += 1
        output = self._folders[kind] = self._folder / f"{kind}-{self._runs}"
        output.mkdir()
        self._kind = kind
        self._job = BackgroundJob("spirillum.pages.measuring", {"what": kind, "output": str(output), **request})

    def stop(self) -> None:
        """Leave off what is being computed."""
        if self._job is not None and self._job.running:
            self._job.stop()

    def state(self) -> dict[str, Any]:
        """State of the session, for the page."""
        with self._lock:
            job = self._progress()
            return {
                "films": self.films.describe(),
                "form": [asdict(entry) for entry in FORM],
                "fields": self.editor.fields(),
                "robots": list(self.editor.robots()),
                "setup": self.editor.setup_text(),
                "check": self.editor.checked(),
                "job": job,
                "results": dict(self._results),
                "models": list(_MODELS),
                "methods": list(METHODS),
            }

    def _progress(self) -> dict[str, Any] | None:
        if self._job is None:
            return None
        said, running = self._job.progress(), self._job.running
        if said.get("done"):
            self._results[self._kind] = said["shown"]
            self._job = None
            return None
        if not running or "failed" in said:
            return {"kind": self._kind, "failed": plain(str(said.get("failed", "it was left off")), self._folder)}
        return {"kind": self._kind, **{key: said.get(key) for key in ("what", "done_places", "places")}}

    def result_file(self, name: str) -> Path | None:
        """A file of the results by its name; None if there is none of that name."""
        with self._lock:
            for kind, found in self._results.items():
                if name in (*found["files"], *found.get("figures", ())):
                    return self._folders[kind] / name
        return None
