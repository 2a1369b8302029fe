"""The report of a study: figures, claims and one page that needs nothing else to be read."""

from spirillum.report.write import write_report

__all__ = ["write_report"]
