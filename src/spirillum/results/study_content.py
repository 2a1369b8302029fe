"""A study as people read it: the content of its report besides pictures and claims, and its ranking."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import numpy as np
import xarray as xr

from spirillum.citations import REFERENCES
from spirillum.display import counted
from spirillum.errors import InputError
from spirillum.fluid.registry import SWIMMER_MODELS
from spirillum.notes import notes_in
from spirillum.robot.model_options import ModelOptions, RftOptions, SlenderOptions, TubeOptions
from spirillum.studies.ranking import (
    ENDS,
    Best,
    StudyRanking,
    best_in_words,
    can_be_ranked,
    order_in_words,
    ranked_columns,
    ranking_of,
    unit_of_ranked,
)
from spirillum.units import in_unit

FRICTION_MEANINGS = {
    "none": "no friction: the tail turns against the fluid alone, so that rates and speeds are upper bounds",
    "rotor": "B_eff acts inside the joint, which gives (18); the body feels the tail's hydrodynamic torque only",
    "body": "the channel's wall brakes the body's rotation; (18) alone cannot find how much",
    "paper": "as (19) is printed: B_eff brakes the tail from outside, and the body feels the whole motor torque",
}
"""A line of meaning for each friction model."""

MOST_RANKED = 10
MOST_CALIBRATIONS = 40
MOST_WARNINGS = 100


def ranking_content(ranking: StudyRanking, most: int = MOST_RANKED) -> dict[str, Any]:
    """The ranking as people read it: what it rests on, the best robots, a row for each of the first."""
    robots = ranking.to_dict()["robots"]
    columns = [
        column for name in ranking.quantities for column in ranked_columns(robots, name, ranking.model, wide=True)
    ]
    return {
        "message": ranking.message,
        "basis": f"model {ranking.model}, friction {ranking.friction}"
        + (", the channel's walls not computed" if ranking.walls else "")
        + (f"; {ranking.basis}" if ranking.basis else ""),
        "first": order_in_words(ranking.lead, held=ranking.held).capitalize(),
        "ends": ENDS.get(ranking.kind, ""),
        "best": [best_in_words(best.to_dict(), _size(best, ranking), held=ranking.held) for best in ranking.best],
        "header": ["robot", *(title for title, _ in columns)],
        "rows": [[one["robot"], *(cells[n] for _, cells in columns)] for n, one in enumerate(robots[:most])],
        "more": max(len(ranking.robots) - most, 0),
    }


def _size(best: Best, ranking: StudyRanking) -> str:
    """The value of the best robot, in the unit of its column."""
    value, unit, shown = best.robot.values[best.quantity], unit_of_ranked(best.quantity), ranking.unit(best.quantity)
    return f"{in_unit(value, unit, shown)} {shown}".removesuffix(" 1")


def content(dataset: xr.Dataset) -> dict[str, Any]:
    """The names that the page's template uses."""
    attributes = dataset.attrs
    settings = json.loads(attributes.get("settings", "{}"))
    robots = settings.get("robots", [])
    models = [str(name) for name in dataset["model"].values]
    readings = [str(name) for name in dataset["friction"].values]
    calibrations = list(_calibrations(robots, models))
    warnings = notes_in(attributes)
    keys = str(attributes.get("references", "")).split()
    return {
        "title": str(attributes.get("title", "Study")),
        "note": str(attributes.get("note", "")),
        "observations": str(attributes["observations"]) if "observed_forward_velocity" in dataset else None,
        "size": _question(dataset),
        "models": [(name, _known_errors(name, robots)) for name in models],
        "readings": [(name, FRICTION_MEANINGS.get(name, "")) for name in readings],
        "calibrations": calibrations[:MOST_CALIBRATIONS],
        "more_calibrations": max(len(calibrations) - MOST_CALIBRATIONS, 0),
        "warnings": warnings[:MOST_WARNINGS],
        "more_warnings": max(len(warnings) - MOST_WARNINGS, 0),
        "versions": str(attributes.get("versions", "")),
        "fingerprint": str(attributes.get("fingerprint", "")),
        "references": [(key, REFERENCES[key]) for key in keys if key in REFERENCES],
        "code": _code(models[0], readings[0]),
    }


def _question(dataset: xr.Dataset) -> str:
    """The question of the study in a line."""
    sizes = dataset.sizes
    if "channel" in sizes:
        found = [counted(sizes[name], name) for name in ("channel", "wavelength", "amplitude")]
    else:
        found = [counted(sizes["robot"], "robot")]
    found += [counted(sizes["model"], "model"), counted(sizes["friction"], "friction model")]
    if "assumed_motor_rate" in sizes:
        found.append(counted(sizes["assumed_motor_rate"], "assumed motor rate"))
    return " × ".join(found)


