"""What the paper states of its robot stands beside what is predicted of it, and beside nothing else."""

from typing import Any

import pytest

import spirillum as sp
from spirillum.papers.biorob2012.published import other_tube, published_values

WIDE, NARROW = "biorob2012-wide", "biorob2012-narrow"


def test_the_papers_largest_decrease_stands_beside_ours_in_both_channels() -> None:
    wide, narrow = sp.predict(WIDE), sp.predict(NARROW)
    (from_wide,), (from_narrow,) = (published_values(one, other_tube(one)) for one in (wide, narrow))
    assert from_wide["published"] == from_narrow["published"] == {"value": pytest.approx(0.648e-3), "unit": "m/s"}
    held = wide.forward_velocity - narrow.forward_velocity
    trial = wide.trial.values["forward_velocity"] - narrow.trial.values["forward_velocity"]
    for found in (from_wide, from_narrow):
        assert found["ours"]["held"]["value"] == pytest.approx(held, rel=1e-9)
        assert found["ours"]["trial"]["value"] == pytest.approx(trial, rel=1e-9)


@pytest.mark.parametrize(
    ("overrides", "options"),
    [
        ({}, {"motion": "held"}),
        ({}, {"tail_rate": "1.2 Hz"}),
        ({}, {"placement": {"gap": "1 mm"}}),
        ({}, {"friction": "none"}),
        ({"tail.wavelength": "20 mm"}, {}),
        ({"fluid.viscosity": "2 Pa s"}, {}),
    ],
)
def test_other_requests_have_no_published_number(overrides: dict[str, Any], options: dict[str, Any]) -> None:
    found = sp.predict(sp.load(WIDE, **overrides), **options)
    assert published_values(found, other_tube(found)) == []
