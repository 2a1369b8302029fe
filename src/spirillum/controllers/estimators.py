"""State estimators: a Kalman filter of position and speed, and a bank of robots that differ in what is unknown.

The unknown factors of friction and gap are u, v in [-1, 1] as powers of their largest factors. The members stand at
Chebyshev's points of both; between them a polynomial in u and v interpolates what they do (Trefethen 2013). Two more
members at each friction, of the robot file's gap, tell how all of it changes with the battery's voltage and the fluid's
viscosity: viscosity counts for more where friction is small.

The state is place x, speed s at full duty, drift w of the fluid, and the camera's slow error b with its memory T:

    dx/dt = u(t) s + w,   ds = sigma_s dB,   dw = -w/tau dt + sigma_w sqrt(2/tau) dB',
    db = -b/T dt + sigma_b sqrt(2/T) dB'',   y_k = x(t_k) + b(t_k) + noise,

with the duty u that acts at t, which was sent a delay before (Kalman 1960). Frames are used at the time of their
exposure; what has been sent since moves the state on to the time at which a command that is decided now will act: the
predictor of Smith (1957) for a dead time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab, Unknown
from spirillum.controllers.sensors import Controller, Detection, Message, SampledErrors, plant_of
from spirillum.dynamics.plant import Plant, Snapshot, uninterrupted
from spirillum.errors import InputError
from spirillum.progress import Progress, tell
from spirillum.robot.robot import Robot

_POINTS = 5
_STEP = 0.1  # between two moments that are kept, s
_CHANGE = 0.02  # relative change of voltage and of viscosity of the two more members


def points(factor: float) -> Samples:
    """Powers of a factor at which members stand: Chebyshev's points of [-1, 1], or 0 where nothing is unknown."""
    return -np.cos(np.pi * np.arange(_POINTS) / (_POINTS - 1)) if factor > 1.0 else np.zeros(1)


def interpolation(nodes: Samples, at: Samples) -> Samples:
    """Weights of the values at nodes for the polynomial through them, (at, nodes)."""
    from scipy.interpolate import BarycentricInterpolator

    if nodes.size == 1:
        return np.ones((at.size, 1))
    return np.asarray(BarycentricInterpolator(nodes, np.eye(nodes.size), rng=0)(at))


@dataclass(frozen=True)
class Paths:
    """What the members did; SI."""

    time: Samples  #: s, (n,).
    members: Samples  #: Tail's phase and body's angle, rad, current, A, and voltage, V, (friction, gap, 4, n).
    sensitivity: Samples  #: Relative change of a quantity per that of voltage and viscosity, (friction, 2, 4, n).


