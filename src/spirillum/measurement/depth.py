"""What uncertain heights do to lengths, near the line of sight; the trackers take the whole picture's optics."""

from __future__ import annotations

from spirillum.vision.setup import Setup

_STEP = 1e-3


def apparent_distance(height: float, camera: float, surface: float | None, index: float) -> float:
    """Distance in air at which a point would look as large: (H - S) + (S - z)/n below a surface at S.

    Args:
        height: height z of the point, m.
        camera: height H of the lens, m.
        surface: height S of the surface, m; None: nothing refracts.
        index: refractive index n below it.
    """
    if surface is None or height >= surface:
        return camera - height
    return camera - surface + (surface - height) / index


def spacing_at_axis(setup: Setup, changed: str = "", by: float = 0.0) -> float:
    """Length at the height of the robot's axis that looks as long as the ruler's spacing at the height of the ruler, m.

    Args:
        setup: the setup; without a ruler the spacing is 1.
        changed: a number of the setup that is changed, by its dotted name.
        by: how much it is changed by.
    """

    def number(name: str, value: float) -> float:
        return value + by if name == changed else value

    camera = number("camera.height", setup.camera.height)
    surface = None if setup.tank.surface is None else number("tank.surface", setup.tank.surface)
    index = number("tank.index", setup.tank.index)
    axis = apparent_distance(number("robot.axis_height", setup.robot.axis_height), camera, surface, index)
    ruler = apparent_distance(number("markers.height", setup.markers.height or 0.0), camera, surface, index)
    return number("markers.spacing", setup.markers.spacing or 1.0) * axis / ruler


def depth_shares(setup: Setup) -> dict[str, float]:
    """Relative standard uncertainty of lengths at the height of the axis by what it comes from."""
    markers = setup.markers
    if markers.length_per_pixel is not None:
        share = markers.length_per_pixel_uncertainty / markers.length_per_pixel
        return {"markers.length_per_pixel": share} if share else {}
    uncertain = {
        "camera.height": setup.camera.height_uncertainty,
        "tank.surface": setup.tank.surface_uncertainty if setup.tank.surface is not None else 0.0,
        "tank.index": setup.tank.index_uncertainty if setup.tank.surface is not None else 0.0,
        "markers.spacing": markers.spacing_uncertainty,
        "markers.height": markers.height_uncertainty,
        "robot.axis_height": setup.robot.axis_height_uncertainty,
    }
    scale = spacing_at_axis(setup)
    found = {}
    for name, error in uncertain.items():
        if error > 0:
            change = spacing_at_axis(setup, name, _STEP * error) - spacing_at_axis(setup, name, -_STEP * error)
            found[name] = abs(change / (2.0 * _STEP * scale))
    return found
