"""`spirillum report` states what is installed, and nothing about the machine's user."""

import getpass
import importlib.metadata
import json
import os
import platform

import pytest

import spirillum as sp
from spirillum.results import installation


def test_report_states_versions_and_platform() -> None:
    found = sp.report()
    assert found.spirillum == sp.__version__
    assert platform.python_version() in found.python
    assert found.processors == os.cpu_count()
    assert found.packages["numpy"] == importlib.metadata.version("numpy")
    assert {"pytest", "ruff", "sphinx"}.isdisjoint(found.packages)


def test_extras_are_complete_or_name_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    stated = ["numpy>=2.0", "no-such-package-a>=1; extra == '3d'", 'numpy>=2; extra == "3d"', "numpy; extra == 'page'"]
    stated += ["no-such-package-b; python_version > '3' and extra == 'test'"]
    monkeypatch.setattr(installation, "requires", lambda _: stated)
    found = sp.report()
    assert found.missing == {"3d": ("no-such-package-a",), "page": ()}
    lines = str(found).splitlines()
    assert lines[-2:] == ["extra       3d: not installed: no-such-package-a", "extra       page: installed"]


def test_command_prints_text_or_json(run) -> None:
    text, data = run("report"), run("report", "--json")
    assert text.out == f"{sp.report()}\n"
    answer = json.loads(data.out)
    assert answer["schema"] == "spirillum.report/1"
    assert answer == sp.report().to_dict()


def test_report_names_no_file_and_no_user() -> None:
    text = str(sp.report())
    assert os.path.expanduser("~") not in text  # noqa: PTH111
    assert platform.node() not in text.split()
    assert getpass.getuser() not in text.split()
