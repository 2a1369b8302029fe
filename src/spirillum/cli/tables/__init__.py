"""What answers look like: a function for each kind, named after its schema, that yields title, lines and tables."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from spirillum.cli.tables.parts import Answer, Blocks

_MODULES = {
    "motion": "prediction model_comparison simulation magnetic_sweep settling flow remote control",
    "fits": "calibration model_ranking suggestion observations",
    "studies": "study study_store design validation",
    "robots": "robot check export resistance preparation preparations report",
    "videos": (
        "measurement feasibility track setup_check setup_proposal virtual_experiment virtual_trial film show recording"
    ),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names.split()}


def blocks_of(answer: Answer, **options: Any) -> Blocks:
    """Title, lines and tables of an answer, in the order in which they are read."""
    kind = str(answer["schema"]).removeprefix("spirillum.").partition("/")[0].replace("-", "_")
    blocks: Blocks = getattr(import_module(f"{__name__}.{_MODULE_OF[kind]}"), kind)(answer, **options)
    return blocks
