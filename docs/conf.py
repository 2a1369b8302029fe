"""How the documentation is built: `sphinx-build -W --keep-going -b html docs docs/_build/html`."""

from __future__ import annotations

import gc
import logging
import os
import sys
from pathlib import Path
from typing import Annotated, get_origin

sys.path.insert(0, str(Path(__file__).parent / "_ext"))
os.environ.setdefault("MPLBACKEND", "Agg")

import jaxtyping  # noqa: F401 - shapes of arrays are then read as such
from sphinx.pycode.parser import Parser

from spirillum import __version__, arrays
from spirillum.robot import fields as robot_fields

# Trees of all pages live until the end: a third of the time would go into looking for cycles in them.
gc.freeze()
gc.set_threshold(200_000, 50, 100)

project = "spirillum"
author = "The Spirillum developers"
copyright = author
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "for_the_pages",
]
smartquotes = not tags.has("check")  # noqa: F821 - Sphinx gives it
if smartquotes:
    extensions.append("sphinx.ext.viewcode")
else:  # listings take longest; none of these can hold a warning
    logging.disable(logging.DEBUG)
    autodoc_typehints = "none"  # types in signatures, which nobody reads here: a quarter of the time
    Parser.parse_definition = lambda _self: None  # lines of definitions are for listings, and take a fifth of the time
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]

myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

root_doc = "contents"
html_math_renderer = "mathml"
html_theme = "furo"
html_title = "spirillum"
html_static_path = ["_static"]
html_css_files = ["spirillum.css"]
html_show_copyright = False
html_show_sphinx = False

suppress_warnings = ["ref.python"]  # two rooms may have a class of the same name
default_role = "code"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": False, "exclude-members": "model_config"}
autodoc_typehints_format = "short"
autodoc_use_type_comments = False  # the sources would be parsed function by function for what none of them has
_FIELD_TYPES = [name for name, value in vars(robot_fields).items() if get_origin(value) is Annotated]
autodoc_type_aliases = {name: name for name in (*arrays.__annotations__, *_FIELD_TYPES, "Switch", "Taper")}
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
viewcode_line_numbers = True

# Types of other packages, and private or generic ones, which have no page here.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|np|npt|xarray|xr|pydantic|pathlib|collections|typing|jaxtyping|pint|types)(\..*)?"),
    ("py:(class|obj|data)", r"[A-Z]\w*|_\w+|optional|default.*|abc\.ABC|annotated_types\..*"),
    ("py:(class|obj)", r"spirillum\.arrays\..*|spirillum\..*\._\w+|spirillum\.robot\.fields\..*|ndarray|'?\d.*"),
]
