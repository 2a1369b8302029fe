"""Runs to replay, from files or from the page, their comparison with a measured trial, and downloads of the page."""

from __future__ import annotations

import base64
import json
import re
import shlex
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.dynamics.run_file import open_run, poses_of, robot_of
from spirillum.errors import InputError
from spirillum.formats.templates import rendered
from spirillum.pages.knobs import Settings
from spirillum.pages.page_robot import PageRobot
from spirillum.pages.robot_data import SERIES, finite, quantity_list, shape_of, thinned
from spirillum.pages.video_store import read_upload
from spirillum.robot.robot import robot_text
from spirillum.version import package_version

if TYPE_CHECKING:
    import xarray as xr

LARGEST_RUN = 64 << 20  #: Bytes of a run that is dropped on the page.
_MOST = 6_000  # samples of a replay; longer runs are thinned, which the replay states


def replay_of_run(dataset: xr.Dataset) -> dict[str, Any]:
    """A run to replay; the samples are the file's own."""
    robot = robot_of(dataset)
    shape = shape_of(robot)
    level = 0.0 if shape["tube_radius"] is None else shape["radius"] - shape["tube_radius"]
    poses = poses_of(dataset, level)
    chosen = thinned(poses.time.size, _MOST)
    roughness = dataset.attrs.get("roughness")
    return {
        "robot": robot.name,
        "model": str(dataset.attrs.get("model", "")),
        "shape": shape,
        "roughness": float(roughness) if roughness is not None else None,
        "samples": int(poses.time.size),
        "run": {
            **{name: getattr(poses, name)[chosen].tolist() for name in ("time", "position", "attitude", "tail_phase")},
            "duty": _series(dataset, "duty", chosen),
            "values": {name: _series(dataset, name, chosen) for name in SERIES if _is_series(dataset, name)},
        },
    }


def replay_of_upload(content: bytes) -> dict[str, Any]:
    """A run to replay from the bytes of its file."""
    return read_upload(content, "run.nc", lambda path: replay_of_run(open_run(path)))


def replay_of_swimmer(swimmer: PageRobot, run: dict[str, Any]) -> dict[str, Any]:
    """Replay of a robot of the page up to now."""
    return {
        "robot": swimmer.robot.name,
        "model": swimmer.built.model if swimmer.built else "",
        "shape": shape_of(swimmer.robot),
        "roughness": swimmer.built.plant.roughness if swimmer.built else None,
        "samples": len(run["time"]),
        "run": run,
    }


