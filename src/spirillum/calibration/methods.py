"""How parameters are fitted to observations, by name; apart from the fit itself, which takes long to import."""

from __future__ import annotations

from typing import Literal, get_args

Method = Literal["posterior", "least-squares", "paper"]
METHODS: tuple[Method, ...] = get_args(Method)  #: Draws of the posterior, its most probable values, or the paper's.
