"""The paper's whole study from a cold start, with dataset, figures and report; and its resumption."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BASELINE = "import numpy, scipy.special, xarray, matplotlib.figure, pydantic, typer, rich"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        target = str(Path(folder) / "study")

        def seconds(code: str) -> float:
            start = time.perf_counter()
            subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=True)  # noqa: S603
            return time.perf_counter() - start

        command = f"from spirillum.cli import main; main(['study', '-o', {target!r}, '--json'])"
        baseline = min(seconds(BASELINE) for _ in range(3))
        first, again = seconds(command), seconds(command)
    print(
        json.dumps(
            {
                "question": "the paper's whole study from a cold start",
                "baseline_imports_s": baseline,
                "first_run_s": first,
                "resumed_run_s": again,
                "ratio_to_imports": first / baseline,
                "target_s": 30.0,
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
