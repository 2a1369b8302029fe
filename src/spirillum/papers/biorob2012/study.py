"""The paper's study: sixteen tails in two channels."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any


def paper_study() -> dict[str, Any]:
    """The tables of the paper's study, as a study file has them."""
    text = (files("spirillum.papers.biorob2012") / "study.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
