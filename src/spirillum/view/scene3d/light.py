"""Soft light: lamps that stay with the camera, and bright surroundings that metal and plastic reflect."""

from __future__ import annotations

from typing import Any

import numpy as np

from spirillum.arrays import Samples

__all__ = ["add_light", "surroundings"]

_LAMPS = (  # place about the camera (right, up, towards it), strength
    ((-0.6, 0.9, 0.8), 0.9),
    ((0.9, 0.3, 0.7), 0.35),
    ((0.1, 0.9, -0.6), 0.4),
)


def surroundings(rows: int = 64) -> Samples:
    """(rows, 2 rows, 3) brightness of the surroundings by latitude and longitude: a pale room, a bright lamp above."""
    up = np.linspace(1.0, -1.0, rows)[:, None, None]
    around = np.linspace(-np.pi, np.pi, 2 * rows)[None, :, None]
    room = 0.42 + 0.26 * up + 0.10 * np.cos(around)
    lamp = 1.9 * np.exp(-(((up - 0.72) / 0.16) ** 2)) * (0.75 + 0.25 * np.cos(2.0 * around))
    window = 0.7 * np.exp(-(((up - 0.25) / 0.22) ** 2) - ((np.abs(around) - 1.6) / 0.35) ** 2)
    tint = np.array([1.0, 0.995, 0.985])
    return np.asarray(np.maximum(room + lamp + window, 0.12) * tint)


def add_light(plotter: Any, pyvista: Any, *, surrounded: bool = True) -> None:
    """Light a scene.

    Args:
        plotter: the scene's plotter, without lights.
        pyvista: the library.
        surrounded: add bright surroundings, which surfaces with `pbr` reflect.
    """
    for place, strength in _LAMPS:
        lamp = pyvista.Light(position=place, focal_point=(0, 0, 0), color="white", intensity=strength)
        lamp.positional = False
        lamp.set_camera_light()
        plotter.add_light(lamp)
    if not surrounded:
        return
    image = np.asarray(surroundings(), dtype=np.float32)
    rows, columns, _ = image.shape
    grid = pyvista.ImageData(dimensions=(columns, rows, 1))
    grid.point_data["light"] = image[::-1].reshape(-1, 3)
    grid.set_active_scalars("light")
    texture = pyvista.Texture(grid)
    texture.SetColorModeToDirectScalars()
    texture.MipmapOn()
    texture.InterpolateOn()
    renderer = plotter.renderer
    renderer.UseImageBasedLightingOn()
    renderer.SetEnvironmentTexture(texture)
    # Smooth surroundings need few samples; as VTK has it, their preparation takes seconds without a graphics card.
    table, blurred = renderer.GetEnvMapLookupTable(), renderer.GetEnvMapPrefiltered()
    table.SetLUTSize(128)
    table.SetLUTSamples(128)
    blurred.SetPrefilterMaxSamples(64)
    renderer.SetEnvironmentUp(0.0, 0.0, 1.0)
    renderer.SetEnvironmentRight(1.0, 0.0, 0.0)
