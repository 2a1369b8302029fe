"""The band over what a placement leaves open: its places follow from geometry, its limits from the places."""

import json
import re
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli import main
from spirillum.envelope import quantity
from spirillum.fluid.tube.domain import WIRE_FILM
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.placement import Placement
from spirillum.robot.tube_pose import TubePose
from spirillum.swimming.band import TOLERANCE, at_pose, band_poses, left_open
from spirillum.swimming.motions import Swimming

WIDE = "biorob2012-wide"
RADIUS = 20e-3


def places(model: Any, placement: dict[str, Any] | None = None, **fields: Any) -> list[Placement]:
    robot = sp.load(WIDE, **{name.replace("__", "."): value for name, value in fields.items()})
    return band_poses(RobotBatch.of(robot, Placement.of(placement)), model)


@pytest.fixture
def leaning(walled: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Walls whose drag rises as the gap falls, and falls with the pitch: the limits of the band are known places."""
    made_up = type(walled).axial

    def axial(self: Any, batch: Any) -> np.ndarray:
        place = batch.placement
        drag = np.zeros((4, 4))
        drag[0, 0] = 1e-3 / (place.gap or 0.5e-3) - 3.0 * (place.pitch or 0.0)
        return made_up(self, batch) + drag

    def placement_of(_self: Any, batch: Any) -> dict[str, Any]:
        place = batch.placement
        there = {"gap": quantity(place.gap or 0.5e-3, "m"), "pitch": quantity(place.pitch or 0.0, "rad")}
        return {"kind": "in the channel", **there}

    monkeypatch.setattr(type(walled), "axial", axial)
    monkeypatch.setattr(type(walled), "placement_of", placement_of)
    return walled


def test_places_go_over_a_tenth_of_a_millimetre_to_one_and_from_level_to_contact(walled: Any) -> None:
    found = places(walled)
    assert [place.gap for place in found[::3]] == pytest.approx([1e-3, 1e-3 / 10**0.5, 1e-4])
    pitches = np.array([place.pitch for place in found]).reshape(3, 3)
    np.testing.assert_array_equal(pitches[:, 0], 0.0)
    np.testing.assert_allclose(pitches[:, 1], 0.5 * pitches[:, 2])
    assert np.all(np.diff(pitches[:, 2]) < 0)  # a higher body leaves the tail more room


def test_steepest_place_keeps_the_film_that_is_resolved(walled: Any) -> None:
    g = RobotGeometry.of(RobotBatch.of(sp.load(WIDE)))
    wire = g.wire()
    for place in places(walled)[2::3]:
        pose = TubePose.at_gap(g.body, RADIUS, place.gap or 0.0, place.pitch or 0.0)
        assert pose.clearance(g.body) == pytest.approx(place.gap)
        clear = pose.tail_clearance(wire.points, wire.radius).clearance
        assert WIRE_FILM * wire.radius <= clear < (WIRE_FILM + 0.2) * wire.radius


def test_tails_of_one_reach_share_their_places(walled: Any) -> None:
    assert places(walled) == places(walled, tail__wavelength="10 mm") == places(walled, tail__handedness="left")
    assert places(walled)[2] != places(walled, tail__amplitude="3.5 mm")[2]


def test_what_is_given_is_kept(walled: Any) -> None:
    level = places(walled, {"pitch": "0 deg", "ends": "closed"})
    assert [place.pitch for place in level] == [0.0] * 3
    assert {place.ends for place in level} == {"closed"}
    low = places(walled, {"gap": "0.2 mm", "tail_drop": "1 mm"})
    assert [place.gap for place in low] == [2e-4] * 3
    assert low[2].pitch < places(walled, {"gap": "0.2 mm"})[2].pitch
    assert places(walled, {"gap": "0.2 mm", "pitch": "1 deg"}) == []
    assert places(walled, {"eccentricity": 0.5}) == []
    assert left_open(Placement(), sp.predict(WIDE, model="sbt").model) == ()


def test_gaps_are_capped_by_the_channel(walled: Any) -> None:
    tight = places(walled, channel__diameter="18.6 mm")
    assert [place.gap for place in tight[::3]] == pytest.approx([3e-4, (3e-4 * 1e-4) ** 0.5, 1e-4])


def test_limits_are_those_of_the_places(leaning: Any) -> None:
    answer = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz")
    band = answer.band
    assert band is not None
    singles = [
        sp.predict(WIDE, model="walled", tail_rate="1.2 Hz", placement={"gap": gap, "pitch": pitch})
        for gap, pitch in zip(band.gap, band.pitch, strict=True)
    ]
    for name in ("forward_velocity", "advance_per_radian", "body_rotation_rate", "tail_torque", "plug_velocity"):
        values = [getattr(one, name) for one in singles]
        np.testing.assert_allclose(getattr(band.swimming, name), values, rtol=1e-12)
        everywhere = [*values, getattr(answer, name)]
        assert band.limits(name) == pytest.approx((min(everywhere), max(everywhere)), rel=1e-12)
    fastest, slowest = np.argmax(band.swimming.forward_velocity), np.argmin(band.swimming.forward_velocity)
    assert (band.gap[fastest], band.pitch[fastest]) == (band.gap.max(), band.pitch.max())
    assert (band.gap[slowest], band.pitch[slowest]) == (band.gap.min(), 0.0)
    assert band.limits("tail_rotation_rate") == pytest.approx((answer.tail_rotation_rate,) * 2, rel=1e-14)
    assert np.isnan(band.limits("motor_residual_torque")).all()


def test_every_place_swims_by_its_own_drive(leaning: Any) -> None:
    answer = sp.predict(WIDE, model="walled")
    assert answer.band is not None
    low, high = answer.band.limits("tail_rotation_rate")
    assert low < answer.tail_rotation_rate <= high
    assert answer.band.limits("motor_current")[0] < answer.band.limits("motor_current")[1]


def test_answer_names_the_band(leaning: Any) -> None:
    answer = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz", placement={"pitch": 0.0})
    written = answer.to_dict()
    speed = written["forward_velocity"]
    assert speed["low"] < speed["value"] < speed["high"]
    assert speed["kind"] == "band"
    assert "level" not in speed
    assert written["placement"]["gap"]["kind"] == "band"
    assert written["placement"]["gap"]["low"] == pytest.approx(1e-4)
    assert "low" not in written["placement"].get("pitch", {})
    assert written["band"]["forward_velocity"]["value"] == pytest.approx(answer.band.swimming.forward_velocity)
    assert written["motor_residual_torque"] == {"value": None, "unit": "N m"}
    json.dumps(written, allow_nan=False)
    alone = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz", band=False).to_dict()
    assert "band" not in alone
    assert "kind" not in alone["forward_velocity"]


def test_place_without_an_answer_is_left_out_and_said(leaning: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing_at_half_a_gap(batch: Any) -> Any:
        from spirillum.robot.limits import Limit

        gap = np.full(1, batch.placement.gap or 0.5e-3)
        return [
            Limit.of("placement.gap", gap, "at least", 2e-4, "mm", "thinner films are not resolved", "gap-too-thin")
        ]

    monkeypatch.setattr(leaning, "domain", nothing_at_half_a_gap)
    answer = sp.predict(WIDE, model="walled", tail_rate="1.2 Hz")
    assert answer.band is not None
    assert np.isnan(answer.band.swimming.forward_velocity).tolist() == [False] * 6 + [True] * 3
    assert np.isfinite(answer.band.limits("forward_velocity")).all()
    said = [sentence for sentence in answer.warnings if "the band leaves out" in sentence]
    assert len(said) == 3
    assert said[0].startswith("the band leaves out gap 0.1 mm, pitch 0 deg: placement.gap = 0.1 mm; allowed: at least")


def test_progress_counts_places(leaning: Any) -> None:
    told: list[tuple[str, int, int]] = []
    sp.predict(WIDE, model="walled", tail_rate="1 Hz", progress=lambda *what: told.append(what))
    assert [done for _, done, _ in told] == list(range(1, 11))
    assert {total for *_, total in told} == {10}
    assert told[0][0] == "walled, gap 1 mm, pitch 0 deg"


def test_interrupted_band_ends_at_once(leaning: Any) -> None:
    def stop(_what: str, done: int, _total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sp.predict(WIDE, model="walled", tail_rate="1 Hz", progress=stop)


def test_places_are_resolved_as_a_band_needs(walled: Any) -> None:
    batch = RobotBatch.of(sp.load(WIDE))
    place = Placement.of({"gap": 1e-3, "pitch": 0.0})
    assert batch.options.tube.tolerance == 0.005
    assert at_pose(batch, place).options.tube.tolerance == TOLERANCE
    assert at_pose(batch, place).placement == place


def test_comparison_stays_at_the_reference_place(leaning: Any) -> None:
    compared = sp.compare_models(WIDE, models=["sbt", "walled"], tail_rate="1 Hz")
    assert compared.predictions["walled"].band is None


def test_command_line(leaning: Any, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        main(["predict", WIDE, "--model", "walled", "--tail-rate", "1.2Hz", "--notes"])
    out = capsys.readouterr().out
    assert stopped.value.code == 0
    row = next(line for line in out.splitlines() if "forward velocity" in line)
    value, low, high = (float(cell) for cell in row.split("│")[1:4])
    assert low < value < high
    assert re.search(r"low and high:\s+extremes\s+over\s+9\s+more", out)
    assert re.search(
        r"gap 0.5 mm \(open: band over 0.1 to 1 mm\), pitch 0 deg \(open: band over 0 to 5.4\d* deg\)", out
    )
    assert "interval" not in out


def test_tube_itself_has_a_band(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    """One coarse level place: the band's answer is what a prediction there gives."""
    monkeypatch.setenv("SPIRILLUM_CACHE", str(tmp_path))
    monkeypatch.setattr("spirillum.swimming.band.GAP_BAND", (1.0 / 9.0, 1.0 / 9.0))
    monkeypatch.setattr("spirillum.swimming.band.TOLERANCE", 0.05)
    small = {"body.shape": "sphere", "body.diameter": "12 mm", "body.length": "12 mm", "coupling.length": "3 mm"}
    coarse = {
        "model.tube.tolerance": 0.05,
        "model.tube.phases": 1,
        "tail.length": "20 mm",
        "tail.wire_diameter": "1.5 mm",
        "channel.diameter": "30 mm",
        "coupling.diameter": "0 mm",
    } | {f"body.{end}": "none" for end in ("front", "rear")}
    robot = sp.load(WIDE, **small, **coarse)
    answer = sp.predict(robot, model="tube", tail_rate="1.2 Hz", placement={"pitch": 0.0}, band=True)
    there = sp.predict(robot, model="tube", tail_rate="1.2 Hz", placement={"pitch": 0.0, "gap": 6e-3 / 9.0})
    assert answer.band is not None
    np.testing.assert_allclose(answer.band.swimming.forward_velocity, there.forward_velocity, rtol=1e-12)
    assert answer.band.limits("forward_velocity") == (answer.forward_velocity, there.forward_velocity)
    assert isinstance(answer.band.swimming, Swimming)
