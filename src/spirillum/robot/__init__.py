"""What is built: robots as frozen, validated data, SI inside; their geometry and limits."""

from spirillum.robot.batch import RobotBatch, batches
from spirillum.robot.load import load, preset_names
from spirillum.robot.robot import Robot

__all__ = ["Robot", "RobotBatch", "batches", "load", "preset_names"]
