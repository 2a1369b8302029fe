"""An FMU as bytes: its description, its C source, and that source compiled for this machine."""

from __future__ import annotations

import hashlib
import io
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from collections import Counter
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from spirillum.display import fitted_words
from spirillum.dynamics.axial_robot import PARAMETERS, AxialRobot
from spirillum.errors import InputError
from spirillum.files import MARK, scratch_folder
from spirillum.quantities import QUANTITIES
from spirillum.version import own_version

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
    """Exponents of `kg`, `m`, `s`, `A` and `rad` in a unit of the registry, such as ``m/(s N m)``.

    Raises:
        KeyError: for a symbol that is in none of the FMU's units.
    """
    found: Counter[str] = Counter()
    above, _, below = unit.partition("/")
    for side, sign in ((above, 1), (below.strip("()"), -1)):
        for symbol in side.split():
            if symbol != "1":
                for base, power in _DERIVED[symbol].items():
                    found[base] += sign * power
    return {base: power for base, power in found.items() if power}


SOURCE = "axial_robot.c"
"""Name of the C source with the functions of FMI."""
_EQUATIONS = ("axial.c", "drive.c", "core.h", "drive.h")
"""Files of csrc/ with its equations."""
_REMOTE, _DUTY, _FLOW, _FIRST_OUTPUT, _FIRST_PARAMETER = 1, 2, 3, 10, 100
"""Value references, which the C source knows too."""


class _Variable(NamedTuple):
    """One variable of the model."""

    kind: str
    name: str
    reference: int
    causality: str
    variability: str
    meaning: str
    unit: str = ""
    start: str = ""


def identifier_of(axial: AxialRobot) -> str:
    """The robot's name as C takes it."""
    return re.sub(r"\W", "_", f"robot_{axial.robot.name}", flags=re.ASCII)[:100]


def sources() -> dict[str, bytes]:
    """The C sources by name, those of csrc/ among them."""
    packaged = files(__package__).joinpath("csrc")
    csrc = packaged if packaged.is_dir() else Path(__file__).parents[3] / "csrc"
    own = {SOURCE: files(__package__).joinpath(SOURCE).read_bytes()}
    return own | {name: csrc.joinpath(name).read_bytes() for name in _EQUATIONS}


def token_of(axial: AxialRobot, written: Mapping[str, bytes]) -> str:
    """Token with which an importer instantiates the FMU: a checksum of its numbers and its sources."""
    said = repr((axial.robot.name, axial.values, axial.prediction.batch.curve, axial.flow, axial.duty)).encode()
    return "{" + hashlib.sha256(said + b"".join(written.values())).hexdigest()[:32] + "}"


def header_text(axial: AxialRobot, token: str) -> str:
    """The robot for the C source: `robot.h`."""
    values = ",\n".join(
        f"    {value!r} /* {item.name}, {item.unit} */" for item, value in zip(PARAMETERS, axial.values, strict=True)
    )
    curve = np.zeros(1) if axial.curve is None else axial.curve
    lines = "{ \\\n" + values.replace("\n", " \\\n") + " \\\n}"
    return (
        f'#define TOKEN "{token}"\n#define FLOW_INPUT {int(axial.flow is not None)}\n'
        f"#define START_DUTY {axial.duty!r}\n#define START_FLOW {axial.flow or 0.0!r}\n"
        f"#define CURVE {{ {', '.join(map(repr, curve.tolist()))} }}\n#define VALUES {lines}\n"
    )