def _known_errors(name: str, robots: list[Mapping[str, Any]]) -> str:
    """Known error of a model with the options of the robots."""
    known = SWIMMER_MODELS.get(name)
    if known is None:
        return ""
    options = [_options(robot.get("model", {})) for robot in robots] or [ModelOptions()]
    return "; or ".join(dict.fromkeys(known.stated_error(option) for option in options))


def _options(table: Mapping[str, Any]) -> ModelOptions:
    """Options as a robot has stored them: checked when it was loaded."""
    return ModelOptions.model_construct(
        rft=RftOptions.model_construct(**table.get("rft", {})),
        slender=SlenderOptions.model_construct(**table.get("slender", {})),
        tube=TubeOptions.model_construct(**table.get("tube", {})),
    )


def _calibrations(robots: list[Mapping[str, Any]], models: list[str]) -> Iterator[dict[str, str]]:
    for robot in robots:
        for model in models:
            entry = (robot.get("calibration") or {}).get(model)
            yield {
                "robot": str(robot.get("name", "")),
                "model": model,
                "drag": f"{entry['body_drag']:g}" if entry else "1",
                "rotation": f"{entry['body_rotation']:g}" if entry else "1",
                "source": str(entry["source"]) if entry else "none",
            }


def _code(model: str, reading: str) -> str:
    """Three lines of Python that open the dataset."""
    return (
        "import xarray as xr\n"
        'ds = xr.open_dataset("dataset.nc", engine="h5netcdf")\n'
        f'print(ds["forward_velocity"].sel(model="{model}", friction="{reading}"))  # m/s'
    )


_SIZES = ("channel_diameter", "wavelength", "amplitude")  # sizes that identify the robots of a study


# xarray leaves __init_subclass__ without types.
class StudyDataset(xr.Dataset):  # type: ignore[no-untyped-call]
    """A study's dataset that shows its ranking to `print` and to notebooks; else as any dataset of xarray."""

    __slots__ = ()

    @classmethod
    def of(cls, dataset: xr.Dataset) -> StudyDataset:
        """A study's values, coordinates and attributes in a dataset that shows its ranking."""
        return cls(dataset.data_vars, dataset.coords, dataset.attrs)

    def unstacked(self) -> xr.Dataset:
        """The study over `wavelength` and `amplitude`, and `channel_diameter` if it varies, in place of `robot`."""
        # A study of a grid has these dimensions already. The robots' names become the variable `robot_name`.
        if "robot" not in self.dims:
            return self
        sizes = {name: np.unique(self[name].values) for name in _SIZES}
        varied = [name for name, values in sizes.items() if values.size > 1] or ["wavelength"]
        if int(np.prod([values.size for values in sizes.values()])) != self.sizes["robot"]:
            counts = ", ".join(f"{values.size} of {name}" for name, values in sizes.items())
            raise InputError(
                f"the study's {self.sizes['robot']} robots are not all combinations of their sizes ({counts}); "
                "allowed: robots that are a product of channels, wavelengths and amplitudes"
            )
        named = (
            xr.Dataset(self.data_vars, self.coords, self.attrs)
            .assign(robot_name=("robot", self["robot"].values))
            .drop_vars("robot")
        )
        return named.set_index(robot=varied).unstack("robot")

    def __str__(self) -> str:
        """The ranking and the warnings, or what xarray prints where nothing can be ranked."""
        if not can_be_ranked(self):
            return super().__str__()
        shown = ranking_content(ranking_of(self))
        rows = [shown["header"], *shown["rows"]]
        widths = [max(len(row[column]) for row in rows) for column in range(len(shown["header"]))]
        lines = [f"{self.attrs.get('title', 'Study')}: {shown['message']}", f"  {shown['basis']}"]
        for row in rows:
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            lines.append(f"  {'  '.join(cells)}".rstrip())
        lines += [f"  and {shown['more']} more"] if shown["more"] else []
        sizes = ", ".join(f"{name} {size}" for name, size in self.sizes.items())
        dataset = f"dataset: {len(self.data_vars)} variables over {sizes}; list(study), study.info()"
        return "\n".join([*lines, *shown["best"], dataset, *self._warnings()])

    def _repr_html_(self) -> str:
        """The ranking as a table, then the dataset as xarray shows it."""
        if not can_be_ranked(self):
            return str(super()._repr_html_())
        shown = ranking_content(ranking_of(self))
        head = "".join(f"<th>{escape(name)}</th>" for name in shown["header"])
        cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in shown["rows"])
        body = "".join(f"<tr>{row}</tr>" for row in cells)
        caption = f"<caption>{escape(shown['message'])}; {escape(shown['basis'])}</caption>"
        said = "".join(f"<p>{escape(line)}</p>" for line in (*shown["best"], *self._warnings()))
        table = f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"{table}{said}{super()._repr_html_()}"

    def _warnings(self) -> Iterator[str]:
        return (f"{note.severity}: {note}" for note in notes_in(self.attrs))
