"""Common style of all figures: colours, fonts, units, reproducible files."""

from __future__ import annotations

import re
import unicodedata
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
from matplotlib import rc_context, rc_params_from_file, rcParamsDefault
from matplotlib.backends.backend_agg import FigureCanvasAgg, RendererAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine

from spirillum.arrays import Values
from spirillum.files import MARK, atomic_write, written_by_us
from spirillum.units import for_people, shown_in

COLOURS = {
    "black": "#000000",
    "orange": "#E69F00",
    "sky": "#56B4E9",
    "green": "#009E73",
    "blue": "#0072B2",
    "vermillion": "#D55E00",
    "purple": "#CC79A7",
}
"""Palette of Okabe and Ito, distinguishable for colour-blind readers (without its yellow, too pale for lines)."""

COLUMN, PAGE = 3.35, 6.69  #: Width of a column and of a page of a journal, inches: 85 and 170 mm. No figure is wider.
_OTHERS = ("backend", "backend_fallback", "interactive", "toolbar", "timezone")
"""Settings on the display of a session's own figures, which do not change ours."""
PATCH: Any = {"linewidth": 7, "solid_capstyle": "butt"}  #: Line that represents an area in a legend.
WHITE_BOX: Any = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.0}  #: Box behind text on lines.
DPI = 200  #: Of PNG files.
_NO_DATE: dict[str, dict[str, Any]] = {"png": {"Software": MARK}, "pdf": {"CreationDate": None}, "svg": {"Date": None}}
_FORMULA = re.compile(r"(?<!\\)\$(.*?)(?<!\\)\$")
_MICRO = re.compile(r"(\d )u(?=[mNWgl]\b)")
_LETTERS = {r"\omega": "ω", r"\lambda": "λ", r"\mu": "μ", r"\rho": "ρ", r"\pi": "π", r"\Omega": "Ω", r"\,": " "}
_WITHOUT_PREFIX = ("rad/s", "rad", "1", "%")
_PREFIXES = (
    (1e-18, "a"),
    (1e-15, "f"),
    (1e-12, "p"),
    (1e-9, "n"),
    (1e-6, "µ"),
    (1e-3, "m"),
    (1.0, ""),
    (1e3, "k"),
    (1e6, "M"),
)


@dataclass(frozen=True)
class Look:
    """Colour, line and marker that identify a model in every figure."""

    colour: str
    line: Any  #: A line style of matplotlib: text, or an offset with lengths of dashes.
    marker: str


_LOOKS = {
    "sbt": Look(COLOURS["blue"], "-", "o"),
    "rft": Look(COLOURS["vermillion"], "--", "s"),
    "slender": Look(COLOURS["green"], "-.", "^"),
    "tube": Look(COLOURS["purple"], ":", "D"),
}
_OTHER = Look(COLOURS["orange"], (0, (5, 1, 1, 1, 1, 1)), "v")


def look_of_model(name: str) -> Look:
    """The style of a model by its name."""
    return _LOOKS.get(name, _OTHER)


@dataclass(frozen=True)
class UnitPrefix:
    """A unit with a prefix that makes a set of values readable."""

    factor: float  #: SI value of one unit.
    unit: str

    @classmethod
    def of(cls, values: Values, unit: str) -> UnitPrefix:
        """Unit for SI `values`, with a prefix by which the largest is between 0.1 and 100, if possible."""
        # Rates are shown in Hz, angles in degrees, shares as they are: none of them with a prefix.
        if unit in _WITHOUT_PREFIX:
            shown = for_people(unit)
            return cls(1.0 / shown_in(1.0, shown) if shown != unit else 1.0, shown)
        finite = np.abs(values[np.isfinite(values)])
        largest = float(finite.max()) if finite.size else 0.0
        if largest == 0.0:
            return cls(1.0, unit)
        fitting = [(factor, prefix) for factor, prefix in _PREFIXES if largest >= 0.099 * factor]
        factor, prefix = fitting[-1] if fitting else _PREFIXES[0]
        return cls(factor, f"{prefix}{unit}")

    def __call__(self, values: Values) -> Values:
        """SI values in this unit."""
        return values / self.factor


def in_words(value: float, unit: str, digits: int = 4) -> str:
    """An SI value with a unit whose prefix makes it readable."""
    scale = UnitPrefix.of(np.array([value]), unit)
    return f"{value / scale.factor:.{digits}g} {scale.unit}"


