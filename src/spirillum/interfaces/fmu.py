"""An FMU as bytes: its description, its C source, and that source compiled for this machine."""

from __future__ import annotations

import hashlib
import io
import math
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spirillum.arrays import Samples
from spirillum.display import fitted_words
from spirillum.dynamics.axial_robot import OUTPUTS, PARAMETERS, AxialRobot
from spirillum.dynamics.integration import first_step, run_sizes, watched_limits
from spirillum.dynamics.plant import Plant
from spirillum.dynamics.tube_robot import TubeRobot
from spirillum.errors import InputError
from spirillum.files import MARK, scratch_folder
from spirillum.formats.templates import rendered
from spirillum.kernels import core
from spirillum.kernels.core import AXIAL_STATE_SIZE as AXIAL_STATES
from spirillum.quantities import QUANTITIES
from spirillum.swimming.prediction import Prediction
from spirillum.version import package_version

_DERIVED: Mapping[str, Mapping[str, int]] = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "C": {"A": 1, "s": 1},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
}


def base_units(unit: str) -> dict[str, int]:
    """Exponents of `kg`, `m`, `s`, `A` and `rad` in a unit of the registry, such as ``m/(s N m)``."""
    found: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below.strip("()"), -1)):
        for symbol in side.split():
            if symbol != "1":
                for base, power in _DERIVED[symbol].items():
                    found[base] += sign * power
    return {base: power for base, power in found.items() if power}


_PLUMBING = ("fmi3.c", "model.h")  # C sources with the functions of FMI, around those of a model
_HEADERS = ("core.h", "drive.h")
_MOTION = (
    "stiff_steps",
    "tube_motion",
    "two_links",
    "links",
    "contacts",
    "dry_friction",
    "slices",
    "table",
    "film",
    "cavitation",
)
_MOTION_HEADERS = (
    "stiff_steps.h",
    "motion.h",
    "contacts.h",
    "slices.h",
    "table.h",
    "links.h",
    "film.h",
    "cavitation.h",
    "lanes.h",
)
_REMOTE, _DUTY, _FLOW, _FIRST_OUTPUT, _FIRST_PARAMETER = 1, 2, 3, 10, 100  # value references, also in the C source


class FmuVariable(NamedTuple):
    """One output or parameter of an FMU."""

    name: str
    meaning: str
    unit: str
    value: float | None = None  #: Start of a parameter; None: an output, whose place is its value reference.


@dataclass(frozen=True)
class FmuModel:
    """What an FMU is made of: a robot, C sources with its equations, and its numbers."""

    prediction: Prediction  #: The robot with model and friction.
    motion: str  #: How it moves, in half a sentence.
    duty: float  #: Duty at first.
    flow: float | None  #: Imposed mean flow at first, m/s; None: it is no input.
    source: str  #: C source of the model, in this folder.
    equations: tuple[str, ...]  #: Files of csrc/ with its equations, and headers.
    outputs: Mapping[int, FmuVariable]  #: By their place in the C source.
    parameters: Mapping[int, FmuVariable]  #: Numbers that an importer can set, by their place in the C source.
    defined: Mapping[str, str]  #: Numbers of the C source by name.
    arrays: Mapping[str, Samples]  #: Arrays of the C source by name.

    @property
    def identifier(self) -> str:
        """The robot's name as C takes it."""
        return re.sub(r"\W", "_", f"robot_{self.prediction.robot.name}", flags=re.ASCII)[:100]


def _output(name: str, label: str = "", unit: str = "") -> FmuVariable:
    item = QUANTITIES[name]
    return FmuVariable(label or name, item.meaning, unit or item.unit)


def axial_model(axial: AxialRobot) -> FmuModel:
    """The FMU of a robot in axial motion."""
    curve = np.zeros(1) if axial.curve is None else axial.curve
    return FmuModel(
        prediction=axial.prediction,
        motion="held to the axis of its channel",
        duty=axial.duty,
        flow=axial.flow,
        source="axial_robot.c",
        equations=("axial.c", "axial.h", "drive.c", *_HEADERS),
        outputs={place: _output(name) for name, place in axial.outputs.items()},
        parameters={
            PARAMETERS.index(item): FmuVariable(item.name, item.meaning, item.unit, value)
            for item, value in axial.parameters.items()
        },
        defined={
            "STATE": str(AXIAL_STATES),
            "OUTPUTS": str(len(OUTPUTS)),
            "PARAMETERS": str(len(PARAMETERS)),
            "VALUES": _list(axial.values),
            "CURVE": _list(curve.tolist()),
        },
        arrays={},
    )


