"""Start-up stays light: heavy libraries are imported where they are used."""

import subprocess
import sys
from typing import NamedTuple

import pytest

HEAVY = (
    "scipy",
    "xarray",
    "matplotlib",
    "pint",
    "h5py",
    "jinja2",
    "pandas",
    "emcee",
    "arviz_base",
    "arviz_stats",
    "pyvista",
    "vtkmodules",
    "av",
    "PIL",
    "trimesh",
    "starlette",
    "uvicorn",
    "websockets",
    "control",
    "gymnasium",
    "mcap",
    "serial",
)


class Loaded(NamedTuple):
    """Top-level modules that one fresh interpreter has loaded, the lightest of the steps first."""

    imported: set[str]
    helped: set[str]
    tube: set[str]


STEPS = (
    "import spirillum",
    "for said in (['--help'], ['predict', '--help'], ['page', '--help'], ['--version']): command(said)",
    "command(['predict', 'biorob2012-wide', '--motion', 'held', '--json'])",
)


@pytest.fixture(scope="module")
def loaded() -> Loaded:
    """What is loaded after each of the steps."""
    script = (
        "import sys\n"
        "def command(said):\n"
        "    from spirillum.cli import main\n"
        "    try:\n"
        "        main(said)\n"
        "    except SystemExit as left:\n"
        "        assert not left.code\n"
    )
    for step in STEPS:
        script += f"{step}\nprint('\\nloaded', *sys.modules)\n"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    lines = [line.split()[1:] for line in found.stdout.splitlines() if line.startswith("loaded ")]
    return Loaded(*({name.split(".")[0] for name in line} for line in lines))


def test_importing_the_package_loads_no_library(loaded: Loaded) -> None:
    assert not loaded.imported & {*HEAVY, "lazy_loader", "numpy", "pydantic", "typer", "rich"}


def test_help_loads_nothing_heavy(loaded: Loaded) -> None:
    assert "typer" in loaded.helped
    assert not loaded.helped & {*HEAVY, "numpy"}


def test_one_prediction_draws_no_picture(loaded: Loaded) -> None:
    assert not loaded.tube & {"matplotlib", "xarray", "h5py", "jinja2", "pandas", "jaxtyping", "asyncio"}


def test_a_command_reads_its_own_options_alone() -> None:
    script = (
        "from spirillum.cli.app import command_line\n"
        "commands = command_line().commands\n"
        "assert {'--model', '--notes'} <= {name for option in commands['predict'].params for name in option.opts}\n"
        "print(*(name for name, command in commands.items() if '_made' in vars(command)))\n"
    )
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["predict"]
