"""All models side by side on one robot, and why they differ: effect by effect, up to the trial."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spirillum.arrays import Axial, PerRobot
from spirillum.display import DisplayMixin
from spirillum.dynamics.trial import TrialRequest
from spirillum.envelope import envelope, quantity
from spirillum.errors import InputError, check_choice
from spirillum.fitted.fit import read_fit
from spirillum.fluid.algebra import two_parts_axial
from spirillum.fluid.registry import SWIMMER_MODELS, check_placement, find_swimmer_model
from spirillum.fluid.wire.slender import Slender
from spirillum.notes import Note
from spirillum.progress import Progress, tell
from spirillum.robot.batch import RobotBatch
from spirillum.robot.load import load, with_resolution
from spirillum.robot.model_options import Resolution
from spirillum.robot.placement import Placement
from spirillum.robot.robot import Robot
from spirillum.robot.tables import FrictionModel
from spirillum.swimming.balance import find_friction_model
from spirillum.swimming.motions import STEADY, headline
from spirillum.swimming.prediction import Prediction, predict_steady
from spirillum.swimming.preparation import UNBOUNDED, WALLED
from spirillum.swimming.steady import swim

LIGHTHILL = "sbt"  #: The theory from which the effects are counted.


class Effect(NamedTuple):
    """One step from Lighthill's theory to the trial."""

    name: str  #: Effect that is included from here on.
    speed: float  #: Forward velocity with this effect and all before it, m/s.


class _ApartFromEachOther(Slender):
    """Body and rotor resolved, each alone in the fluid; the rotor with or without its coupling."""

    def __init__(self, *, coupling: bool) -> None:
        super().__init__()
        self._rotor = ("tail", "coupling") if coupling else ("tail",)

    def axial(self, batch: RobotBatch) -> Axial:
        """See `SwimmerModel.axial`."""
        body = self._entries(batch, "body")
        parts = [self._entries(batch, part) for part in self._rotor]
        drag, coupling, rotation = (sum(entries) for entries in zip(*parts, strict=True))
        return two_parts_axial(body, (drag, coupling, rotation))

    def _entries(self, batch: RobotBatch, part: str) -> tuple[PerRobot, PerRobot, PerRobot]:
        matrix = self.part_matrix(batch, part, np.zeros(1))
        return matrix[..., 0, 0], matrix[..., 0, 3], matrix[..., 3, 3]


def _steps(robot: Robot, answers: Mapping[str, Prediction], friction: str) -> Iterator[Effect]:
    if LIGHTHILL not in answers or UNBOUNDED not in answers:
        return
    batch = RobotBatch.of(robot)
    rate = answers[UNBOUNDED].tail_rate
    rates = None if rate is None else np.array([rate])

    def apart(*, coupling: bool) -> float:
        model = _ApartFromEachOther(coupling=coupling)
        found = swim(batch, model, tail_rate=rates, friction=friction, calibrated=False)
        return float(found.forward_velocity[0])

    yield Effect("Lighthill's theory", answers[LIGHTHILL].forward_velocity)
    if robot.has_body:
        yield Effect("body and wire resolved", apart(coupling=False))
    if robot.has_body and robot.coupling.length > 0.0 and robot.coupling.diameter > 0.0:
        yield Effect("coupling", apart(coupling=True))
    whole = "interaction of the parts" if robot.has_body else "wire resolved"
    yield Effect(whole, answers[UNBOUNDED].forward_velocity)
    held = answers.get(WALLED)
    if held is None:
        return
    yield Effect("walls", held.forward_velocity)
    trial = held.trial
    if trial is None or trial.reason:
        return
    yield from _released(held, trial.values, friction)


RELEASED_EFFECT = "contact and motion in time"  #: The last effect, where there is a trial.


def _released(held: Prediction, trial: Mapping[str, float], friction: str) -> Iterator[Effect]:
    """From the held answer to the trial: held at the trial's mean pose, level and then yawed, and the trial."""
    pose = {name: trial[name] for name in ("gap", "pitch", "yaw")}
    for name, left_out in (("film at the pose of the trial", {"yaw": 0.0}), ("yaw", {})):
        placement = Placement.of({**pose, **left_out, "ends": held.batch.placement.ends})
        try:
            there = predict_steady(
                held.robot, model=WALLED, friction=friction, calibrated=held.calibrated, placement=placement, band=False
            )
        except InputError:  # nearer to the wall than the table answers for: part of the next step
            continue
        yield Effect(name, there.forward_velocity)
    yield Effect(RELEASED_EFFECT, trial["forward_velocity"])


