"""The environments: clean for Gymnasium's checker, one robot as a batch of one, seeds that repeat, limits of rules."""

import warnings
from typing import Any

import numpy as np
import pytest

import spirillum as sp
from spirillum.controllers.lab import Lab

gymnasium: Any = pytest.importorskip("gymnasium")

HOME = "spirillum.interfaces.environments:"
NAMES = ("spirillum/StopAt-v0", "spirillum/HoldSpeed-v0")
IN_FLOW: dict[str, Any] = {"gap": "0.5 mm", "pitch": 0.0, "flow": 0.0}


@pytest.mark.parametrize("name", NAMES)
def test_checker_of_gymnasium_has_nothing_to_say(name: str) -> None:
    from gymnasium.utils.env_checker import check_env

    made = gymnasium.make(HOME + name, model="rft", render_mode="ansi")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made.unwrapped)
    made.close()


@pytest.mark.parametrize("name", NAMES)
def test_one_robot_is_a_batch_of_one(name: str) -> None:
    one = gymnasium.make(HOME + name, model="rft", duration=1.0)
    batch = gymnasium.make_vec(HOME + name, num_envs=1, model="rft", duration=1.0)
    seen, info = one.reset(seed=3)
    seen_batch, batch_info = batch.reset(seed=3)
    one.action_space.seed(1)
    for step in range(30):
        np.testing.assert_array_equal(seen, seen_batch[0])
        action = one.action_space.sample()
        seen, reward, _, ended, info = one.step(action)
        seen_batch, rewards, _, all_ended, batch_info = batch.step(np.array([action]))
        assert reward == rewards[0]
        assert ended == all_ended[0] == (step == 29)
    assert batch_info["score"][0] == pytest.approx(info["score"])


@pytest.mark.parametrize("name", NAMES)
def test_seeds_repeat_and_robots_differ(name: str) -> None:
    batch = gymnasium.make_vec(HOME + name, num_envs=4, model="rft", duration=0.5)
    on = np.ones(batch.action_space.shape, dtype=batch.action_space.dtype)
    seen = []
    for seed in (1, 1, 2):
        first, _ = batch.reset(seed=seed)
        seen.append(np.stack([first, *(batch.step(on)[0] for _ in range(40))]))
    np.testing.assert_array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[0], seen[2])
    assert len(np.unique(seen[0][0, :, 0])) == 4
    assert all(batch.single_observation_space.contains(one) for one in seen[0].reshape(-1, seen[0].shape[-1]))


def test_batch_begins_anew_in_the_step_after_its_end() -> None:
    batch = gymnasium.make_vec(HOME + NAMES[0], num_envs=2, model="rft", duration=0.2)
    batch.reset(seed=1)
    ends = [batch.step(np.ones(2, dtype=np.int64)) for _ in range(8)]
    assert [bool(truncated.all()) for _, _, _, truncated, _ in ends] == [n == 5 for n in range(8)]
    seen, reward, _, _, _ = ends[6]
    assert not reward.any()
    np.testing.assert_array_equal(seen[:, 3], 1.0)


def test_exact_lab_shows_the_truth() -> None:
    one = gymnasium.make(HOME + NAMES[0], model="rft", lab=Lab.exact())
    seen, info = one.reset(seed=1)
    goal, reward = float(seen[0]), 0.0
    for _ in range(100):
        seen, reward, _, _, info = one.step(1)
    assert seen[0] == pytest.approx(goal - 1e3 * info["position"], abs=1e-5)
    assert reward == pytest.approx(-info["score"] / 30)
    steady = sp.predict("biorob2012-wide", model="rft")
    assert seen[1] == pytest.approx(1e3 * steady.forward_velocity, rel=1e-3)


@pytest.mark.parametrize(("name", "column"), [(NAMES[0], 2), (NAMES[1], 3)])
def test_an_agent_sees_what_it_sent_and_not_whether_that_arrived(name: str, column: int) -> None:
    one = gymnasium.make(HOME + name, model="rft", lab={"remote": {"lost": 0.9}}).unwrapped
    one.reset(seed=1)
    assert all(one.step(np.array([action]))[0][column] == action for action in (1, 0, 1, 0, 1))


