"""Start-up stays light: heavy libraries are imported where they are used."""

import subprocess
import sys

import pytest

HEAVY = (
    "scipy",
    "xarray",
    "matplotlib",
    "pint",
    "h5py",
    "jinja2",
    "pandas",
    "numba",
    "llvmlite",
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


def loaded_after(code: str) -> set[str]:
    """Top-level modules that a fresh interpreter has loaded after running the code."""
    script = f"import sys\ntry:\n    {code}\nexcept SystemExit:\n    pass\nprint('\\n' + ' '.join(sys.modules))"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return {name.split(".")[0] for name in found.stdout.splitlines()[-1].split()}


def test_importing_the_package_loads_no_library() -> None:
    assert not loaded_after("import spirillum") & {*HEAVY, "numpy", "pydantic", "typer", "rich"}


@pytest.mark.parametrize("arguments", [["--help"], ["predict", "--help"], ["page", "--help"], ["--version"]])
def test_help_loads_nothing_heavy(arguments: list[str]) -> None:
    assert not loaded_after(f"from spirillum.cli import main; main({arguments!r})") & {*HEAVY, "numpy"}


def test_one_prediction_draws_no_picture() -> None:
    code = "from spirillum.cli import main; main(['predict', 'biorob2012-wide', '--json'])"
    assert not loaded_after(code) & {"matplotlib", "xarray", "h5py", "jinja2", "pandas"}


def test_model_in_closed_form_loads_nothing_compiled() -> None:
    code = "from spirillum.cli import main; main(['predict', 'biorob2012-wide', '--model', 'sbt', '--json'])"
    assert "numba" not in loaded_after(code)