_UNITS: dict[str, str] = {item.name: item.unit for item in STEADY}


@dataclass(frozen=True, repr=False)
class ModelComparison(DisplayMixin):
    """Steady swimming of one robot as each model predicts it, SI, rates signed about +x."""

    robot: Robot
    friction: FrictionModel  #: Friction model, the same for all models.
    models: tuple[str, ...]  #: Names of the models, in the order of the question.
    predictions: Mapping[str, Prediction]  #: Answers by model, in that order.
    refusals: Mapping[str, str]  #: Why a model does not answer, a sentence each.

    @cached_property
    def reference(self) -> str:
        """The reference model of the comparison.

        The last that puts a number on its own error, for such a model resolves what the others neglect; the first
        that answers where none does.
        """
        bounded = [name for name, answer in self.predictions.items() if estimated_error(answer) is not None]
        return bounded[-1] if bounded else next(iter(self.predictions))

    def relative_difference(self, model: str, name: str) -> float:
        """model/reference - 1 of a quantity; NaN where one of them has none, or the reference is zero.

        Args:
            model: a model that answers.
            name: a quantity, as in `Prediction`.

        Raises:
            InputError: for a model without an answer, or an unknown quantity.
        """
        if model not in self.predictions:
            raise InputError(f"model = {model!r} has no answer here; allowed: {', '.join(self.predictions)}")
        check_choice("quantity", name, _UNITS)
        value, base = (getattr(self.predictions[key], name) for key in (model, self.reference))
        return float(value / base - 1.0) if base != 0 else math.nan

    @cached_property
    def warnings(self) -> tuple[Note, ...]:
        """What to be careful about, a sentence each; one that holds for some models only names them."""
        count = len(self.predictions)
        models_of: dict[Note, list[str]] = {}
        for name, answer in self.predictions.items():
            for note in answer.warnings:
                models_of.setdefault(note, []).append(name)
        found = [
            note if len(names) == count else note.prefixed(f"{', '.join(names)}: ") for note, names in models_of.items()
        ]
        calibrated = [name for name, answer in self.predictions.items() if answer.calibrated]
        return (*uneven_models([self.robot], list(self.predictions), calibrated), *found)

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Speed after each effect, from Lighthill's theory to the trial.

        Empty without `sbt` and `slender`, or with calibration factors, which represent several effects at once.
        """
        if any(answer.calibrated for answer in self.predictions.values()):
            return ()
        return tuple(_steps(self.robot, self.predictions, self.friction))

    def to_dict(self) -> dict[str, Any]:
        """The answer of `spirillum compare-models --json`."""
        entries = {name: self._answered(name, answer) for name, answer in self.predictions.items()}
        entries |= {name: {"model": name, "answered": False, "reason": why} for name, why in self.refusals.items()}
        content = {
            "robot": self.robot.name,
            "friction": self.friction,
            "reference": self.reference,
            "models": [entries[name] for name in self.models],
            "effects": [{"effect": one.name, "forward_velocity": quantity(one.speed, "m/s")} for one in self.effects],
        }
        return envelope("model-comparison", content, self.warnings)

    def _display_content(self) -> tuple[dict[str, Any], None]:
        """See `DisplayMixin`: the quantities that matter most, model by model."""
        answer = self.to_dict()
        models = [item for item in answer["models"] if item["answered"]]
        short = [{"model": item["model"], **{name: item[name] for name in headline(item)}} for item in models]
        return {**answer, "models": short}, None

    def _answered(self, name: str, answer: Prediction) -> dict[str, Any]:
        """One model's prediction, without what stands once for all models."""
        left_out = ("schema", "robot", "friction", "notes", "warnings")
        return {
            "model": name,
            "title": answer.model.title,
            "answered": True,
            **{key: value for key, value in answer.to_dict(others=False).items() if key not in left_out},
            **({"trial": answer.trial.to_dict()} if answer.trial is not None else {}),
            "relative_difference": {key: quantity(self.relative_difference(name, key), "1") for key in _UNITS},
        }


