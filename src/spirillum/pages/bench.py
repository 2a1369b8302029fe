"""The bench of the page: films that were dropped, their setup, and what is measured and calibrated.

All files lie in one temporary folder, under names that the page gives, and are removed with it.
"""

from __future__ import annotations

import atexit
import shutil
import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from spirillum.calibration.methods import METHODS
from spirillum.errors import InputError
from spirillum.files import scratch_folder
from spirillum.pages.desk import ROBOT_FILE, Desk
from spirillum.pages.films import Films
from spirillum.pages.job import Job
from spirillum.pages.plain_names import plain, plain_names
from spirillum.pages.setup_form import form_list
from spirillum.robot.options import CALIBRATED
from spirillum.swimming.model_choice import AUTO, WALLED

__all__ = ["Bench"]

_MODELS = (AUTO, *CALIBRATED, WALLED)


class Bench:
    """Films, setup and results; its methods may be called from any thread."""

    def __init__(self) -> None:
        """An empty bench."""
        self._kept = ExitStack()
        self._folder = self._kept.enter_context(scratch_folder())
        atexit.register(self._kept.close)  # where the process ends before it has served
        self._lock = threading.RLock()
        self.films = Films(self._folder)
        self.desk = Desk(self._folder, self.films)
        self._job: Job | None = None
        self._kind, self._runs = "", 0
        self._results: dict[str, dict[str, Any]] = {}
        self._folders: dict[str, Path] = {}

    def close(self) -> None:
        """Stop what runs, and remove all files."""
        self.stop()
        self._kept.close()

    def measure(self) -> None:
        """Begin to measure all films.

        Raises:
            InputError: if there is none, the setup is not whole, or something is being measured.
        """
        with self._lock:
            films = [str(path) for path in self.films.paths()]
            if not films:
                raise InputError("no film is here; allowed: one at least")
            problems = self.desk.checked()["problems"]
            if problems:
                raise InputError(problems[0])
            self._start("measure", {"films": films, "setup": str(self.desk.written())})

    def beside(self, name: str) -> dict[str, Any]:
        """A measured trial beside the simulated robot; see `spirillum.pages.beside`.

        Raises:
            InputError: if there is no such trial, or its robot cannot be simulated.
        """
        from spirillum.dynamics.run_file import open_run
        from spirillum.pages.beside import trial_beside_its_run

        with self._lock:
            trials = self._results.get("measure", {}).get("trials", [])
            folder = self._folders.get("measure", self._folder)
        if name not in [trial["name"] for trial in trials]:
            raise InputError(f"trial {name[:40]!r}; allowed: one that was measured")
        with plain_names(self._folder):
            return trial_beside_its_run(open_run(folder / f"{name}.nc"), f"{name}.annotated.mp4")

    def calibrate(self, model: str, method: str) -> None:
        """Begin to calibrate with what was measured.

        Raises:
            InputError: if nothing was measured, or for another model or method.
        """
        for word, value, allowed in (("model", model, _MODELS), ("method", method, METHODS)):
            if value not in allowed:
                raise InputError(f"{word} = {value[:40]!r}; allowed: {', '.join(allowed)}")
        with self._lock:
            table = self._folders.get("measure", self._folder) / "observations.csv"
            if not table.is_file():
                raise InputError("no trial gave a speed or a rate of a robot in a channel; allowed: to measure first")
            robot = self._folders["measure"] / ROBOT_FILE
            robot.write_text(self.desk.robot_text(), encoding="utf-8")
            asked = {"observations": str(table), "robot": str(robot), "model": model, "method": method}
            self._start("calibrate", asked)

    def _start(self, kind: str, request: dict[str, Any]) -> None:
        if self._job is not None and self._job.running:
            raise InputError("something is being computed; allowed: one thing at a time")
        for later in ("measure", "calibrate") if kind == "measure" else ("calibrate",):
            self._results.pop(later, None)
            if (old := self._folders.pop(later, None)) is not None:
                shutil.rmtree(old, ignore_errors=True)
        self._runs += 1
        output = self._folders[kind] = self._folder / f"{kind}-{self._runs}"
        output.mkdir()
        self._kind = kind
        self._job = Job("spirillum.pages.measuring", {"what": kind, "output": str(output), **request})

    def stop(self) -> None:
        """Leave off what is being computed."""
        if self._job is not None and self._job.running:
            self._job.stop()

    def state(self) -> dict[str, Any]:
        """All of the bench, for the page."""
        with self._lock:
            job = self._progress()
            return {
                "films": self.films.told(),
                "form": form_list(),
                "fields": self.desk.fields(),
                "robots": list(self.desk.robots()),
                "setup": self.desk.setup_text(),
                "check": self.desk.checked(),
                "job": job,
                "results": dict(self._results),
                "models": list(_MODELS),
                "methods": list(METHODS),
            }

    def _progress(self) -> dict[str, Any] | None:
        if self._job is None:
            return None
        said, running = self._job.progress(), self._job.running
        if said.get("done"):
            self._results[self._kind] = said["shown"]
            self._job = None
            return None
        if not running or "failed" in said:
            return {"kind": self._kind, "failed": plain(str(said.get("failed", "it was left off")), self._folder)}
        return {"kind": self._kind, **{key: said.get(key) for key in ("what", "done_places", "places")}}

    def kept(self, name: str) -> Path | None:
        """A file of the results by its name; None if there is none of that name."""
        with self._lock:
            for kind, found in self._results.items():
                if name in found["files"]:
                    return self._folders[kind] / name
                if name in found.get("figures", ()):
                    return self._folders[kind] / name
        return None
