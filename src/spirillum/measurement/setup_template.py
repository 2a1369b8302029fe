"""A template of a setup file, and what a filled one says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from spirillum.answer import envelope, quantity
from spirillum.files import new_file, output_target
from spirillum.measurement.depth import depth_shares
from spirillum.robot.fields import field_values
from spirillum.vision.setup import load_setup

__all__ = ["new_setup_file", "setup_answer"]

_TEMPLATE = """\
# A setup: what is known of camera, tank, ruler and robot. Heights count from the reference plane: the tank's floor
# (view "side": its far wall). Every *_uncertainty is a standard uncertainty; 0 claims that the number is exact.
# start = "2 s"                       # time in the video from which on to measure, as when the robot has started up
# end = "20 s"

[camera]
view = "top"                          # "top": from above; "side": level, at right angles to the channel
height = "210 mm"                     # of the lens above the reference plane
height_uncertainty = "2 mm"
# frames_per_second = 30.0            # for a folder of images, or instead of a video's own time stamps
# [camera.checkerboard]               # pictures of a checkerboard in air: the lens's distortion
# images = "checkerboard"             # folder beside this file
# columns = 9                         # inner corners
# rows = 6
# square = "5 mm"

[tank]
surface = "60 mm"                     # height of the flat surface between air and oil; leave out if there is none
surface_uncertainty = "1 mm"
index = 1.40                          # refractive index of the oil
index_uncertainty = 0.005

[markers]
spacing = "2 mm"                      # from each line of the ruler to the next
height = "0 mm"                       # of the ruler
height_uncertainty = "0.5 mm"
# length_per_pixel = "0.25 mm"        # instead of a ruler: at the height of the robot's axis

[robot]
file = "biorob2012-wide"              # a preset, or a robot file beside this one
axis_height = "13 mm"                 # of the robot's axis
axis_height_uncertainty = "1 mm"
direction = "right"                   # where in the picture the nose points: "right" or "left"
# stripes = ["red", "yellow"]         # colours in their order, if not those of the robot file

# [region]                            # part of the picture to look at, pixels
# left = 0
# top = 100
# width = 640
# height = 280
"""


def new_setup_file(path: str | Path, *, overwrite: bool = False) -> None:
    """Write a setup file to fill in.

    Args:
        path: file to write, `.toml`.
        overwrite: replace a file that is there.

    Raises:
        InputError: if the file is there or cannot be written.
    """
    new_file(
        output_target(path, {".toml": "a setup file"}, "setup.toml", replace="none"), _TEMPLATE, overwrite=overwrite
    )


def setup_answer(path: str | Path) -> dict[str, Any]:
    """The answer of `spirillum setup check`: fields in SI, and what uncertain heights do to lengths.

    Raises:
        InputError: if the file or the robot that it names is wrong.
    """
    setup, robot = load_setup(path)
    fields = {
        name: value if unit is None else quantity(value, unit.replace("**", "^"))
        for name, value, unit in field_values(setup)
    }
    shares = depth_shares(setup)
    total = sum(share**2 for share in shares.values()) ** 0.5
    warnings = [] if shares else ["no uncertainty is given: intervals of lengths hold what the picture shows alone"]
    if robot.seal is None or not (setup.robot.stripes or robot.seal.stripes):
        warnings.append("the robot has no stripes: its body's rotation cannot be seen")
    content = {
        "file": str(path),
        "valid": True,
        "robot": robot.name,
        "fields": fields,
        "scale_uncertainty": total,
        "scale_sources": shares,
    }
    return envelope("setup-check", content, warnings)
