"""Downloads of the page: the robot file, commands that give the same numbers, the run as one file."""

from __future__ import annotations

import base64
import json
import re
import shlex
from importlib.resources import files
from typing import Any

from spirillum.formats.templates import rendered
from spirillum.pages.knobs import Settings
from spirillum.pages.page_robot import PageRobot
from spirillum.pages.robot_data import quantity_list
from spirillum.robot.robot import robot_text
from spirillum.version import package_version

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
