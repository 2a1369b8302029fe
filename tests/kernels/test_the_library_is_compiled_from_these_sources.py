"""The library is that of csrc/, compiles without a warning, and its stubs check what they are given."""

import ctypes
import os
import runpy
import shutil
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from spirillum.dynamics.free_robot import packed
from spirillum.fluid.tube.domain import in_tube
from spirillum.fluid.tube.library import find_table
from spirillum.kernels import core, native
from spirillum.kernels.core import contact_offset, film_coordinates, spline_weights

CPU = Path("/proc/cpuinfo")
BUILD = Path(__file__).parents[2] / "csrc" / "build.py"


@pytest.fixture(scope="module")
def build() -> dict[str, Any]:
    return runpy.run_path(str(BUILD))


def test_the_library_states_the_digest_of_its_sources(build: dict[str, Any]) -> None:
    assert native.sources_digest() == build["digest"]()


@pytest.fixture(scope="module")
def strict(build: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The baseline for any processor, without much optimisation."""
    return build["compile_all"](tmp_path_factory.mktemp("strict"), (*build["STRICT"], "-O1"), wide=False)[0]


def test_the_sources_compile_without_a_warning(strict: Path) -> None:
    assert strict.stat().st_size > 10_000


@pytest.mark.slow
def test_optimised_sources_compile_without_a_warning(build: dict[str, Any], tmp_path: Path) -> None:
    assert build["compile_all"](tmp_path, (*build["STRICT"], "-O3"))


def test_every_build_finds_the_same_numbers(strict: Path, wide: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without fused products or sums in another order, so that a run is the same on every processor."""
    table = find_table(*in_tube(wide)).packed
    rng = np.random.default_rng(1)
    poses = [(*rng.uniform([2e-3, -0.05, -0.03], [6e-3, 0.05, 0.03]), phase) for phase in range(10)]
    half, other = rng.normal(size=(7, 7)), rng.uniform(size=(7, 7))
    drive = np.append(np.zeros(core.DRIVE_DUTY), rng.uniform(0.5, 1.5, core.DRIVE_SIZE - core.DRIVE_DUTY))
    links = (1e-4 * other, rng.uniform(size=core.WEIGHT_SIZE), drive, half @ half.T + np.eye(7), np.full(4, np.inf))
    states = rng.normal(size=(10, core.STATE_SIZE))
    found = []
    for path in (native.library()._name, str(strict)):
        monkeypatch.setattr(native, "library", partial(ctypes.CDLL, path))
        stubs = runpy.run_path(core.__file__)
        numbers = []
        for pose, state in zip(poses, states, strict=True):
            matrix, change = np.empty((8, 8)), np.empty(core.STATE_SIZE)
            stubs["resistance_at"](table, *pose, matrix)
            data = packed(*links)
            stubs["rates"](change, 0.7, state, data, np.zeros(0))
            numbers.append(np.concatenate([matrix.ravel(), change]))
        found.append(numbers)
    np.testing.assert_array_equal(*found)


@pytest.mark.slow
@pytest.mark.parametrize("platform", runpy.run_path(str(BUILD))["TARGETS"])
def test_zig_compiles_for_every_platform(
    build: dict[str, Any], platform: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where no compiler is installed, and for wheels; its clang knows other pragmas than gcc."""
    pytest.importorskip("ziglang")
    monkeypatch.setenv("SPIRILLUM_WHEEL", platform)
    made = build["compile_all"](tmp_path)
    assert len(made) == (2 if platform.endswith(("x86_64", "amd64")) else 1)
    if platform == "manylinux_2_17_x86_64" and CPU.exists():
        assert bool(ctypes.CDLL(str(made[0])).has_wide_vectors()) == takes_wide_build()


def takes_wide_build() -> bool:
    """What the system says of the processor."""
    flags = next((line for line in CPU.read_text().splitlines() if line.startswith("flags")), "").split()
    return {"avx2", "bmi2", "fma"} <= set(flags)


def test_the_wide_build_is_for_processors_that_take_it() -> None:
    if not CPU.exists():
        pytest.skip("the system does not say what the processor takes")
    library = next(Path(native.__file__).parent.glob("_core.*"))
    assert bool(ctypes.CDLL(str(library)).has_wide_vectors()) == takes_wide_build()


def test_a_result_of_another_type_or_order_is_refused() -> None:
    with pytest.raises(TypeError, match="out must be a contiguous array of float64"):
        spline_weights(0.5, 0.0, 1.0, 4, np.empty(4, dtype=np.float32))
    with pytest.raises(TypeError, match="out must be a contiguous array of float64"):
        spline_weights(0.5, 0.0, 1.0, 4, np.empty(8)[::2])


def test_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match=r"out has shape \(4,\); expected \(5,\)"):
        film_coordinates(np.ones(15), 0.0, 0.0, 0.0, np.empty(4))


def test_an_argument_of_another_type_or_order_is_copied() -> None:
    rings = np.array([[1.0, 2.0, 3.0, 4.0], [-1.0, 2.0, 3.0, 4.0]])
    expected = contact_offset(rings, 9.0, 0.1)
    assert contact_offset(np.asfortranarray(rings), 9.0, 0.1) == contact_offset(rings.astype(np.float32), 9.0, 0.1)
    assert contact_offset(rings=rings, radius=9, pitch=np.float32(0.1)) == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_no_command_reads_or_writes_outside_of_its_arrays(build: dict[str, Any], tmp_path: Path) -> None:
    """A copy of the package with a library that checks every access and undefined behaviour."""
    sanitizer = (
        shutil.which("gcc")
        and subprocess.run(
            ["gcc", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
        ).stdout.strip()
    )
    if not sanitizer or not Path(sanitizer).is_file():
        pytest.skip("gcc has no address sanitizer here")
    package = tmp_path / "spirillum"
    shutil.copytree(Path(native.__file__).parents[1], package, ignore=shutil.ignore_patterns("_core*", "__pycache__"))
    flags = ("-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined", "-fno-sanitize-recover=undefined")
    build["compile_all"](package / "kernels", flags)
    environment = os.environ | {
        "LD_PRELOAD": sanitizer,
        "ASAN_OPTIONS": "detect_leaks=0",
        "PYTHONPATH": str(tmp_path),
        "SPIRILLUM_CACHE": "off",
    }
    commands = (
        ["predict", "biorob2012-wide", "--motion", "held", "--json"],
        ["predict", "biorob2012-wide", "--model", "slender", "--motion", "held", "--json"],
        ["simulate", "biorob2012-wide", "--duration", "0.2s", "-o", "tube.nc"],
        ["simulate", "biorob2012-wide", "--model", "slender", "--duration", "0.2s", "-o", "free.nc"],
        ["simulate", "biorob2012-wide", "--motion", "held", "--model", "sbt", "--duration", "0.2s", "-o", "held.nc"],
        ["render", "biorob2012-wide", "--duration", "0.2s", "-o", "film.mp4"],
    )
    for command in commands:
        line = [sys.executable, "-m", "spirillum", *command]
        said = subprocess.run(line, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert said.returncode == 0, said.stderr[-3000:]
