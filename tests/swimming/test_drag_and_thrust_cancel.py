"""Axial forces of the fluid on body and tail in steady swimming: they cancel, and each is resistance times motion."""

import numpy as np
import pytest

import spirillum as sp
from spirillum.swimming.steady import axial_forces


@pytest.mark.parametrize("model", ["sbt", "rft", "slender"])
@pytest.mark.parametrize("calibrated", [True, False])
def test_nothing_else_pushes_along_the_axis(model: str, calibrated: bool) -> None:
    found = sp.predict("biorob2012-wide", model=model, calibrated=calibrated)
    body, _, tail, _ = axial_forces(found.batch, found.model, found.swimming, calibrated=found.calibrated)[0]
    assert tail > 0.0  # the tail pushes forwards
    assert body == pytest.approx(-tail, rel=1e-9)


def test_drag_of_a_lone_body_is_its_resistance_times_its_speed() -> None:
    """Resistive force theory has no flow between the parts: what holds the body back depends on its speed alone."""
    found = sp.predict("biorob2012-wide", model="rft", calibrated=False)
    r = sp.resistance("biorob2012-wide", model="rft", part="body").matrix
    drag = axial_forces(found.batch, found.model, found.swimming, calibrated=False)[0, 0]
    assert drag == pytest.approx(-float(np.asarray(r)[0, 0]) * found.forward_velocity, rel=1e-6)


def test_forces_are_linear_in_the_tails_rate() -> None:
    one, two = (sp.predict("biorob2012-wide", model="rft", tail_rate=rate) for rate in ("1 Hz", "2 Hz"))
    forces = [axial_forces(found.batch, found.model, found.swimming)[0] for found in (one, two)]
    assert forces[1][0] == pytest.approx(2.0 * forces[0][0], rel=1e-9)
