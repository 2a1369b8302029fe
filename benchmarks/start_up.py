"""Start-up: importing the package and printing the help, against importing what both stand on."""

from __future__ import annotations

import json
import subprocess
import sys
import time

BASELINE = "import numpy, pydantic, typer, rich"
QUESTIONS = {
    "import": "import spirillum",
    "help": "from spirillum.cli import main; main(['--help'])",
    "predict": "from spirillum.cli import main; main(['predict', 'biorob2012-wide', '--json'])",
}


def best(code: str, repeats: int = 9) -> float:
    """Shortest wall time of a fresh interpreter that runs the code."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=False)  # noqa: S603
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    baseline = best(BASELINE)
    times = {name: best(code) for name, code in QUESTIONS.items()}
    print(
        json.dumps(
            {
                "question": "start-up against importing numpy, pydantic, typer and rich",
                "baseline_s": baseline,
                "seconds": times,
                "ratios": {name: value / baseline for name, value in times.items()},
                "target_ratios": {"import": 1.5, "help": 2.0},
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
