"""Many robots, one labelled Dataset."""

from spirillum.studies.run import study

__all__ = ["study"]
