"""The models by name."""

from __future__ import annotations

from spirillum.errors import InputError, check_choice, did_you_mean
from spirillum.fluid.closed.perrin import Perrin
from spirillum.fluid.closed.rft import Rft
from spirillum.fluid.closed.sbt import Sbt
from spirillum.fluid.model import ResistanceModel, SwimmerModel
from spirillum.fluid.tube.tube import Tube
from spirillum.fluid.wire.slender import Slender
from spirillum.robot.batch import RobotBatch
from spirillum.robot.fields import field_values
from spirillum.robot.placement import Placement

SWIMMER_MODELS: dict[str, SwimmerModel] = {model.name: model for model in (Sbt(), Rft(), Slender(), Tube())}
"""Models that make a robot swim."""
MODELS: dict[str, ResistanceModel] = {**SWIMMER_MODELS, "perrin": Perrin()}  #: Models that give a resistance matrix.


def find_model(name: str) -> ResistanceModel:
    """The model of that name."""
    check_choice("model", str(name), MODELS)
    return MODELS[name]


def find_swimmer_model(name: str, *more: str) -> SwimmerModel:
    """The model of that name that makes a robot swim."""
    if str(name) not in SWIMMER_MODELS:
        allowed = [*more, *SWIMMER_MODELS]
        raise InputError(f"model = {name!r}{did_you_mean(str(name), allowed)}; allowed: {', '.join(allowed)}")
    return SWIMMER_MODELS[name]


def quickest(model: SwimmerModel, batch: RobotBatch) -> SwimmerModel:
    """Return the fastest variant of a model: `tube` from tables where available, unless a resolution is requested."""
    options = batch.options.tube
    if not isinstance(model, Tube) or options.form == "direct":
        return model
    from spirillum.fluid.tube.library import tabled

    resolved = batch.options.resolution
    if resolved and options.form == "table":
        allowed = "allowed: form 'direct' or 'auto'"
        raise InputError(f"{resolved} with model.tube.form = 'table', which has its own resolution; {allowed}")
    found = None if resolved else tabled(batch)
    if found is None and options.form == "table":
        raise InputError(
            "model.tube.form = 'table': no table of this robot in this tube covers this pose; "
            "allowed: 'direct', or after `spirillum prepare`"
        )
    return found or model


def check_placement(placement: Placement, *models: ResistanceModel) -> None:
    """Refuse a placement in the channel that none of the models uses."""
    if not placement.is_set or any(model.placed for model in models):
        return
    unset = type(placement)()
    given = next(item for item in field_values(placement) if item.value != getattr(unset, item.path))
    names = " or ".join(f"'{model.name}'" for model in models)
    walled = ", ".join(name for name, model in MODELS.items() if model.placed)
    raise InputError(
        f"placement.{given.path} = {given.text} with model {names}, which does not compute the channel's walls; "
        f"allowed: {f'only with model {walled}' if walled else 'no placement'}"
    )