class Bank:
    """The members, and their motion since release."""

    def __init__(
        self,
        robot: Robot,
        unknown: Unknown,
        arguments: Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Create the ensemble members at their start."""
        if robot.drive is None or robot.drive.kind != "dc-motor":
            raise InputError(f"learn is given with {robot.name}; allowed: a robot with drive.kind 'dc-motor'")
        self.friction, self.gap = points(unknown.friction_factor), points(unknown.gap_factor)
        factors = [float(unknown.friction_factor**u) for u in self.friction]
        members = [SampledErrors(factor, float(unknown.gap_factor**v)) for factor in factors for v in self.gap]
        for factor in factors:
            members += [SampledErrors(factor, 1.0, voltage=1.0 + _CHANGE)]
            members += [SampledErrors(factor, 1.0, viscosity=1.0 + _CHANGE)]
        self._plants: list[Plant] = []
        for member in members:
            self._plants.append(plant_of(robot, arguments or {}, member))
            tell(progress, "bank of robots", len(self._plants), len(members))
        self._time = [0.0]
        self._rows = [[_quantities(plant.observe()) for plant in self._plants]]

    @property
    def time(self) -> float:
        """Up to when the members are simulated, s."""
        return self._time[-1]

    @property
    def duty(self) -> float:
        """The robot's own."""
        return float(self._plants[0].state.command)

    @property
    def current(self) -> float:
        """Predicted while the drive is on, A."""
        return float(abs(self._plants[0].steady.motor_current))

    def follow(self, time: float, duty: float) -> None:
        """Simulate all members up to a time at a duty."""
        while time - self.time > 1e-9:
            dt = min(_STEP, time - self.time)
            moments = [uninterrupted(plant.step(dt, duty=duty)) for plant in self._plants]
            self._time.append(moments[0].time)
            self._rows.append([_quantities(moment) for moment in moments])

    def paths(self) -> Paths:
        """What the members have done so far."""
        rows = np.moveaxis(np.array(self._rows), 0, -1)
        count = self.friction.size * self.gap.size
        members = rows[:count].reshape(self.friction.size, self.gap.size, *rows.shape[1:])
        changed = rows[count:].reshape(self.friction.size, 2, *rows.shape[1:])
        unchanged = members[:, self.gap.size // 2, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            sensitivity = np.nan_to_num((changed / unchanged - 1.0) / _CHANGE, posinf=0.0, neginf=0.0)
        return Paths(np.array(self._time), members, sensitivity)


def _quantities(moment: Snapshot) -> list[float]:
    values = moment.values
    return [moment.pose.tail_phase, values["body_angle"], values["motor_current"], values["battery_voltage"]]


_SPEED_WALK = 0.15  # sigma_s over the predicted speed, 1/sqrt(s): the film under the robot thins in some ten seconds
_DRIFT = 3e-4  # sigma_w, m/s: of the size of a pulse
_DRIFT_MEMORY = 2.0  # tau, s
_STRAY = 6.0  # sights further away than so many standard deviations are left out...
_STRAYS = 5  # ...but not more than so many in a row


class PositionFilter:
    """The filter of one run."""

    def __init__(self, lab: Lab, speed: float, *, walk: float = _SPEED_WALK, drift: float = _DRIFT) -> None:
        """Start at a speed of full duty, m/s, as uncertain as large; `walk` in 1/sqrt(s), `drift` in m/s."""
        self._noise = max(lab.camera.position_noise, 1e-6) ** 2
        self._wander, self._memory = lab.camera.position_wander, lab.camera.memory
        self._delay = lab.remote.delay
        self._walk = (walk * abs(speed)) ** 2
        self._sent: deque[tuple[float, float]] = deque([(0.0, 0.0)])
        self._time, self._strays, self._drift = 0.0, 0, drift
        self._mean: Samples = np.array([0.0, speed, 0.0, 0.0])
        self._spread: Samples = np.diag([1e-3, abs(speed), drift, self._wander]) ** 2

    def send(self, time: float, duty: float) -> None:
        """Note a command that is sent now."""
        if duty != self._sent[-1][1]:
            self._sent.append((time + self._delay, duty))

    def see(self, sight: Detection) -> None:
        """Take in a sight."""
        self._mean, self._spread = self.ahead(sight.time)
        self._time = sight.time
        while len(self._sent) > 1 and self._sent[1][0] <= self._time:
            self._sent.popleft()
        along = self._spread[:, 0] + self._spread[:, 3]
        surprise, size = sight.position - self._mean[0] - self._mean[3], along[0] + along[3] + self._noise
        if surprise**2 > _STRAY**2 * size and self._strays < _STRAYS:
            self._strays += 1
            return
        self._strays = 0
        self._mean = self._mean + along * surprise / size
        self._spread = self._spread - np.outer(along, along) / size

    def ahead(self, time: float) -> tuple[Samples, Samples]:
        """Mean (x, s, w, b) and covariance at a time, with the commands that have been sent; SI."""
        mean, spread, now = self._mean, self._spread, self._time
        edges = [start for start, _ in self._sent if now < start < time]
        for after in [*edges, time]:
            if after > now:
                duty = [duty for start, duty in self._sent if start <= now][-1]
                mean, spread = self._stepped(mean, spread, after - now, duty)
                now = after
        return mean, spread

    def _stepped(self, mean: Samples, spread: Samples, dt: float, duty: float) -> tuple[Samples, Samples]:
        left, kept = np.exp(-dt / _DRIFT_MEMORY), np.exp(-dt / self._memory)
        moves = np.diag([1.0, 1.0, left, kept])
        moves[0, 1], moves[0, 2] = duty * dt, _DRIFT_MEMORY * (1.0 - left)
        spread = moves @ spread @ moves.T
        spread[1, 1] += self._walk * dt
        spread[2, 2] += self._drift**2 * (1.0 - left**2)
        spread[3, 3] += self._wander**2 * (1.0 - kept**2)
        return moves @ mean, spread


class PositionController(Controller):
    """A controller that follows the robot by the filter; an oracle is given its position."""

    def __init__(
        self,
        lab: Lab,
        speed: float,
        duty: float,
        *,
        knowing: bool = False,
        walk: float = _SPEED_WALK,
        drift: float = _DRIFT,
    ) -> None:
        self.knowing = self.blind = knowing
        self._follower = PositionFilter(lab, speed / duty, walk=walk, drift=drift)
        self._full, self._delay = speed / duty, lab.remote.delay
        self._way, self._duty = float(np.sign(speed)), duty
        self._now: Samples = np.array([0.0, self._full, 0.0, 0.0])
        self._error = 0.0

    def _follow(self, news: Message) -> Samples:
        """Predicted position, speed at full duty, drift and camera error when a command issued now will act."""
        for sight in news.sights if news.truth is None else ():
            self._follower.see(sight)
        if news.truth is not None:
            self._follower.see(Detection(news.time, float(news.truth.pose.position[0]), 0.0, 0.0, 0.0))
        self._now, spread = self._follower.ahead(news.time)
        self._error = float(np.sqrt(spread[0, 0]))
        return self._follower.ahead(news.time + self._delay)[0]

    def _sent(self, news: Message, duty: float) -> float:
        self._follower.send(news.time, duty)
        return duty

    def estimate(self) -> Mapping[str, float]:
        """Position, its standard deviation, speed at the robot's own duty, and drift."""
        return {
            "estimated_position": float(self._now[0]),
            "estimated_position_error": self._error,
            "estimated_speed": float(self._now[1] * self._duty),
            "estimated_drift": float(self._now[2]),
        }
