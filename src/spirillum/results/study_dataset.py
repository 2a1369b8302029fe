"""A study as people read it: its ranking, before the variables of its dataset."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import numpy as np
import xarray as xr

from spirillum.errors import InputError
from spirillum.notes import notes_in
from spirillum.results.study_content import shown_ranking
from spirillum.studies.ranking import can_be_ranked, ranking_of

_SIZES = ("channel_diameter", "wavelength", "amplitude")
"""Sizes that identify the robots of a study."""


# xarray leaves __init_subclass__ without types.
class StudyDataset(xr.Dataset):  # type: ignore[no-untyped-call]
    """A study's dataset that shows its ranking to `print` and to notebooks; else as any dataset of xarray."""

    __slots__ = ()

    @classmethod
    def of(cls, dataset: xr.Dataset) -> StudyDataset:
        """A study's values, coordinates and attributes in a dataset that shows its ranking."""
        return cls(dataset.data_vars, dataset.coords, dataset.attrs)

    def unstacked(self) -> xr.Dataset:
        """The study over `wavelength` and `amplitude`, and `channel_diameter` if it varies, in place of `robot`.

        A study of a grid has these dimensions already. The robots' names become the variable `robot_name`.

        Raises:
            InputError: if the robots are not all combinations of these sizes.
        """
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
        shown = shown_ranking(ranking_of(self))
        rows = [shown["header"], *shown["rows"]]
        widths = [max(len(row[column]) for row in rows) for column in range(len(shown["header"]))]
        lines = [f"{self.attrs.get('title', 'Study')}: {shown['message']}", f"  {shown['basis']}"]
        lines += [_line(row, widths) for row in rows]
        lines += [f"  and {shown['more']} more"] if shown["more"] else []
        sizes = ", ".join(f"{name} {size}" for name, size in self.sizes.items())
        dataset = f"dataset: {len(self.data_vars)} variables over {sizes}; list(study), study.info()"
        return "\n".join([*lines, *shown["best"], dataset, *self._warnings()])

    def _repr_html_(self) -> str:
        """The ranking as a table, then the dataset as xarray shows it."""
        if not can_be_ranked(self):
            return str(super()._repr_html_())
        shown = shown_ranking(ranking_of(self))
        head = "".join(f"<th>{escape(name)}</th>" for name in shown["header"])
        cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in shown["rows"])
        body = "".join(f"<tr>{row}</tr>" for row in cells)
        caption = f"<caption>{escape(shown['message'])}; {escape(shown['basis'])}</caption>"
        said = "".join(f"<p>{escape(line)}</p>" for line in (*shown["best"], *self._warnings()))
        table = f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
        return f"{table}{said}{super()._repr_html_()}"

    def _warnings(self) -> Iterator[str]:
        return (f"{note.severity}: {note}" for note in notes_in(self.attrs))


def _line(row: list[str], widths: list[int]) -> str:
    cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
    return f"  {'  '.join(cells)}".rstrip()
