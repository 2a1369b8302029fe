"""`spirillum prepare` with tables that are there: one robot, several, none."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import spirillum as sp
from spirillum.cli.renderer import progress_bar
from spirillum.fluid.tube import progress_messages
from spirillum.fluid.tube.outer_resistance import NodeSolution, _mixed
from spirillum.fluid.tube.progress_messages import progress_message
from spirillum.fluid.tube.solids import Fineness
from spirillum.fluid.tube.stages import RESPONSES
from spirillum.fluid.wire.robot_geometry import RobotGeometry
from spirillum.robot.batch import RobotBatch
from spirillum.robot.tube_pose import TubePose
from spirillum.swimming.preparation import Prepared, preparations_answer


def test_one_robot_and_several(run) -> None:  # type: ignore[no-untyped-def]
    one = json.loads(run("prepare", "biorob2012-wide", "--json").out)
    assert one["schema"] == "spirillum.preparation/1"
    several = json.loads(run("prepare", "biorob2012-wide", "biorob2012-narrow", "--json").out)
    assert several["schema"] == "spirillum.preparations/1"
    assert several["robots"][0] == {name: one[name] for name in several["robots"][0]}
    assert [robot["channel_diameter"]["value"] for robot in several["robots"]] == [0.04, 0.03]
    printed = run("prepare", "biorob2012-wide", "biorob2012-narrow").out
    assert "25 x 2.5" in printed
    assert "biorob2012-narrow" in printed


def test_a_left_handed_tail_takes_the_table_of_its_mirror_image(run) -> None:  # type: ignore[no-untyped-def]
    answer = json.loads(run("prepare", "biorob2012-wide", "--set", "tail.handedness=left", "--json").out)
    assert answer["places"] == json.loads(run("prepare", "biorob2012-wide", "--json").out)["places"]


def test_no_robot_is_one_sentence(run) -> None:  # type: ignore[no-untyped-def]
    outcome = run("prepare")
    assert outcome.code == 2
    assert "no robot; allowed: a preset's name" in outcome.err


def test_fine_and_a_stage_exclude_each_other(run) -> None:  # type: ignore[no-untyped-def]
    refused = run("prepare", "biorob2012-wide", "--fine", "--stage", "straight")
    assert refused.code == 2
    assert "--fine and --stage are mutually exclusive" in refused.err


def test_of_several_robots_the_one_that_has_no_table_is_named() -> None:
    bath = sp.load("biorob2012-narrow", channel="none", name="bath")
    with pytest.raises(sp.InputError, match=r"^bath.*channel"):
        sp.prepare_all(["biorob2012-wide", bath])
    wide = sp.load("biorob2012-wide", name="wide tail", **{"tail.amplitude": "15 mm", "tail.wavelength": "40 mm"})
    with pytest.raises(sp.InputError, match=r"^wide tail.*tail.amplitude = 15 mm"):
        sp.prepare_all(["biorob2012-wide", wide])


def test_a_caution_on_several_tables_says_on_how_many() -> None:
    """A study's robots share a name, and a terminal shows one caution of a code."""
    made = sp.prepare("biorob2012-wide")
    worse = replace(made.table, error={**made.table.error, "sideways_force": 0.034})
    other = sp.load("biorob2012-wide", **{"tail.wavelength": "30 mm"})
    answer = preparations_answer([Prepared(made.robot, worse), Prepared(other, worse), made])
    first, second = [note["sentence"] for note in answer["notes"] if note["code"] == "table-not-checked"]
    assert first.startswith("biorob2012-wide, tail 25 x 2.5 mm: sideways force")
    assert first.endswith("(and 1 more of 3 robots: --notes)")
    assert second.startswith("biorob2012-wide, tail 30 x 2.5 mm: sideways force")


