"""The task `keep-axis` and its controllers: the axis of its field is tilted so that the robot comes to the tube's axis.

With the place across the tube zeta = y + i z, and the tilt of the field's axis theta = yaw + i pitch, a confined robot
moves by

    d zeta/dt = m zeta + g theta,   m = lambda + i Omega,

linear for small tilts: Omega is the rate at which it is carried around the axis (the orbit of a pusher), lambda the
orbit's growth, |g| its speed for each radian of tilt, arg g how far the orbit turns a push. Both laws need the place
alone, not the attitude, which a camera sees badly:

    `position`   theta = -(1/T + lambda)/g zeta,     T = 5 s    (feedback of the place: Caldag and Yesilyurt 2020)
    `aim`        theta = -zeta/L                                (line of sight: Mohammadi and Spong 2021, no integral)

held within |theta| <= 3 degrees. The first takes m and g of the robot of the file, the second knows nothing of the
orbit. The place is filtered by the same equation (an observer), and moved on to where a command will act.

The field turns at the rate that is asked for. Where the body is seen to turn more slowly than 0.9 of it, the robot has
stepped out, and the field slows down to 0.8 of its rate.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator

from spirillum.arrays import Samples
from spirillum.controllers.lab import Lab
from spirillum.controllers.loop import LoopRun, run_loop
from spirillum.controllers.sensors import Command, Controller, Detection, FlowPulse, Message
from spirillum.controllers.task import FEEDBACK, Brief, Task
from spirillum.dynamics.plant import Plant, uninterrupted
from spirillum.dynamics.rotating_field import Field
from spirillum.errors import InputError
from spirillum.progress import Progress
from spirillum.robot.arguments import one_of
from spirillum.robot.fields import Length, Rate
from spirillum.units import show

Law = Literal["position", "aim"]

_CLOSED = 5.0  # T, s
_AHEAD = 2.0  # L over the body's length
MOST_TILT = np.radians(3.0)  #: Largest tilt, rad.
_OBSERVED_OVER = 0.7  # time constant of the observer, s
_TURNS_OVER = 2.0  # time over which the body's turning is compared with the field's, s
_SLIPS, _SLOWER = 0.9, 0.8


def pushed_for(orbit: complex, time: float) -> complex:
    """Time for which a constant push counts on an orbit: the integral of exp(m s) over a time, s."""
    return time if abs(orbit * time) < 1e-6 else complex((np.exp(orbit * time) - 1.0) / orbit)


@dataclass(frozen=True)
class Steering:
    """What is known of a robot beforehand; SI."""

    orbit: complex  #: m, 1/s.
    gain: complex  #: g, m/s.
    rate: float  #: Of the field, rad/s, with its sign.
    length: float  #: Of the body, m.

    def moved(self, place: complex, tilt: complex, dt: float) -> complex:
        """Lateral position after a time, m."""
        return complex(np.exp(self.orbit * dt) * place + pushed_for(self.orbit, dt) * self.gain * tilt)

    def tilt(self, law: Law, place: complex) -> complex:
        """Tilt commanded by a law at a lateral position, rad."""
        per_place = (1.0 / _CLOSED + self.orbit.real) / self.gain if law == "position" else 1.0 / (_AHEAD * self.length)
        asked = -per_place * place
        return complex(asked * min(1.0, MOST_TILT / max(abs(asked), 1e-12)))


class Steer(Controller):
    """Feedback of the lateral position."""

    def __init__(self, lab: Lab, known: Steering, law: Law, *, knowing: bool = False) -> None:
        self.knowing = self.blind = knowing
        self._known, self._law, self._delay = known, law, lab.remote.delay
        self._rate = known.rate
        self._place: complex | None = None
        self._seen_at = 0.0
        self._sent: deque[tuple[float, complex]] = deque([(0.0, 0j)])
        self._turns: deque[tuple[float, float]] = deque()
        self._tilt = 0j

    def decide(self, news: Message) -> Command:
        """The tilt of the law where the command will act."""
        if news.truth is not None:
            place = complex(*news.truth.pose.position[1:])
            self._see(Detection(news.time, 0.0, 0.0, news.truth.values["body_angle"], 0.0, place.real, place.imag))
            self._place = place
        for sight in news.sights:
            self._see(sight)
        if self._place is None:
            return Command(1.0, _field(self._rate, 0j))
        acts = news.time + self._delay
        self._tilt = self._known.tilt(self._law, self._moved(acts))
        self._sent.append((acts, self._tilt))
        return Command(1.0, _field(self._rate, self._tilt))

    def estimate(self) -> Mapping[str, float]:
        """Lateral position, tilt and rate of the field."""
        place = complex(np.nan, np.nan) if self._place is None else self._place
        return {
            "estimated_side": place.real,
            "estimated_height": place.imag,
            "field_yaw": self._tilt.real,
            "field_pitch": self._tilt.imag,
            "field_rate": self._rate,
        }

    def _see(self, sight: Detection) -> None:
        """Take a sight into the observer, and watch whether the robot follows the field."""
        seen = complex(sight.side, sight.height)
        if self._place is None:
            self._place, self._seen_at = seen, sight.time
        moved = self._moved(sight.time)
        share = 1.0 - np.exp(-(sight.time - self._seen_at) / _OBSERVED_OVER)
        self._place, self._seen_at = moved + share * (seen - moved), sight.time
        while len(self._sent) > 1 and self._sent[1][0] <= sight.time:
            self._sent.popleft()
        self._turns.append((sight.time, sight.body_angle))
        if sight.time - self._turns[0][0] < _TURNS_OVER:
            return
        (start, first), (end, last) = self._turns.popleft(), self._turns[-1]
        if abs(last - first) < _SLIPS * abs(self._rate) * (end - start):
            self._rate *= _SLOWER
            self._turns.clear()

    def _moved(self, time: float) -> complex:
        """Lateral position at a time, given the tilts that have been sent, m."""
        place, now = self._place or 0j, self._seen_at
        for (_, tilt), (end, _) in zip(self._sent, [*list(self._sent)[1:], (time, 0j)], strict=True):
            until = min(end, time)
            if until > now:
                place, now = self._known.moved(place, tilt, until - now), until
        return place


class Replay(Controller):
    """Open loop: tilts that were computed beforehand; without any, the field turns about the tube's axis."""

    blind = True

    def __init__(self, rate: float, tilts: Sequence[tuple[float, complex]] = ()) -> None:
        self._rate, self._tilts = rate, tilts

    def decide(self, news: Message) -> Command:
        """The last tilt that was due."""
        tilt = next((tilt for start, tilt in reversed(self._tilts) if start <= news.time), 0j)
        return Command(1.0, _field(self._rate, tilt))


