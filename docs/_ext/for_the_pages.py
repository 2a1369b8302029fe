"""What the pages need beyond Markdown: the reference of every module, formulas without a network, tidy docstrings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.statemachine import StringList
from latex2mathml.converter import convert
from pydantic import BaseModel
from sphinx.application import Sphinx
from sphinx.domains.python import ObjectEntry, PythonDomain
from sphinx.environment import BuildEnvironment
from sphinx.util.docutils import SphinxDirective

_NAME = re.compile(r"`(spirillum(?:\.\w+){2,})`")


def _linked_names(_app: Sphinx, _page: str, source: list[str]) -> None:
    """Names of modules, classes and functions become links to their reference; the page itself stays plain Markdown."""
    source[0] = _NAME.sub(r"{py:obj}`\1`", source[0])


def _mathml(text: str, display: str = "inline") -> str:
    """A formula as MathML; lines that are aligned stand in an array, which the converter knows."""
    text = text.replace(r"\begin{aligned}", r"\begin{array}{rl}").replace(r"\end{aligned}", r"\end{array}")
    found: str = convert(text, display=display)
    return found


def _inline_formula(self: Any, node: nodes.math) -> None:
    self.body.append(_mathml(node.astext()))
    raise nodes.SkipNode


def _formula(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{_mathml(node.astext(), "block")}</div>')
    raise nodes.SkipNode


_BARS = re.compile(r"(?<![\w`|])\|([^|\s`](?:[^|`\n]*[^|\s`])?)\|(?![\w`])")
_AS_WRITTEN: dict[str, list[str]] = {}


def _before_napoleon(_app: Sphinx, what: str, name: str, _obj: object, _options: Any, lines: list[str]) -> None:
    """Absolute values: `|I|` would be a substitution in reStructuredText. Keep what napoleon would misread."""
    lines[:] = [_BARS.sub(r"\\|\1\\|", line) for line in lines]
    if what in ("attribute", "data", "property"):
        _AS_WRITTEN[name] = list(lines)


def _after_napoleon(_app: Sphinx, _what: str, name: str, _obj: object, _options: Any, lines: list[str]) -> None:
    """Napoleon takes what stands before a colon in an attribute's docstring for its type: undo that."""
    if name in _AS_WRITTEN:
        lines[:] = _AS_WRITTEN.pop(name)
    if lines and lines[0].startswith("Alias for field number"):  # what Python says of a NamedTuple's fields
        lines.clear()


def _short_signature(
    _app: Sphinx, what: str, _name: str, obj: object, _options: Any, _signature: str | None, _returns: str | None
) -> tuple[str, None] | None:
    """A table of the robot file is made by `load`; its fields stand below, with their types."""
    return ("", None) if what == "class" and isinstance(obj, type) and issubclass(obj, BaseModel) else None


class Room(SphinxDirective):
    """`room NAME`: the reference of every module of a room, so that none can be forgotten."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {}

    def run(self) -> list[nodes.Node]:
        import spirillum

        base = Path(spirillum.__file__).parent
        place = base / self.arguments[0]
        found = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
        lines: list[str] = []
        for path in found:
            if path.stem != "__init__":
                module = ".".join(("spirillum", *path.relative_to(base).with_suffix("").parts))
                lines += [f"## `{module}`", "", "```{eval-rst}", f".. automodule:: {module}", "```", ""]
        section = nodes.section()
        section.document = self.state.document
        self.state.nested_parse(StringList(lines), self.content_offset, section, match_titles=True)
        return section.children


class IndexedPythonDomain(PythonDomain):
    """Remembers what was found for a name: Sphinx compares it with the end of every name of the project, each time."""

    _remembered: ClassVar[dict[tuple[str, str | None, int], list[tuple[str, ObjectEntry]]]] = {}

    def find_obj(
        self,
        env: BuildEnvironment,
        modname: str | None,
        classname: str | None,
        name: str,
        type: str | None,  # noqa: A002 - Sphinx calls it so
        searchmode: int = 0,
    ) -> list[tuple[str, ObjectEntry]]:
        """Objects of a name; what lies nearer than anywhere in the project is not remembered."""
        nearer = (f"{modname}.{classname}.{name}", f"{modname}.{name}")
        if searchmode == 0 or any(place in self.objects for place in nearer):
            return super().find_obj(env, modname, classname, name, type, searchmode)
        key = (name, type, len(self.objects))
        if key not in self._remembered:
            self._remembered[key] = super().find_obj(env, None, None, name, type, searchmode)
        return list(self._remembered[key])


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive, the hooks and the formulas, which every browser draws by itself (MathML)."""
    app.add_domain(IndexedPythonDomain, override=True)
    app.add_directive("room", Room)
    app.add_html_math_renderer("mathml", (_inline_formula, None), (_formula, None))
    app.connect("source-read", _linked_names)
    app.connect("autodoc-process-signature", _short_signature)
    app.connect("autodoc-process-docstring", _before_napoleon, priority=400)
    app.connect("autodoc-process-docstring", _after_napoleon, priority=600)
    return {"version": "1", "parallel_read_safe": False, "parallel_write_safe": True}
