"""The installation as text for a bug report: versions, platform, processors, optional dependencies."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Any

from spirillum.display import DisplayMixin
from spirillum.envelope import envelope
from spirillum.version import package_version

_NOT_FOR_USERS = ("test", "lint", "docs")  # extras of those who work on the package
_REQUIREMENT = re.compile(r"(?P<name>[\w.-]+).*?(?:;.*\bextra == ['\"](?P<extra>[\w-]+)['\"])?$")


@dataclass(frozen=True, repr=False)
class InstallationReport(DisplayMixin):
    """Versions and platform of an installation."""

    spirillum: str  #: Version of the package.
    python: str  #: Implementation and version.
    platform: str  #: System, release and kind of processor.
    processors: int  #: Number of logical processors of this machine.
    packages: Mapping[str, str]  #: Name to version of every dependency that is installed, optional ones included.
    missing: Mapping[str, tuple[str, ...]]
    """Extra to the dependencies of it that are not installed; empty where the extra is complete."""

    def to_dict(self) -> dict[str, Any]:
        """The report as data, as ``report --json`` prints it."""
        missing = {extra: list(names) for extra, names in self.missing.items()}
        return envelope("report", {**asdict(self), "missing": missing}, ())

    def __str__(self) -> str:
        """The report as lines to paste."""
        return "\n".join(report_lines(self.to_dict()))


def report_lines(answer: Mapping[str, Any]) -> Iterator[str]:
    """Lines of a report: versions, platform, packages, then one for each extra."""
    for name in ("spirillum", "python", "platform", "processors"):
        yield f"{name:<11} {answer[name]}"
    yield f"{'packages':<11} {', '.join(f'{name} {number}' for name, number in answer['packages'].items())}"
    for extra, names in answer["missing"].items():
        yield f"{'extra':<11} {extra}: {'not installed: ' + ', '.join(names) if names else 'installed'}"


def report() -> InstallationReport:
    """Return versions, platform, processor count and extras of this installation, as text for an issue.

    Nothing is imported: versions are those that the installed packages state. The report names no file, host or user.
    """
    packages: dict[str, str] = {}
    missing: dict[str, list[str]] = {}
    for requirement in requires("spirillum") or ():
        found = _REQUIREMENT.match(requirement)
        if found is None or found["extra"] in _NOT_FOR_USERS:
            continue
        absent = missing.setdefault(found["extra"], []) if found["extra"] else []
        try:
            packages[found["name"]] = version(found["name"])
        except PackageNotFoundError:
            absent.append(found["name"])
    return InstallationReport(
        spirillum=package_version(),
        python=f"{platform.python_implementation()} {platform.python_version()}",
        platform=f"{platform.system()} {platform.release()} {platform.machine()}",
        processors=os.cpu_count() or 1,
        packages=dict(sorted(packages.items(), key=lambda item: item[0].lower())),
        missing={extra: tuple(names) for extra, names in missing.items()},
    )
