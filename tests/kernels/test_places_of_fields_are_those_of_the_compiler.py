"""Python's constants, which are read from the headers, are what the compiler makes of these."""

import re
import runpy
import subprocess
from pathlib import Path

BUILD = runpy.run_path(str(Path(__file__).parents[2] / "csrc" / "build.py"))
HEADERS = ("motion.h", "axial.h", "stiff_steps.h")
STRUCTS = BUILD["_structs"]("".join(path.read_text() for path in BUILD["SOURCES"].glob("*.h")))


def path_of(struct: str, field: str) -> str:
    """A field as C names it, within the motor or the curve of a struct where it has them."""
    if re.search(rf"\b{field}\b", STRUCTS[struct]):
        return field
    if re.search(rf"\b{field}\b", STRUCTS["Motor"]):
        return f"motor.{field}"
    return f"curve.at[0].{field}" if field in {"rate", "torque"} else f"curve.{field}"


def test_places_of_fields_are_those_of_the_compiler(tmp_path: Path) -> None:
    constants = BUILD["_constants"](STRUCTS)
    assert constants["STATE_PHASE"] == 7
    lines = ["#include <stddef.h>", *(f'#include "{name}"' for name in HEADERS)]
    checked = 0
    for struct in BUILD["_COLUMNS"]:
        places = dict(constants)
        size = BUILD["_add_places"](places, "", STRUCTS, STRUCTS[struct], 0)
        own = {name[1:].lower(): place for name, place in places.items() if name.startswith("_")}
        offsets = [(f"offsetof({struct}, {path_of(struct, field)})", place) for field, place in own.items()]
        for found, place in [(f"sizeof({struct})", size), *offsets]:
            lines.append(f'_Static_assert({found} == {place} * sizeof(double), "");')
            checked += 1
    assert checked > 150
    source = tmp_path / "places.c"
    source.write_text("\n".join(lines))
    command = [*BUILD["compiler"]().command, "-std=c11", "-fsyntax-only", "-I", str(BUILD["SOURCES"]), str(source)]
    said = subprocess.run(command, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stderr
