"""`resistance --part both`: the 12x12 of body and rotor, against its blocks, sums and an exact shift of its point."""

import json
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.cli import main

WIDE = "biorob2012-wide"


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    with pytest.raises(SystemExit) as stopped:
        main(["resistance", WIDE, *arguments])
    assert stopped.value.code in (0, None)
    return capsys.readouterr().out


def both(**options: Any) -> Any:
    return sp.resistance(WIDE, part="both", **options)


@pytest.mark.parametrize("model", ["rft", "slender"])
def test_both_links_in_one_motion_are_the_robot_with_its_joint_locked(model: str) -> None:
    """Twists of both are the same, and wrenches add up: B_robot = P' B P with P = (1, 1)."""
    for about in ("body", "tail-root"):
        options: dict[str, Any] = {"model": model, "about": about, "phase": "40 deg"}
        matrix = both(**options).matrix
        locked = sp.resistance(WIDE, part="robot", **options).matrix
        stacked = np.vstack([np.eye(6), np.eye(6)])
        np.testing.assert_allclose(stacked.T @ matrix @ stacked, locked, rtol=1e-9, atol=1e-12 * abs(locked).max())
        np.testing.assert_allclose(matrix, matrix.T, rtol=1e-9, atol=1e-9)
        assert np.linalg.eigvalsh(matrix).min() > 0


def test_links_that_do_not_feel_each_other_are_their_own_blocks() -> None:
    for about in ("body", "tail-root"):
        matrix = both(model="rft", about=about, phase="1 rad").matrix
        for part, at in (("body", slice(0, 6)), ("rotor", slice(6, 12))):
            alone = sp.resistance(WIDE, part=part, model="rft", about=about, phase="1 rad").matrix
            np.testing.assert_allclose(matrix[at, at], alone, rtol=1e-12, atol=1e-15)
        assert not matrix[:6, 6:].any()


def test_power_does_not_depend_on_the_point() -> None:
    """The same motion as twists about either point dissipates the same power."""
    robot = sp.load(WIDE)
    root = np.array([-(0.5 * robot.body.length + robot.coupling.length), 0.0, 0.0])
    twists = np.random.default_rng(0).normal(size=(2, 6))
    moved = twists.copy()
    for twist in moved:
        twist[:3] += np.cross(twist[3:], root)
    here, there = both(model="slender").matrix, both(model="slender", about="tail-root").matrix
    power = twists.reshape(12) @ here @ twists.reshape(12)
    assert moved.reshape(12) @ there @ moved.reshape(12) == pytest.approx(power, rel=1e-9)


def test_json_has_units_by_blocks_and_unknown_entries_are_null(capsys: pytest.CaptureFixture[str]) -> None:
    answer = json.loads(printed(capsys, "--part", "both", "--model", "sbt", "--json"))
    assert answer["schema"] == "spirillum.resistance/1"
    assert (answer["part"], answer["links"], answer["about"]) == ("both", ["body", "rotor"], "body")
    matrix, units = answer["matrix"]["value"], answer["matrix"]["unit"]
    assert (len(matrix), len(matrix[0])) == (12, 12)
    assert units == [["N s/m", "N s"] * 2, ["N s", "N m s"] * 2] * 2
    known = {place for place, row in enumerate(matrix) if any(entry is not None for entry in row)}
    assert known == {0, 3, 6, 9}
    single = json.loads(printed(capsys, "--json"))
    assert single["matrix"]["unit"] == [["N s/m", "N s"], ["N s", "N m s"]]
    assert "links" not in single


def test_table_shows_three_blocks(capsys: pytest.CaptureFixture[str]) -> None:
    words = printed(capsys, "--part", "both", "--model", "rft")
    assert words.count("Omega_x") == 3
    assert "on the body, by motion of the rotor" in words


def test_a_model_of_the_body_alone_refuses_both() -> None:
    with pytest.raises(sp.InputError, match="part = 'both' with model 'perrin'; allowed: body"):
        both(model="perrin")