def build_text(identifier: str) -> str:
    """How the source is compiled: `sources/buildDescription.xml`."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    compiled = ET.SubElement(configuration, "SourceFileSet", language="C11")
    for name in (SOURCE, *_EQUATIONS):
        if name.endswith(".c"):
            ET.SubElement(compiled, "SourceFile", name=name)
    return _text(root)


def description_text(axial: AxialRobot, token: str) -> str:
    """`modelDescription.xml` of FMI 3.0."""
    prediction, variables = axial.prediction, _variables(axial)
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=axial.robot.name,
        instantiationToken=token,
        description=(
            f"{axial.robot.name}, held to the axis of its channel: model {prediction.model.name}, friction "
            f"{prediction.friction}, {fitted_words(prediction.calibrated, prediction.fitted_by)}"
        ),
        generationTool=f"spirillum {own_version()}",
        variableNamingConvention="structured",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier_of(axial),
        canHandleVariableCommunicationStepSize="true",
        canGetAndSetFMUState="true",
        canSerializeFMUState="true",
    )
    units = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(item.unit for item in variables if item.unit):
        exponents = {base: str(power) for base, power in base_units(unit).items()}
        ET.SubElement(ET.SubElement(units, "Unit", name=unit), "BaseUnit", exponents)
    ET.SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="1.0", stepSize="0.01")
    found = ET.SubElement(root, "ModelVariables")
    for item in variables:
        attributes = {
            "name": item.name,
            "valueReference": str(item.reference),
            "causality": item.causality,
            "variability": item.variability,
            "description": item.meaning,
        }
        attributes |= {"unit": item.unit} if item.unit else {}
        ET.SubElement(found, item.kind, attributes | ({"start": item.start} if item.start else {}))
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for item in variables:
            if item.causality == "output":
                ET.SubElement(structure, kind, valueReference=str(item.reference))
    return _text(root)


def _variables(axial: AxialRobot) -> list[_Variable]:
    duty = QUANTITIES["duty"]
    found = [
        _Variable("Float64", "time", 0, "independent", "continuous", "time", "s"),
        _Variable("Boolean", "remote", _REMOTE, "input", "discrete", "remote: the drive is on", start="true"),
        _Variable(
            "Float64", "duty", _DUTY, "input", "continuous", f"{duty.meaning}, 0 to 1", "1", start=repr(axial.duty)
        ),
    ]
    if axial.flow is not None:
        flow = QUANTITIES["mean_flow"]
        found.append(
            _Variable("Float64", flow.name, _FLOW, "input", "continuous", flow.meaning, flow.unit, repr(axial.flow))
        )
    for name, place in axial.outputs.items():
        item = QUANTITIES[name]
        found.append(_Variable("Float64", name, _FIRST_OUTPUT + place, "output", "continuous", item.meaning, item.unit))
    for parameter, value in axial.parameters.items():
        reference = _FIRST_PARAMETER + PARAMETERS.index(parameter)
        found.append(
            _Variable(
                "Float64",
                parameter.name,
                reference,
                "parameter",
                "fixed",
                parameter.meaning,
                parameter.unit,
                repr(value),
            )
        )
    return found


def _text(root: ET.Element) -> str:
    ET.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


_COMPILERS = ("cc", "gcc", "clang")
_OPTIONS = ("-std=c11", "-O2", "-shared", "-fPIC", "-fvisibility=hidden")
_LONGEST = 120.0
"""Time after which a compiler is given up, s."""
_LIBRARIES = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "arm64": "aarch64", "aarch64": "aarch64"}
_NEVER = (1980, 1, 1, 0, 0, 0)
"""Date of the files in the archive, so that the same robot gives the same bytes."""


def compiler() -> str:
    """The C compiler of the system."""
    for name in _COMPILERS:
        found = shutil.which(name)
        if found is not None:
            return found
    raise InputError(
        f"no C compiler is installed, which an .fmu is built with; allowed: {', '.join(_COMPILERS)} on the path"
    )


def fmu_bytes(axial: AxialRobot) -> bytes:
    """The FMU of a robot: a zip archive with description, source and library."""
    written, name = sources(), identifier_of(axial)
    token = token_of(axial, written)
    written["robot.h"] = header_text(axial, token).encode()
    system, ending = _LIBRARIES.get(sys.platform, ("linux", ".so"))
    machine = platform.machine().lower()
    contents = {
        "modelDescription.xml": description_text(axial, token).encode(),
        "sources/buildDescription.xml": build_text(name).encode(),
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
