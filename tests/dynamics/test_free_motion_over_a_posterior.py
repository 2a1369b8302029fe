"""Intervals of free motion in the tube: over the steady motions that each draw comes to by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import spirillum as sp
from spirillum.dynamics.fitted_runs import intervals_of_free_motion
from spirillum.dynamics.free_motion import free_motion
from spirillum.fitted.fit import fit_of_posterior
from spirillum.fitted.posterior_file import PosteriorFile

pytestmark = pytest.mark.slow

WIDE, ROUGH = "biorob2012-wide", "100 um"  # it comes to rest soon
FRICTIONS, COEFFICIENTS = (1.0e-5, 1.1e-5, 1.3e-5), (0.08, 0.1, 0.14)


def posterior() -> PosteriorFile:
    """Three draws, made up, without a discrepancy."""
    draws = {"shared_friction": np.array([FRICTIONS]).T, "friction_coefficient": np.array([COEFFICIENTS]).T}
    return PosteriorFile(
        source="made up",
        sha256="",
        model="tube",
        observations="none",
        synthetic=True,
        channels=(0.04,),
        body=(0.018, 0.035),
        draws=draws,
        middle={name: np.median(values, axis=0) for name, values in draws.items()},
        discrepancy={},
        error={},
        friction=(),
        friction_reading="",
    )


def test_limits_are_those_of_the_draws_followed_by_themselves() -> None:
    """Laid down and followed alone, each draw comes to the same steady motion: to 0.1 %."""
    known = posterior()
    found = free_motion(sp.load(WIDE), fit=fit_of_posterior(known), roughness=ROUGH)
    limits = intervals_of_free_motion(found, known, posterior_for="new")
    alone = [
        sp.predict(
            sp.load(WIDE, **{"friction.effective": f"{friction} N m s/rad"}),
            model="tube",
            motion="free",
            roughness=ROUGH,
            in_tube={"friction_coefficient": coefficient},
        )
        for friction, coefficient in zip(FRICTIONS, COEFFICIENTS, strict=True)
    ]
    for name in ("forward_velocity", "body_rotation_rate", "tail_rotation_rate", "motor_current", "dissipated_power"):
        low, high = np.quantile([getattr(one, name) for one in alone], [0.025, 0.975])
        assert limits.low[name] == pytest.approx(low, rel=1e-3), name
        assert limits.high[name] == pytest.approx(high, rel=1e-3), name
    assert found.prediction.forward_velocity == pytest.approx(alone[1].forward_velocity, rel=1e-9)


def test_a_middle_without_a_steady_motion_has_no_intervals() -> None:
    known = posterior()
    found = free_motion(sp.load(WIDE), fit=fit_of_posterior(known), roughness=ROUGH)
    orbiting = found._replace(run=found.run._replace(lying=replace(found.run.lying, state="orbits")))
    with pytest.raises(sp.InputError, match="its median reaches no steady motion"):
        intervals_of_free_motion(orbiting, known, posterior_for="new")
