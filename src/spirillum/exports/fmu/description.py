"""What the FMU says of itself: `modelDescription.xml`, and the header with the robot's numbers for its C source."""

from __future__ import annotations

import hashlib
import re
from typing import NamedTuple
from xml.etree import ElementTree as ET

from spirillum.dynamics.held_equations import OUTPUTS
from spirillum.dynamics.held_model import PARAMETERS, HeldModel
from spirillum.exports.fmu.units import base_units
from spirillum.quantities import QUANTITIES
from spirillum.shown import fitted_words
from spirillum.version import own_version

__all__ = ["SOURCE", "build_text", "description_text", "header_text", "identifier_of", "token_of"]

SOURCE = "held_robot.c"
"""Name of the C source."""
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


def identifier_of(held: HeldModel) -> str:
    """The robot's name as C takes it."""
    return re.sub(r"\W", "_", f"robot_{held.robot.name}", flags=re.ASCII)[:100]


def token_of(held: HeldModel, source: bytes) -> str:
    """What an importer has to know to instantiate the FMU: a checksum of its numbers and its source."""
    said = repr((held.robot.name, held.values, held.flow, held.duty)).encode()
    return "{" + hashlib.sha256(said + source).hexdigest()[:32] + "}"


def header_text(held: HeldModel, token: str) -> str:
    """The robot for the C source: `robot.h`."""
    values = ",\n".join(
        f"    {value!r} /* {item.name}, {item.unit} */" for item, value in zip(PARAMETERS, held.values, strict=True)
    )
    lines = "{ \\\n" + values.replace("\n", " \\\n") + " \\\n}"
    return (
        f'#define TOKEN "{token}"\n#define FLOW_INPUT {int(held.flow is not None)}\n'
        f"#define START_DUTY {held.duty!r}\n#define START_FLOW {held.flow or 0.0!r}\n#define VALUES {lines}\n"
    )


def build_text(identifier: str) -> str:
    """How the source is compiled: `sources/buildDescription.xml`."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = ET.SubElement(configuration, "SourceFileSet", language="C99")
    ET.SubElement(files, "SourceFile", name=SOURCE)
    return _text(root)


def description_text(held: HeldModel, token: str) -> str:
    """`modelDescription.xml` of FMI 3.0."""
    prediction, variables = held.prediction, _variables(held)
    root = ET.Element(
        "fmiModelDescription",
        fmiVersion="3.0",
        modelName=held.robot.name,
        instantiationToken=token,
        description=(
            f"{held.robot.name}, held to the axis of its channel: model {prediction.model.name}, friction "
            f"{prediction.friction}, {fitted_words(prediction.calibrated, prediction.fitted_by)}"
        ),
        generationTool=f"spirillum {own_version()}",
        variableNamingConvention="structured",
    )
    ET.SubElement(
        root,
        "CoSimulation",
        modelIdentifier=identifier_of(held),
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


def _variables(held: HeldModel) -> list[_Variable]:
    duty = QUANTITIES["duty"]
    found = [
        _Variable("Float64", "time", 0, "independent", "continuous", "time", "s"),
        _Variable("Boolean", "remote", _REMOTE, "input", "discrete", "remote: the drive is on", start="true"),
        _Variable(
            "Float64", "duty", _DUTY, "input", "continuous", f"{duty.meaning}, 0 to 1", "1", start=repr(held.duty)
        ),
    ]
    if held.flow is not None:
        flow = QUANTITIES["mean_flow"]
        found.append(
            _Variable("Float64", flow.name, _FLOW, "input", "continuous", flow.meaning, flow.unit, repr(held.flow))
        )
    for place, name in enumerate(OUTPUTS):
        item = QUANTITIES[name]
        found.append(_Variable("Float64", name, _FIRST_OUTPUT + place, "output", "continuous", item.meaning, item.unit))
    for place, (parameter, value) in enumerate(zip(PARAMETERS, held.values, strict=True)):
        reference = _FIRST_PARAMETER + place
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
