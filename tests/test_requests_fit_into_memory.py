"""Requests whose cost follows from an input: the memory that is taken before they are refused, as Python counts it."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli.app import command_line
from spirillum.errors import MOST_MEMORY, check_memory
from spirillum.robot.batch import RobotBatch
from spirillum.robot.mesh import robot_mesh
from spirillum.robot.surface import corner_normals

WIDE, THIN, FINE = "biorob2012-wide", {"tail.wire_diameter": "1 nm"}, {"tail.wavelength": "62 um", "tail.taper": "none"}
COIL = {**FINE, "tail.wire_diameter": "10 um", "tail.amplitude": "3 mm"}
VAST = {"channel.diameter": "90 m"}
LITTLE = 64 << 20
"""Memory in which a request can be refused, bytes; modules that are loaded on the way are among it."""


def robot(fields: dict[str, str]) -> sp.Robot:
    return sp.load(WIDE, **fields)


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "predict": (lambda: sp.predict(robot(THIN)), "stations along the tail"),
    "tube": (lambda: sp.predict(robot(THIN), model="tube"), "stations along the tail"),
    "slender": (lambda: sp.predict(robot(THIN), model="slender"), "stations along the tail"),
    "placed": (lambda: sp.predict(robot(THIN), placement={"gap": "0.3 mm", "yaw": "1 deg"}), "stations along the tail"),
    "simulate": (lambda: sp.simulate(robot(THIN)), "stations along the tail"),
    "plant": (lambda: sp.Plant(robot(THIN)), "stations along the tail"),
    "held": (lambda: sp.AxialBatch(robot(THIN)), "stations along the tail"),
    "flow": (lambda: sp.flow(robot(THIN)), "stations along the tail"),
    "settle": (lambda: sp.settle(robot(THIN)), "stations along the tail"),
    "prepare": (lambda: sp.prepare(robot(THIN)), "stations along the tail"),
    "control": (lambda: sp.control(robot(THIN), {"kind": "stop-at", "at": "10 mm"}), "stations along the tail"),
    "design": (
        lambda: sp.design(robot(THIN), {"tail.wavelength": ("20 mm", "30 mm")}, maximise="forward_velocity"),
        "stations along the tail",
    ),
    "sweep": (lambda: sp.magnetic_sweep(sp.load("magnetic-helix", **THIN)), "stations along the tail"),
    "slow field": (lambda: sp.magnetic_sweep("magnetic-helix", ["1e-9 Hz"], model="rft"), "turns near step-out"),
    "table in a vast tube": (lambda: sp.prepare(robot(VAST)), "GiB of equations"),
    "mesh": (lambda: robot_mesh(robot(COIL), fineness=5.0), "turns .fineness = 5. makes .* triangles"),
    "view as a column": (
        lambda: RobotBatch.of(robot({})).with_values({"tail.wavelength": np.broadcast_to(0.02, (10**12,))}),
        "tail.wavelength makes .* numbers",
    ),
    "view as rows": (lambda: RobotBatch.of(robot({})).taken(np.broadcast_to(0, (10**12,))), "rows makes .* numbers"),
    "long run": (
        lambda: sp.control(
            WIDE,
            {"kind": "stop-at", "at": "10 mm", "duration": "86400 s"},
            plant={"model": "rft"},
            lab={"camera": {"fps": 1000}},
        ),
        "makes .* events; allowed: at most",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_is_refused_before_it_is_allocated(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    request, sentence = REFUSED[name]
    tracemalloc.start()
    try:
        with pytest.raises(sp.InputError, match=sentence):
            request()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < LITTLE


def test_a_model_that_needs_no_stations_answers_for_the_thinnest_wire() -> None:
    assert sp.predict(robot(THIN), model="rft", tail_rate="1 Hz").forward_velocity > 0.0


@pytest.mark.parametrize("count", [1.0001, np.inf, np.nan])
def test_one_rule_refuses_what_is_too_much(count: float) -> None:
    check_memory("a request", 1.0, "parts", MOST_MEMORY, "fewer")
    with pytest.raises(sp.InputError, match=r"a request makes .* parts; allowed: at most 1, fewer"):
        check_memory("a request", count, "parts", MOST_MEMORY, "fewer")


@pytest.mark.parametrize(("work", "stated"), [("mesh", 400.0), ("shading", 2100.0)])
def test_estimated_memory_of_a_triangle_is_enough_and_not_far_more(work: str, stated: float) -> None:
    """What the arrays take at their peak, as Python counts it, per triangle of a mesh of a hundred thousand."""
    pieces = robot_mesh(sp.load(WIDE), fineness=3.0)
    tail = next(piece for piece in pieces if piece.name == "tail")
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        if work == "mesh":
            number = sum(len(piece.faces) for piece in robot_mesh(sp.load(WIDE), fineness=3.0))
        else:
            number = len(tail.faces)
            corner_normals(tail.vertices, tail.faces, 0.7)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert stated / 6.0 < (peak - before) / number < stated


def test_command_line_says_a_want_of_memory_in_a_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where no estimate foresaw it."""
    from spirillum import cli
    from spirillum.dynamics import prediction

    def starved(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(prediction, "choose_model", starved)
    command_line()
    with pytest.raises(SystemExit) as left:
        cli.main(["predict", WIDE])
    assert left.value.code == 2
    assert capsys.readouterr().err == "spirillum: the request does not fit into memory; allowed: a smaller one\n"
