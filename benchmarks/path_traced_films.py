"""Path-traced videos of the experiment, with setup and truth: is `measure` right on pictures like the paper's?

    python benchmarks/path_traced_films.py -o films glass-grid:1 painted-grid:1-3

Blender's Cycles traces refracting oil, tube and cover, lamps, aperture and motion blur; sensor noise and H.264 follow.
Blender as a module has an environment of its own (`.venv-bpy`); benchmarks/README.md says how to make it.
"""

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path

from path_traced.development import develop, setup_text, truth_of
from path_traced.job import write_job
from path_traced.scenes import KINDS, Scene, sample_scene

HERE = Path(__file__).resolve().parent
TRACER = HERE / "path_traced" / "tracer.py"
PYTHON = HERE.parent / ".venv-bpy" / "bin" / "python"
LEFT_HANDED = 'extends = "biorob2012-wide"\nname = "left-handed"\n[tail]\nhandedness = "left"\n'


def main() -> int:
    """Trace the videos that were named."""
    given = options()
    changes = json.loads(given.changes)
    if not given.tracer.exists():
        raise SystemExit(f"{given.tracer} is missing; benchmarks/README.md says how to install Blender's module")
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.videos or [f"{kind}:1" for kind in KINDS]:
        kind, seeds = seeds_of(name)
        for seed in seeds:
            make(sample_scene(kind, seed, changes), given)
    return 0


def options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("videos", nargs="*", metavar="KIND[:SEED[-SEED]]", help=f"of {', '.join(KINDS)}; all")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the videos")
    parser.add_argument("--tracer", type=Path, default=PYTHON, help="Python that has bpy; usually %(default)s")
    parser.add_argument("--samples", type=int, default=24, help="of each pixel")
    parser.add_argument("--changes", default="{}", help="fields of a scene, JSON")
    parser.add_argument("--keep", action="store_true", help="keep the traced frames")
    return parser.parse_args()


def seeds_of(name: str) -> tuple[str, range]:
    """Kind and seeds of `KIND`, `KIND:SEED` or `KIND:FIRST-LAST`."""
    kind, _, numbers = name.partition(":")
    if kind not in KINDS:
        raise SystemExit(f"unknown kind {kind!r}; allowed: {', '.join(KINDS)}")
    first, _, last = (numbers or "1").partition("-")
    return kind, range(int(first), int(last or first) + 1)


def make(scene: Scene, given: argparse.Namespace) -> None:
    """Trace, develop and describe one video; it is left alone where it is there."""
    name = f"{scene.kind}-{scene.seed}"
    target, folder = given.output / f"{name}.mp4", given.output / f".{name}"
    if target.exists():
        return
    job = write_job(scene, folder, given.samples)
    subprocess.run([given.tracer, TRACER, job], check=True, stdout=sys.stderr)  # noqa: S603
    robot_file = "biorob2012-wide"
    if scene.handedness == "left":
        robot_file = "left-handed.toml"
        (given.output / robot_file).write_text(LEFT_HANDED)
    (given.output / f"{name}.setup.toml").write_text(setup_text(scene, robot_file))
    note_truth(given.output / "truth.json", name, truth_of(scene, name))
    develop(scene, folder, target, [frame["windows"] for frame in json.loads(job.read_text())["frames"]])
    if not given.keep:
        shutil.rmtree(folder)


def note_truth(path: Path, name: str, truth: dict[str, object]) -> None:
    """Add a video to the joint truth."""
    known = json.loads(path.read_text()) if path.exists() else {}
    part = path.with_suffix(".part")
    part.write_text(json.dumps(known | {name: truth}, indent=1) + "\n")
    part.replace(path)


if __name__ == "__main__":
    raise SystemExit(main())
