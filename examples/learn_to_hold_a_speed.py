"""Learn to hold a speed on a thousand robots at once, by the cross-entropy method, and compare with a simple rule.

Every robot has its own friction and battery, a late and noisy camera, and a remote that loses commands. The rule that
is learnt changes the duty in proportion to the seen error, as `integral` does, and pulls it to a line of the target:

    duty <- duty + dt (g (1 - speed/target) + h (a + b target - duty)).

Four numbers, (g, h, a, b), are drawn from a normal distribution for 64 candidates; each is tried on 16 robots, and the
best eight give the next distribution (R. Y. Rubinstein, The cross-entropy method for combinatorial and continuous
optimization, Methodology and Computing in Applied Probability 1, 1999).
"""

from __future__ import annotations

import gymnasium
import numpy as np

CANDIDATES, ROBOTS, BEST, GENERATIONS = 64, 16, 8, 8
STEPS, DT = 240, 1.0 / 30.0
OPTIONS = {"model": "rft", "duration": STEPS * DT, "ranges": {"battery.voltage": (3.3, 3.7)}}
INTEGRAL = np.array([[1.0, 0.0, 0.0, 0.0]])


def played(tasks: gymnasium.vector.VectorEnv, rules: np.ndarray, seed: int) -> np.ndarray:
    """Mean reward of each rule, (n,), each on its own share of the robots.

    Args:
        tasks: the robots.
        rules: numbers of each rule, (n, 4).
        seed: of robots, targets and errors.
    """
    g, h, a, b = np.repeat(rules, tasks.num_envs // len(rules), axis=0).T
    seen, _ = tasks.reset(seed=seed)
    total = np.zeros(tasks.num_envs)
    for _ in range(STEPS):
        target, speed, _, duty, _ = seen.T.astype(float)
        change = g * np.clip(1.0 - speed / target, -1.0, 1.0) + h * (a + b * target - duty)
        seen, reward, _, _, _ = tasks.step(np.clip(duty + DT * change, 0.0, 1.0)[:, None].astype(np.float32))
        total += reward
    return total.reshape(len(rules), -1).mean(axis=1)


def main() -> None:
    """Learn, then judge both rules on robots that neither has seen."""
    tasks = gymnasium.make_vec(
        "spirillum.interfaces.environments:spirillum/HoldSpeed-v0", num_envs=CANDIDATES * ROBOTS, **OPTIONS
    )
    rng = np.random.default_rng(1)
    middle, spread = np.array([1.0, 1.0, 0.0, 0.2]), np.array([1.0, 2.0, 0.3, 0.2])
    for generation in range(GENERATIONS):
        rules = middle + spread * rng.standard_normal((CANDIDATES, 4))
        rewards = played(tasks, rules, seed=generation)
        best = rules[np.argsort(rewards)[-BEST:]]
        middle, spread = best.mean(axis=0), best.std(axis=0) + 0.01
        print(f"generation {generation}: mean reward of the best {rewards[np.argsort(rewards)[-BEST:]].mean():.3f}")
    learnt, simple = (float(played(tasks, rule, seed=1000)[0]) for rule in (middle[None], INTEGRAL))
    g, h, a, b = middle
    print(f"learnt: g = {g:.2f}/s, h = {h:.2f}/s, a = {a:.2f}, b = {b:.3f} s/mm")
    print(f"reward on new robots: learnt {learnt:.3f}, integral {simple:.3f}")
    # A line through the target starts near the right duty, which `integral` has to find from nothing.
    assert learnt > 0.9 * simple


if __name__ == "__main__":
    main()