_VECTORS = {"position": ("m", 3), "attitude": ("1", 4)}
_FREE = (
    *("tail_angle", "body_angle", "forward_velocity", "tail_rotation_rate", "body_rotation_rate"),
    *("motor_rotation_rate", "pitch", "yaw", "drive_energy", "offset", "azimuth", "wall_pitch", "wall_yaw", "wall_gap"),
    *("contact_force", "mean_flow"),
)
_ELECTRICAL = ("motor_torque", "motor_current", "battery_voltage", "electrical_power", "battery_charge_used")
"""Outputs of a free robot behind `_VECTORS`, as free_robot.c counts them; the last ones of a DC motor alone."""


def free_model(plant: Plant) -> FmuModel:
    """The FMU of a robot released in its tube."""
    links, reach, first = plant.links, plant.reach, plant.state
    if not isinstance(links, TubeRobot):
        raise InputError(
            f"motion = 'free' of {plant.robot.name} by model '{plant.model}'; allowed: model 'tube', in a channel"
        )
    names = [
        _output(name, f"{name}[{place + 1}]", unit) for name, (unit, size) in _VECTORS.items() for place in range(size)
    ]
    electrical = _ELECTRICAL if plant.steady.batch.drive == "dc-motor" else ()
    names += [_output(name) for name in (*_FREE, *electrical)]
    data, gaps = links.data, links.gap_count + core.WATCHED
    state = core.MEMORY_SIZE + 10 * core.STATE_SIZE + gaps + 4 + data.size
    drive = core.SEEN_SIZE + links.friction.size + links.weight.size
    return FmuModel(
        prediction=plant.steady,
        motion="released in its channel",
        duty=first.duty,
        flow=first.flow,
        source="free_robot.c",
        equations=(*(f"{name}.c" for name in (*_MOTION, "drive")), *_HEADERS, *_MOTION_HEADERS),
        outputs=dict(enumerate(names)),
        parameters={},
        defined={
            "PARAMETERS": "0",
            "STATE": str(state),
            "OUTPUTS": str(len(_FREE) + len(_ELECTRICAL) + sum(size for _, size in _VECTORS.values())),
            "GAPS": str(links.gap_count),
            "DATA_SIZE": str(data.size),
            "TABLE_SIZE": str(links.table.size),
            "DUTY_PLACE": str(drive + core.DRIVE_DUTY),
            "ROUGHNESS": _number(links.roughness),
            "TOLERANCE": _number(links.tolerance),
            "FIRST_STEP": _number(first_step(links)),
        },
        arrays={
            "DATA": data,
            "TABLE": links.table,
            "FIRST": np.array(first.state),
            "SIZES": run_sizes(links),
            "LIMITS": watched_limits(links, reach),
        },
    )


def _number(value: float) -> str:
    """A number as C takes it."""
    return repr(float(value)) if math.isfinite(value) else f"({'-' if value < 0 else ''}INFINITY)"


def _list(values: Iterable[float]) -> str:
    """Numbers as C takes them for an array."""
    return f"{{{', '.join(map(_number, values))}}}"


def _sources(model: FmuModel) -> dict[str, bytes]:
    """The C sources by name, those of csrc/ among them."""
    here = files(__package__)
    packaged = here.joinpath("csrc")
    csrc = packaged if packaged.is_dir() else Path(__file__).parents[3] / "csrc"
    found = {name: here.joinpath(name).read_bytes() for name in (model.source, *_PLUMBING)}
    found |= {name: csrc.joinpath(name).read_bytes() for name in model.equations}
    if model.arrays:
        lines = (f"const double {name}[] = {_list(values.tolist())};" for name, values in model.arrays.items())
        found["robot_numbers.c"] = "\n".join(["#include <math.h>", *lines, ""]).encode()
    return found


def _header(model: FmuModel, token: str) -> str:
    defined = {
        "TOKEN": f'"{token}"',
        "FLOW_INPUT": str(int(model.flow is not None)),
        "START_DUTY": _number(model.duty),
        "START_FLOW": _number(model.flow or 0.0),
        **model.defined,
    }
    return "".join(f"#define {name} {value}\n" for name, value in defined.items())


