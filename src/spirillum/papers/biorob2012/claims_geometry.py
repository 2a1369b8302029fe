"""Statements of the paper that follow from the robot, the camera and the method alone."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from spirillum.fluid.closed.thin_wire import EXACT_EPS_CONSTANT, PRINTED_EPS_CONSTANT
from spirillum.papers.biorob2012.constants import FRAME_RATE, NARROWER, ROBOT_LENGTH
from spirillum.papers.biorob2012.evidence import NO_RATES, Evidence
from spirillum.papers.claim import Claim, Verdict
from spirillum.robot.load import load
from spirillum.units import Hz


def calibration_factors(evidence: Evidence) -> Iterator[Claim]:
    """Table III."""
    yield Claim(
        "Body drag factors that stand for the walls (Table III)",
        "1.95 D_x wide, 3.6 D_x narrow; 0.6 E_x (SBT), 1 E_x (RFT)",
        "used as given, as named calibrations of the preset robots",
        "undecidable",
        "they come from inverting (15) with the paper's observations, which are lost"
        + ("; inverting it with others is not part of this version" if evidence.observed else ""),
    )


def robot_and_channel(evidence: Evidence) -> Iterator[Claim]:
    """Lengths, weight, channels."""
    robot, narrow = evidence.robot, load("biorob2012-narrow")
    derived = robot.derived()
    length = derived["robot_length"].value
    yield Claim(
        "The prototype is more than 10 centimetres long",
        f"> {1e3 * ROBOT_LENGTH:.0f} mm",
        f"{1e3 * length:.0f} mm (body, coupling and tail)",
        _verdict(length > ROBOT_LENGTH),
        "sum of Table I's lengths",
    )
    weight = derived["submerged_weight"].value
    yield Claim(
        "The robot's weight is bigger than the buoyancy acting on it",
        "weight > buoyancy",
        f"submerged weight {1e3 * weight:.1f} mN",
        _verdict(weight > 0),
        "Table I's mass and volumes, copper wire; the clearance of the coupling is assumed",
    )
    if robot.channel is not None and narrow.channel is not None:
        reduction = 1.0 - narrow.channel.diameter / robot.channel.diameter
        yield Claim(
            "The narrow channel's radius is 25 % smaller",
            f"{100 * NARROWER:.0f} %",
            f"{100 * reduction:.0f} %",
            _verdict(bool(np.isclose(reduction, NARROWER))),
            "Table I",
        )
    if robot.motor is not None:
        friction = robot.motor.rotor_friction
        yield Claim(
            "Pure rotor friction is of the order of 1e-7 N m s/rad",
            "order 1e-7 (text), 7e-7 (Table II)",
            f"{friction:.0e} N m s/rad, Table II's value",
            "undecidable",
            "a measurement of the paper; 7e-7 lies nearer to 1e-6 than to 1e-7",
        )


def method(evidence: Evidence) -> Iterator[Claim]:
    """Camera, numerical method."""
    fastest = max(
        float(np.nanmax(np.abs(evidence.free("tail_rotation_rate", model)))) / Hz for model in evidence.models
    )
    yield Claim(
        "The camera's sampling rate resolves the rotation (Nyquist)",
        f"{FRAME_RATE:.0f} frames/s",
        f"fastest tail at the friction-free bound {fastest:.1f} Hz; Nyquist limit {0.5 * FRAME_RATE:.0f} Hz",
        _verdict(fastest < 0.5 * FRAME_RATE),
        "an upper bound of the tail's rate lies below half the frame rate",
    )
    difference = PRINTED_EPS_CONSTANT / EXACT_EPS_CONSTANT - 1.0
    yield Claim(
        "Constant of eps in the slender-body theory",
        f"{PRINTED_EPS_CONSTANT:g}",
        f"pi sqrt(e)/2 = {EXACT_EPS_CONSTANT:.5f}, {100 * difference:.1f} % less",
        _verdict(abs(difference) < 0.01),
        "rounded from Lighthill's cut-off; the printed value is the default, the exact one an option",
    )
    yield Claim(
        "One simulation of the time-dependent model takes two to three seconds",
        "2 to 3 s",
        "not timed here; the benchmarks give ratios within one run",
        "undecidable",
        "it depends on the machine",
    )
    yield Claim(
        "Averages of five measurements with 95 % confidence intervals",
        "n = 5",
        "Student t over the trials of the observations file" if evidence.observed else "no observations given",
        "undecidable",
        "a procedure, not a result" if evidence.observed else NO_RATES,
    )


def _verdict(holds: bool) -> Verdict:  # noqa: FBT001 - a truth value is what it turns into words
    return "agrees" if holds else "disagrees"
