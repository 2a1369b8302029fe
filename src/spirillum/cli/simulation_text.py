"""What `spirillum simulate` and `spirillum magnetic-sweep` answer, for machines and for people."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape

from spirillum.answer import envelope, quantity
from spirillum.cli.text import Answer, add_quantities, grid, show_error
from spirillum.units import in_unit

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["simulation", "simulation_answer", "sweep", "sweep_answer"]

_ENDS = (
    "position",
    "tail_angle",
    "body_angle",
    "pitch",
    "yaw",
    "wall_gap",
    "wobble_angle",
    "phase_lag",
    "electrical_energy",
    "battery_charge_used",
)
_COLUMNS = {
    "field_rate": ("field", "Hz"),
    "tail_rotation_rate": ("tail", "Hz"),
    "forward_velocity": ("speed", "mm/s"),
    "wobble_angle": ("wobble", "deg"),
    "phase_lag": ("lag", "deg"),
}


def _warnings(dataset: xr.Dataset) -> list[str]:
    return [line for line in dataset.attrs["warnings"].split("\n") if line]


def simulation_answer(dataset: xr.Dataset, output: Path, more: Mapping[str, Any]) -> dict[str, Any]:
    """Averages over the last two thirds, the end of the run, and what happened in it.

    Args:
        dataset: the run.
        output: its file.
        more: other files that were written, by what they are, and `film_warnings`.
    """
    written = {name: item for name, item in more.items() if name != "film_warnings"}
    last = dataset.isel(time=-1)
    content: dict[str, Any] = {
        "robot": dataset.attrs["robot"],
        "model": dataset.attrs["model"],
        "friction": dataset.attrs["friction"],
        "motion": dataset.attrs["motion"],
        "error_estimate": quantity(float(dataset.attrs["error_estimate"]), "1", statement=dataset.attrs["known_error"]),
        "file": str(output),
        **written,
        "events": json.loads(dataset.attrs["events"]),
        "duration": quantity(float(last["time"]), "s"),
    }
    scalars = [str(name) for name, variable in dataset.data_vars.items() if variable.ndim == 0]
    content |= {name: quantity(float(dataset[name]), str(dataset[name].attrs["units"])) for name in scalars}
    content |= {
        f"final_{name}": quantity(last[name].values.tolist(), str(last[name].attrs["units"]))
        for name in _ENDS
        if name in dataset
    }
    return envelope("simulation", content, [*_warnings(dataset), *more.get("film_warnings", ())])


def simulation(answer: Answer, console: Console) -> None:
    """Table of `simulate`."""
    title = f"{answer['robot']}: model {answer['model']}, friction {answer['friction']}, {answer['motion']} motion"
    table = grid(title, "quantity", "value", "unit", "SI")
    add_quantities(table, dict(_rows(answer)))
    console.print(table)
    for event in answer["events"]:
        console.print(f"{event['time']:.4g} s: {escape(event['what'])}", highlight=False)
    show_error(answer["error_estimate"], console)
    console.print("means are over the last two thirds of the run", highlight=False)
    for name in ("plot", "movie"):
        if name in answer:
            console.print(f"{name} in {escape(answer[name])}", highlight=False, soft_wrap=True)
    console.print(f"trajectory in {escape(answer['file'])}", highlight=False, soft_wrap=True)


def _rows(answer: Answer) -> list[tuple[str, Any]]:
    """Quantities of the answer, vectors by their parts."""
    found: list[tuple[str, Any]] = []
    for name, item in answer.items():
        if name == "error_estimate" or not isinstance(item, Mapping) or "unit" not in item:
            continue
        if isinstance(item["value"], list):
            parts = zip("xyz", item["value"], strict=True)
            found += [(f"{name} {part}", quantity(value, item["unit"])) for part, value in parts]
        else:
            found.append((name, item))
    return found


def sweep_answer(dataset: xr.Dataset, output: Path, plot: Path | None) -> dict[str, Any]:
    """Every quantity of a sweep as a list over the rates of the field."""
    content: dict[str, Any] = {
        "robot": dataset.attrs["robot"],
        "model": dataset.attrs["model"],
        "file": str(output),
        **({} if plot is None else {"plot": str(plot)}),
        "step_out_rate": quantity(float(dataset["step_out_rate"]), "rad/s"),
        "field_rate": quantity(dataset["field_rate"].values, "rad/s"),
    }
    content |= {
        str(name): quantity(variable.values, str(variable.attrs["units"]))
        for name, variable in dataset.data_vars.items()
        if variable.ndim == 1
    }
    return envelope("magnetic-sweep", content, _warnings(dataset))


def sweep(answer: Answer, console: Console) -> None:
    """Table of `magnetic-sweep`."""
    title = f"{answer['robot']}: rotating field, model {answer['model']}, free motion"
    table = grid(title, *(f"{word}, {unit}" for word, unit in _COLUMNS.values()))
    columns = [(answer[name], unit) for name, (_, unit) in _COLUMNS.items()]
    for row in range(len(answer["field_rate"]["value"])):
        table.add_row(*(in_unit(item["value"][row], item["unit"], unit) for item, unit in columns))
    console.print(table)
    step_out = in_unit(answer["step_out_rate"]["value"], "rad/s", "Hz")
    console.print(f"step-out of the held robot at {step_out} Hz; no lag where the robot slips", highlight=False)
    if "plot" in answer:
        console.print(f"plot in {escape(answer['plot'])}", highlight=False, soft_wrap=True)
    console.print(f"sweep in {escape(answer['file'])}", highlight=False, soft_wrap=True)