def _is_series(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset.variables and dataset[name].dims == ("time",)


def _series(dataset: xr.Dataset, name: str, chosen: np.ndarray[tuple[int], np.dtype[np.int64]]) -> list[float | None]:
    if not _is_series(dataset, name):
        return []
    return [finite(value) for value in np.asarray(dataset[name].values, dtype=float)[chosen].tolist()]


_MOST_OF_CURVE = 3_000  # samples of a curve
_LONGEST = 120.0  # length of a run that is simulated beside a trial, s
_TURN = 2.0 * np.pi
_FROM_START = (("distance", "mm", 1e3), ("tail turns", "", 1.0 / _TURN), ("body turns", "", 1.0 / _TURN))
"""Compared curves, relative to the first frame: label, unit, and factor from SI."""


def trial_with_run(trial: xr.Dataset, film: str) -> dict[str, Any]:
    """Replay of the trial's simulated robot, with the trial's video and curves."""
    # The simulated robot starts from rest with the first measured frame, with the tail as its file says.
    from spirillum.dynamics.simulation import simulate

    robot = robot_of(trial)
    times = np.asarray(trial["time"].values, dtype=float)
    if times.size < 2:
        raise InputError("the trial has fewer than two frames; allowed: one in which the robot was tracked")
    length = min(float(times[-1] - times[0]), _LONGEST)
    run = simulate(robot, timing={"duration": length}, in_tube={"wait": 0.0} if robot.channel else None)
    return replay_of_run(run) | {
        "film": {"name": film, "start": float(times[0])},
        "compared": compared_series(trial, run),
    }


def compared_series(trial: xr.Dataset, run: xr.Dataset) -> list[dict[str, Any]]:
    """Distance and turns of the simulated and of the tracked robot, both from their first sample; SI."""
    first = float(trial["time"][0])
    sources = zip(_FROM_START, _progress(run, "tail_angle"), _progress(trial, "tail_phase"), strict=True)
    found = []
    for (label, unit, factor), simulated, tracked in sources:
        curves = [_curve(run["time"].values, simulated), _curve(trial["time"].values - first, tracked)]
        found.append({"label": label, "unit": unit, "factor": factor, "run": curves[0], "tracked": curves[1]})
    return found


def _progress(dataset: xr.Dataset, tail: str) -> list[Samples]:
    """Distance along the channel, m, and angles of tail and body in the lab, rad, from the first finite sample."""
    columns = [dataset["position"].values[:, 0], dataset[tail].values, dataset["body_angle"].values]
    return [column - next(iter(column[np.isfinite(column)]), np.nan) for column in columns]


def _curve(time: Samples, values: Samples) -> dict[str, list[float | None]]:
    chosen = thinned(len(time), _MOST_OF_CURVE)
    return {"time": [float(t) for t in time[chosen]], "values": [finite(float(value)) for value in values[chosen]]}


MODULES = ("format.js", "matrix.js", "renderer.js", "layers.js", "stage.js", "section.js", "plots.js", "replay.js")
"""Modules that a replay needs, each after those that it imports."""
_IMPORT = re.compile(r'(from|import) "\./([\w-]+\.js)"')
_PLACE = {"gap": "--gap", "pitch": "--pitch", "flow": "--flow"}


def asset(name: str) -> str:
    """The text of one of the page's own files."""
    return (files("spirillum.pages") / "static" / name).read_text(encoding="utf-8")


def robot_file(swimmer: PageRobot) -> str:
    """Text of a robot file of the current robot."""
    return robot_text(swimmer.predicted(), f"From the page of spirillum {package_version()}.")


def command_line(swimmer: PageRobot) -> str:
    """Commands that give the same steady numbers, and a run like the one that is seen."""
    settings, model = swimmer.command_settings(), _model(swimmer)
    words = [_source(settings), "--model", model]
    for field, value in _overrides(settings).items():
        words += ["--set", f"{field}={value}"]
    placed = _placed(settings, model)
    for name, value in placed.items():
        words += [f"{_PLACE[name]}={value}"]
    steady = shlex.join(["spirillum", "predict", *words])
    end = f"{max(swimmer.moment.time if swimmer.moment else 0.0, 1.0):.3g}s"
    wait = ["--wait", "0s"] if model == "tube" else []
    return f"{steady}\n{shlex.join(['spirillum', 'simulate', *words, *wait, '--duration', end, '-o', 'run.nc'])}\n"


def python_lines(swimmer: PageRobot) -> str:
    """Lines of Python that give the numbers of a robot of the page, by `predict` and `simulate`."""
    settings, model = swimmer.command_settings(), _model(swimmer)
    overrides = ", ".join(f"{field!r}: {value!r}" for field, value in _overrides(settings).items())
    placed = _placed(settings, model)
    where = f", placement={placed!r}" if placed else ""
    load = f"sp.load({_source(settings)!r}" + (f", **{{{overrides}}})" if overrides else ")")
    end = max(swimmer.moment.time if swimmer.moment else 0.0, 1.0)
    wait = ", in_tube={'wait': '0 s'}" if model == "tube" else ""
    return (
        f"import spirillum as sp\n\nrobot = {load}\n"
        f"steady = sp.predict(robot, model={model!r}{where})\n"
        "print(steady.forward_velocity)\n"
        f"run = sp.simulate(robot, model={model!r}{where}, timing={{'duration': '{end:.3g} s'}}{wait})\n"
    )


def _model(swimmer: PageRobot) -> str:
    return swimmer.built.model if swimmer.built else swimmer.settings.model


def _source(settings: Settings) -> str:
    return settings.source if isinstance(settings.source, str) else "robot.toml"


def _overrides(settings: Settings) -> dict[str, str]:
    """Overridden fields of the robot, except those that a robot file of the page contains."""
    return dict(settings.overrides) if isinstance(settings.source, str) else {}


def _placed(settings: Settings, model: str) -> dict[str, str]:
    return dict(settings.run) if model == "tube" else {k: v for k, v in settings.run.items() if k != "flow"}


def replay_page(replay: dict[str, Any]) -> str:
    """One HTML file that shows a run with no server and no network."""
    modules = {}
    for name in MODULES:
        text = _IMPORT.sub(r'\1 "spirillum/\2"', asset(name))
        modules[f"spirillum/{name}"] = "data:text/javascript;base64," + base64.b64encode(text.encode()).decode()
    return rendered(
        "pages/replay.html.jinja",  # whose parts are no text to be escaped: only the title comes from a user
        title=re.sub(r"[<>&\"]", "", str(replay["robot"]))[:100],
        style=asset("page.css"),
        modules=json.dumps({"imports": modules}),
        data=json.dumps({"quantities": quantity_list(), **replay}).replace("<", "\\u003c"),
    )