def uneven_models(robots: Sequence[Robot], models: Sequence[str], calibrated: Sequence[str]) -> list[Note]:
    """What sets models apart besides their theory, a sentence each."""
    walled = [name for name in models if find_swimmer_model(name).placed]
    open_ = [name for name in models if name not in walled]
    bare = [name for name in open_ if name not in calibrated]
    turned = [name for name in models if "coupling" in find_swimmer_model(name).parts]
    without = [name for name in models if name not in turned]
    in_channel = any(robot.channel is not None for robot in robots)
    coupled = any(robot.coupling.length > 0 and robot.coupling.diameter > 0 for robot in robots)
    return [
        Note.named(name, some=", ".join(some), others=", ".join(others))
        for name, some, others, matters in (
            ("walls-in-some-models", walled, open_, in_channel),
            ("factors-of-some-models", calibrated, bare, True),
            ("coupling-in-some-models", turned, without, coupled),
        )
        if some and others and matters
    ]


def estimated_error(prediction: Prediction) -> float | None:
    """Relative error that a model estimates for its own speed; None where its error is stated in words only."""
    return prediction.error_estimate if math.isfinite(prediction.error_estimate) else None


def compare_models(
    robot: str | Path | Mapping[str, Any] | Robot,
    *,
    models: Sequence[str] | None = None,
    tail_rate: str | float | None = None,
    friction: str | None = None,
    calibrated: bool | None = None,
    calibration: str | Path | None = None,
    resolution: Resolution | Mapping[str, Any] | None = None,
    placement: Placement | Mapping[str, Any] | None = None,
    progress: Progress | None = None,
) -> ModelComparison:
    """Predict the steady swimming of one robot with several models; floats are in SI units, rates in rad/s.

    A model whose domain the robot leaves is listed with its reason; the others answer. All are held; beside `tube`
    stands what a trial measures (`trial`), or why there is none.

    Args:
        robot: a preset's name, a robot file, its tables, or a loaded robot.
        models: names of models; None: all that make a robot swim.
        tail_rate: lab rotation rate of the tail, with its unit (``"1.2 Hz"``) or a float in rad/s; without it
            the robot's drive decides, and the models differ in their rates too.
        friction: friction model, `none`, `rotor`, `body` or `paper`; None: the robot's own.
        calibrated: apply calibration factors, model by model; None: only those of a calibration file, for
            factors that represent walls in some models and not in others hide how the models differ.
        calibration: calibration file whose factors replace the robot's.
        resolution: of the models `slender` and `tube`: `accuracy`, `tolerance`, `phases`; None: the robot's own.
        placement: where in the channel the robot lies, for the models that compute the walls; as `predict`.
        progress: called with stage, number done, and total.

    Raises:
        InputError: for wrong input, or if no model answers.
    """
    requested = list(SWIMMER_MODELS) if models is None else [models] if isinstance(models, str) else list(models)
    if not requested:
        raise InputError(f"models = []; allowed: one or more of {', '.join(SWIMMER_MODELS)}")
    names = [find_swimmer_model(name).name for name in requested]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise InputError(f"model '{twice[0]}' is named twice; allowed: each model once")
    own = with_resolution(load(robot), resolution, *names)
    factors = calibration is not None if calibrated is None else calibrated
    fit = read_fit(calibration)
    ready = fit.central(own)
    reading = find_friction_model(ready.friction.reading if friction is None else friction)
    pose = Placement.of(placement)
    check_placement(pose, *(find_swimmer_model(name) for name in names))
    trial = TrialRequest(
        own,
        friction=reading,
        calibrated=factors,
        fit=fit,
        placement=pose,
        progress=progress,
    )
    predictions: dict[str, Prediction] = {}
    refusals: dict[str, str] = {}
    for done, name in enumerate(names):
        tell(progress, f"model {name}", done, len(names))
        placed = pose if find_swimmer_model(name).placed and pose != Placement() else None
        try:
            held = predict_steady(
                own,
                model=name,
                tail_rate=tail_rate,
                friction=reading,
                calibrated=factors,
                fit=fit,
                placement=placed,
                band=False,
                progress=progress,
            )
            predictions[name] = (
                trial.add_released_motions(held, wanted=True) if find_swimmer_model(name).placed else held
            )
        except InputError as error:
            refusals[name] = str(error)
    if not predictions:
        reasons = tuple(dict.fromkeys(refusals.values()))  # an error common to all models is stated once
        raise (
            InputError(reasons[0])
            if len(reasons) == 1
            else InputError(f"no model answers: {'; '.join(reasons)}", reasons)
        )
    return ModelComparison(ready, reading, tuple(names), predictions, refusals)