def test_rules_score_as_their_limits_say() -> None:
    from spirillum.interfaces.environments import baseline

    options: dict[str, Any] = {"model": "rft", "episodes": 200, "duration": 5.0}
    nothing = baseline(NAMES[0], "nothing", lab=Lab.exact(), **options)
    assert nothing.mean == pytest.approx(3.5, abs=3 * nothing.margin)  # goals lie evenly from 1 to 6 mm
    step = 1e3 * sp.predict("biorob2012-wide", model="rft").forward_velocity / 30
    coasting = 1.25  # the current decays in a quarter of a step
    assert baseline(NAMES[0], "bang-bang", lab=Lab.exact(), **options).scores.max() < coasting * step
    real = [baseline(NAMES[0], rule, **options).mean for rule in ("nothing", "bang-bang", "lead")]
    assert real[0] > real[1] > real[2]
    assert baseline(NAMES[1], "nothing", **options).mean == pytest.approx(1.0)
    assert baseline(NAMES[1], "integral", **{**options, "duration": 15.0}).mean < 0.05


def test_pulse_of_flow_carries_the_robot_in_the_tube() -> None:
    """A robot that is off moves as far as `AxialBatch` says, exactly as long as the pulse lasts."""
    pulse = {"velocity": "1 mm/s", "duration": "1 s", "start": "1 s"}
    lab = {"pulse": pulse, "unknown": {"friction_factor": 1.0}}
    one = gymnasium.make(HOME + NAMES[0], model="tube", lab=lab, placement=IN_FLOW)
    one.reset(seed=1)
    places = [one.step(0)[4]["position"] for _ in range(90)]
    robots = sp.AxialBatch("biorob2012-wide", 1, model="tube", placement=IN_FLOW)
    robots.step(1.0, remote=False, flow=1e-3)
    assert abs(places[29]) < 1e-12
    assert places[59] == pytest.approx(float(robots.observe()["position"][0]), rel=1e-6)
    assert places[89] == pytest.approx(places[59], rel=1e-2)


@pytest.mark.parametrize("action", [float("nan"), 7, -1])
@pytest.mark.parametrize("name", NAMES)
def test_wrong_actions_are_a_sentence(name: str, action: float) -> None:
    one = gymnasium.make(HOME + name, model="rft").unwrapped
    one.reset(seed=1)
    with pytest.raises(sp.InputError, match="action = "):
        one.step(np.array([action]))
    for wrong in ("on", {}, [[1], [1, 2]]):
        with pytest.raises(sp.InputError, match="action = "):
            one.step(wrong)
    for seed in (-1, "a", 1.5):
        with pytest.raises(sp.InputError, match="seed = "):
            one.reset(seed=seed)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"duration": 0.0}, "duration = 0 s; allowed"),
        ({"goal": (2.0, 1.0)}, "goal = "),
        ({"goal": (1.0, float("inf"))}, "goal = "),
        ({"robot": "nobody"}, "nobody"),
        ({"lab": {"camera": {"fps": -1}}}, r"camera\.fps"),
        ({"colour": "red"}, "allowed: options of its task"),
        ({"robot": "ecoli"}, r"drive\.kind = 'torque-speed'"),
    ],
)
def test_wrong_options_are_a_sentence(options: dict[str, Any], sentence: str) -> None:
    with pytest.raises(sp.InputError, match=sentence):
        gymnasium.make(HOME + NAMES[0], **{"model": "rft", **options})
    environments = pytest.importorskip("spirillum.interfaces.environments")
    with pytest.raises(sp.InputError, match="render_mode = 'human'; allowed: ansi or None"):
        environments.Environment(NAMES[0], render_mode="human")
    with pytest.raises(sp.InputError, match="task = 'nobody'; allowed: spirillum/StopAt-v0"):
        environments.Environment("nobody")