def _field(rate: float, tilt: complex) -> Field:
    return Field.model_construct(rotation_rate=rate, yaw=tilt.real, pitch=tilt.imag, strength=None)


_DURATION = 60.0  # of a run, s
_SHARE = 0.9  # largest rate of the field over the step-out rate
_SETTLED = 2  # turns of the field before orbit and gain are looked for


@dataclass(frozen=True)
class SteeringBrief(Brief):
    """What is known of a magnetic robot beforehand."""

    steering: Steering
    tilts: tuple[tuple[float, complex], ...]  #: Of the open loop: times, s, and tilts, rad.


class KeepAxisTask(Task):
    """Swim along the tube's axis, steered by the axis of the field."""

    kind: ClassVar[str] = "keep-axis"
    error_name: ClassVar[str] = "mean distance from the axis over the second half"
    error_unit: ClassVar[str] = "m"
    across: ClassVar[bool] = True

    law: Annotated[Law, BeforeValidator(one_of("position", "aim"))] = "position"
    """`position`: feedback of the lateral position, with the predicted orbit; `aim`: at a point of the axis ahead."""
    rate: Rate | None = None  #: Of the field, at most 0.9 of the step-out rate; None: the robot's own.
    tolerance: Length = 5e-4  #: How far from the axis is good.

    def brief(self, plant: Plant, lab: Lab, progress: Progress | None) -> SteeringBrief:
        """Check the field's rate, find orbit and gain, and the tilts for the robot of the file."""
        field, step_out = plant.state.field, float(plant.steady.step_out_rate)
        if field is None:
            raise InputError(f"task 'keep-axis' with {plant.robot.name}; allowed: a robot with drive.kind 'magnetic'")
        rate = field.rotation_rate if self.rate is None else self.rate
        if not 0.0 < abs(rate) <= _SHARE * step_out:
            raise InputError(
                f"task.rate = {show(rate, 'Hz')}; allowed: up to {show(_SHARE * step_out, 'Hz')}, {_SHARE:g} of its "
                "step-out rate"
            )
        steering = _identified(plant, rate)
        duration = _DURATION if self.duration is None else self.duration
        exact = Lab.exact()
        ahead = run_loop(plant.copy(), Steer(exact, steering, self.law), exact, duration, progress=progress)
        if ahead.interrupted:
            raise KeyboardInterrupt
        return SteeringBrief(
            lab=lab,
            duration=duration,
            speed=float(plant.steady.forward_velocity),
            duty=1.0,
            schedule=(duration, 1.0),
            carried=0.0,
            steering=steering,
            tilts=tuple(
                (one.time, complex(one.estimate["field_yaw"], one.estimate["field_pitch"])) for one in ahead.decisions
            ),
        )

    def controller(self, name: str, brief: Brief, flow: FlowPulse | None) -> Controller:  # noqa: ARG002 - one interface
        """A new controller; doing nothing leaves the field's axis along the tube."""
        assert isinstance(brief, SteeringBrief)  # noqa: S101 - this task's own
        if name in (FEEDBACK, "knowing"):
            return Steer(brief.lab, brief.steering, self.law, knowing=name == "knowing")
        return Replay(brief.steering.rate, brief.tilts if name == "open-loop" else ())

    def target(self, time: Samples, way: float) -> tuple[Samples, float]:  # noqa: ARG002 - one interface
        """The axis, throughout."""
        return np.zeros_like(time), self.tolerance

    def _error(self, run: LoopRun, brief: Brief) -> float:
        even = np.linspace(0.5 * brief.duration, brief.duration, 400)
        return float(np.mean(np.interp(even, run.time, np.hypot(run.position[:, 1], run.position[:, 2]))))

    def _is_good(self, error: float) -> bool:
        return error <= self.tolerance


def _identified(plant: Plant, rate: float) -> Steering:
    """Orbit and gain of a robot where it starts, from a look ahead with a tilt and without one."""
    turn = 2.0 * np.pi / abs(rate)

    def place(of: Plant, tilt: float, time: float) -> complex:
        field = Field.of({"rotation_rate": rate, "yaw": tilt})
        moment = uninterrupted(of.step(time, field=field, duty=1.0))
        if moment.ended:
            why = f"{moment.ended} after {moment.time:.4g} s"
            raise InputError(f"{of.robot.name} cannot be steered there: {why}; allowed: another place or rate")
        return complex(*moment.pose.position[1:])

    ahead = plant.copy()
    before = place(ahead, 0.0, _SETTLED * turn)
    straight, aside = place(ahead.copy(), 0.0, turn), place(ahead.copy(), MOST_TILT, turn)
    orbit = complex(np.log(straight / before)) / turn if abs(before) > 0.0 and abs(straight) > 0.0 else 0j
    gain = (aside - straight) / (MOST_TILT * pushed_for(orbit, turn))
    return Steering(orbit, complex(gain), rate, plant.robot.body.length)