def description_text(model: FmuModel, token: str) -> str:
    """`modelDescription.xml` of FMI 3.0."""
    prediction, variables = model.prediction, list(_variables(model))
    return rendered(
        "interfaces/modelDescription.xml.jinja",
        robot=prediction.robot,
        identifier=model.identifier,
        token=token,
        description=(
            f"{prediction.robot.name}, {model.motion}: model {prediction.model.name}, friction "
            f"{prediction.friction}, {fitted_words(prediction.calibrated, prediction.fitted_by)}"
        ),
        tool=f"spirillum {package_version()}",
        units={item.unit: base_units(item.unit) for *_, item in variables if item.unit},
        variables=variables,
    )


def _variables(model: FmuModel) -> Iterator[tuple[int, str, str, FmuVariable]]:
    """Value reference, causality and variability of all variables; the remote is no number."""
    duty, flow = QUANTITIES["duty"], QUANTITIES["mean_flow"]
    yield 0, "independent", "continuous", FmuVariable("time", "time", "s")
    yield _REMOTE, "remote", "discrete", FmuVariable("remote", "the drive is on", "")
    yield _DUTY, "input", "continuous", FmuVariable("duty", f"{duty.meaning}, 0 to 1", "1", model.duty)
    if model.flow is not None:
        yield _FLOW, "input", "continuous", FmuVariable(flow.name, flow.meaning, flow.unit, model.flow)
    for place, item in model.outputs.items():
        if not (item.name == flow.name and model.flow is not None):
            yield _FIRST_OUTPUT + place, "output", "continuous", item
    for place, item in model.parameters.items():
        yield _FIRST_PARAMETER + place, "parameter", "fixed", item


_COMPILERS = ("cc", "gcc", "clang")
_INSIDE = "SPIRILLUM_INSIDE"
_OPTIONS = ("-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off", f"-D{_INSIDE}")
_LONGEST = 120.0  # time after which a compiler is given up, s
_LIBRARIES = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
_NEVER = (1980, 1, 1, 0, 0, 0)  # date of the files in the archive, so that the same robot gives the same bytes


def compiler() -> str:
    """The C compiler of the system."""
    for name in _COMPILERS:
        found = shutil.which(name)
        if found is not None:
            return found
    raise InputError(
        f"no C compiler is installed, which an .fmu is built with; allowed: {', '.join(_COMPILERS)} on the path"
    )


def fmu_bytes(model: FmuModel) -> bytes:
    """The FMU of a robot: a zip archive with description, source and library."""
    written, name = _sources(model), model.identifier
    said = repr((model.prediction.robot.name, dict(model.defined), model.flow, model.duty)).encode()
    token = "{" + hashlib.sha256(said + b"".join(written.values())).hexdigest()[:32] + "}"
    written["robot.h"] = _header(model, token).encode()
    system, ending = _LIBRARIES.get(sys.platform, ("linux", ".so"))
    machine = platform.machine().lower()
    contents = {
        "modelDescription.xml": description_text(model, token).encode(),
        "sources/buildDescription.xml": rendered(
            "interfaces/buildDescription.xml.jinja",
            identifier=name,
            names=[file for file in written if file.endswith(".c")],
            inside=_INSIDE,
        ).encode(),
        **{f"sources/{file}": text for file, text in written.items()},
        f"binaries/{_PROCESSORS.get(machine, machine)}-{system}/{name}{ending}": _compiled(written),
    }
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as target:
        target.comment = MARK.encode()
        for path, data in contents.items():
            entry = zipfile.ZipInfo(path, _NEVER)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            target.writestr(entry, data)
    return archive.getvalue()


def _compiled(written: Mapping[str, bytes]) -> bytes:
    with scratch_folder() as here:
        for name, text in written.items():
            (here / name).write_bytes(text)
        units = [name for name in written if name.endswith(".c")]
        command = [compiler(), *_OPTIONS, "-o", "robot.library", *units, "-lm"]
        try:
            done = subprocess.run(  # noqa: S603 - a compiler of the system and a source of our own
                command, cwd=here, capture_output=True, text=True, timeout=_LONGEST, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise InputError(
                f"{command[0]} does not build the .fmu ({error}); allowed: a C compiler for C11"
            ) from error
        if done.returncode != 0:
            said = next((line for line in done.stderr.splitlines() if "error" in line), done.stderr)[:200]
            raise InputError(f"{command[0]} does not build the .fmu ({said}); allowed: a C compiler for C11")
        return (here / "robot.library").read_bytes()