def test_the_worst_error_of_several_tables_is_named_first() -> None:
    """Each over what is allowed of it; the robots stay in the order of the request."""
    made = sp.prepare("biorob2012-wide")
    allowed = {name: share for name, share in RESPONSES.items() if name in ("sideways_force", "pitching_torque")}
    slight, bad = ({**made.table.error, **{n: x * share for n, share in allowed.items()}} for x in (1.1, 1.5))
    bad |= {"sideways_force": 1.7 * allowed["sideways_force"]}
    other = sp.load("biorob2012-wide", **{"tail.wavelength": "30 mm"})
    found = [Prepared(made.robot, replace(made.table, error=slight)), Prepared(other, replace(made.table, error=bad))]
    answer = preparations_answer(found)
    sentences = [note["sentence"] for note in answer["notes"] if note["code"] == "table-not-checked"]
    assert sentences[0].startswith("biorob2012-wide, tail 30 x 2.5 mm: sideways force")
    assert "tail 25 x 2.5 mm" in sentences[-1]
    errors = [robot["error"]["sideways_force"]["value"] for robot in answer["robots"]]
    assert errors == pytest.approx([slight["sideways_force"], bad["sideways_force"]])


def test_an_error_above_the_allowed_one_is_written_with_digits_that_differ() -> None:
    found = sp.prepare("biorob2012-wide")
    for error, said in ((0.0201, "2.01 %"), (0.02 + 1e-9, "2.0000001 %"), (0.034, "3.4 %")):
        worse = replace(found.table, error={**found.table.error, "sideways_force": error})
        (sentence,) = Prepared(found.robot, worse).warnings
        assert f"sideways force is off by up to {said} at yawed poses" in sentence
        assert "at most 2 % is expected" in sentence


@pytest.mark.parametrize("workers", [0, 65, True])
def test_wrong_numbers_of_processes_are_refused(workers: int) -> None:
    with pytest.raises(sp.InputError, match="workers = "):
        sp.prepare_all(["biorob2012-wide"], workers=workers)


@pytest.mark.parametrize("quiet", [True, False])
def test_table_that_nobody_asked_for_is_announced(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, quiet: bool
) -> None:
    """A line on standard error, also where no progress bar is shown."""
    monkeypatch.setattr(progress_messages, "slowdown", lambda _: 1.0)
    with progress_bar(quiet=quiet) as progress:
        progress(progress_message(60, 2, 0, (10.0, 17.0)), 0, 60)
        progress("poses of the table", 1, 60)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert " ".join(shown.err.split()).startswith(
        "no table of this tube yet: it is computed once from 60 poses, in 5 to 8 min on 2 free cores"
    )


def test_what_an_interrupted_preparation_has_kept_is_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time is that of the rest, and longer beside other work."""
    monkeypatch.setattr(progress_messages, "slowdown", lambda _: 1.0)
    said = progress_message(60, 2, 48, (10.0, 17.0))
    assert "from 60 poses, 48 of them saved before, 12 remaining, in 60 s to 2 min on 2 free cores" in said
    several = progress_message(60, 2, 48, (10.0, 17.0), further=24)  # two more tails at each: 0.42 of a pose each
    assert "12 remaining, in 2 to 3 min on 2 free cores" in several
    monkeypatch.setattr(progress_messages, "slowdown", lambda _: 3.0)
    busy = progress_message(60, 2, 48, (10.0, 17.0))
    assert busy.endswith("in 60 s to 2 min on 2 free cores, up to 5 min beside this machine's other work")


def test_the_time_left_does_not_jump_between_cheap_and_expensive_poses() -> None:
    """Forty nodes of 1 s and five of 12 s: at any time the mean pace gives the rest within 12 s and a sixth.

    They differ in their resolution, or in the number of tails that share them.
    """
    pose, geometry = TubePose(0.02, 0.01), RobotGeometry.of(RobotBatch.of(sp.load("biorob2012-wide")))
    tail = ((geometry, (0.0,)),)
    cost = {Fineness("standard", 0.03, 4): 1.0, Fineness("standard", 0.002, 6): 12.0}
    fine, coarse = sorted(cost, key=lambda one: -cost[one])
    nodes = [NodeSolution(tail, pose, fine)] * 5 + [NodeSolution(tail, pose, coarse)] * 40
    seconds = [cost[node.fineness] for _, node in _mixed(list(enumerate(nodes)))]
    assert sorted(number for number, _ in _mixed(list(enumerate(nodes)))) == list(range(45))
    shared = [NodeSolution(tail * 12, pose, coarse)] * 5 + [NodeSolution(tail, pose, coarse)] * 40
    for costs in (seconds, [float(len(node.tails)) for _, node in _mixed(list(enumerate(shared)))]):
        for done in range(10, 45):
            expected, true = sum(costs[:done]) / done * (45 - done), sum(costs[done:])
            assert abs(expected - true) < 12.0 + true / 6.0