@lru_cache(maxsize=1)
def _settings() -> dict[Any, Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of settings that the library means to drop
        own: dict[Any, Any] = {name: value for name, value in rcParamsDefault.items() if name not in _OTHERS}
    own.update(rc_params_from_file(Path(__file__).with_name("spirillum.mplstyle"), use_default_template=False))
    return own


@contextmanager
def styled() -> Iterator[None]:
    """Plot and save in the style of all figures, without changing the user's settings."""
    # All that this module does not set is as matplotlib comes, not as a `matplotlibrc` or a session has it. Names may
    # hold characters that the font lacks; they become boxes, not warnings.
    with rc_context(_settings()), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=r"Glyph .* missing from", category=UserWarning)
        yield


_PARSER: list[Any] = []  # of formulas, that of the first renderer, which keeps what it has parsed


class _Canvas(FigureCanvasAgg):
    """A canvas whose renderers share one parser: each has its own, and parses the formulas of a figure once more."""

    def get_renderer(self) -> RendererAgg:
        """Return the renderer of the figure's present size and resolution."""
        renderer: RendererAgg = super().get_renderer()  # type: ignore[no-untyped-call]
        if not _PARSER:
            _PARSER.append(renderer.mathtext_parser)
        renderer.mathtext_parser = _PARSER[0]
        return renderer


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, inches, outside pyplot's global state."""
    figure = Figure(figsize=(width, height))
    _Canvas(figure)
    return figure


def lay_out(figure: Figure) -> None:
    """Lay out panels and text of a figure with a layout engine, without rendering."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)


def plain(text: str, longest: int = 60) -> str:
    """A user's text as one short line without formulas."""
    kept = "".join(letter if unicodedata.category(letter)[0] != "C" else " " for letter in text)
    line = " ".join(kept.split())
    line = line if len(line) <= longest else f"{line[: longest - 1]}…"
    return line.replace("$", r"\$")


def distinct_labels(names: Sequence[str], longest: int) -> list[str]:
    """Shorten names to lines of at most ``longest`` letters, or of at most 80 where they would be equal."""
    short = [plain(name, longest) for name in names]
    return short if len(set(short)) == len(set(names)) else [plain(name, 80) for name in names]


def readable(text: str) -> str:
    """A figure's text with its formulas spelled out: ``$B_{eff}$`` becomes ``B_eff``."""
    spelled = _FORMULA.sub(lambda found: _spelled(found[1]), text)
    return " ".join(spelled.replace(r"\$", "$").split())


def with_micro(text: str) -> str:
    """A figure's text with the micro sign of its axes: ``0.9 um`` becomes ``0.9 µm``."""
    return _MICRO.sub(r"\1µ", text)


def _spelled(formula: str) -> str:
    for command, letter in _LETTERS.items():
        formula = formula.replace(command, letter)
    return re.sub(r"[{}]", "", formula)


def save(figure: Figure, path_without_suffix: Path, *, vector: bool = False) -> list[Path]:
    """Write a PNG (200 dpi) and, if requested, an SVG (text as paths, no date), each whole; give their paths."""
    # An SVG of an earlier figure beside a PNG of this one is removed.
    folder, name = path_without_suffix.parent, path_without_suffix.name
    png, svg = folder / f"{name}.png", folder / f"{name}.svg"
    engine, dpi = figure.get_layout_engine(), figure.dpi
    if engine is not None and not isinstance(engine, PlaceHolderLayoutEngine):
        figure.dpi = DPI
        with styled():
            engine.execute(figure)  # once: else it takes a drawing of its own before each file
        figure.dpi = dpi
        figure.set_layout_engine("none")
    save_as(figure, png)
    if vector:
        save_as(figure, svg)
    else:
        _drop_earlier(svg)
    figure.set_layout_engine(engine)
    return [png, svg] if vector else [png]


def save_drawn(files: Sequence[Path], folder: Path) -> list[Path]:
    """Write files of one figure that `save` has written elsewhere as it would have written them into a folder."""
    for file in files:
        with atomic_write(folder / file.name) as temporary:
            copyfile(file, temporary)
    if all(file.suffix != ".svg" for file in files):
        _drop_earlier(folder / f"{files[0].stem}.svg")
    return [folder / file.name for file in files]


def _drop_earlier(svg: Path) -> None:
    if svg.is_file() and written_by_us(svg):
        svg.unlink()


def save_as(figure: Figure, path: Path) -> None:
    """Write one picture whole or not at all, without dates: PNG (200 dpi), PDF or SVG (text as paths)."""
    kind = path.suffix.lower().removeprefix(".")
    if isinstance(figure.get_layout_engine(), PlaceHolderLayoutEngine):  # what `tight_layout` leaves behind
        figure.set_layout_engine(None)  # else the layout is computed once more before it is drawn
    with styled(), atomic_write(path) as temporary:
        figure.savefig(temporary, format=kind, dpi=DPI, metadata=_NO_DATE[kind])
