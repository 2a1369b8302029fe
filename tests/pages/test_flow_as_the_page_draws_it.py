"""A plane of the flow as it is sent: the dataset's own numbers, rows of rising z, nothing in solids."""

import base64

import numpy as np
import pytest
import xarray as xr

from spirillum.pages.page_robot import page_plane


def test_plane_is_the_datasets_own() -> None:
    x, z = np.linspace(-0.1, 0.04, 8), np.linspace(-0.02, 0.03, 5)
    along = np.arange(40.0).reshape(8, 5) * 1e-4
    along[2, 3] = np.nan
    plane = xr.Dataset(
        {"velocity_x": (("x", "z"), along), "velocity_z": (("x", "z"), -2.0 * along)},
        {"x": x, "z": z},
        {"model": "slender", "warnings": "one\ntwo"},
    )
    shown = page_plane(plane, 0.5)
    sent = [np.frombuffer(base64.b64decode(part), "<f4").reshape(5, 8) for part in shown["velocity"]]
    assert shown["size"] == [8, 5]
    assert sent[0][3, 2] != sent[0][3, 2]  # NaN: inside a solid
    assert sent[1][4, 7] == pytest.approx(-2.0 * along[7, 4])
    assert shown["x"] + shown["z"] == pytest.approx([-0.1, 0.04, -0.02, 0.03])
    assert 0.0 < shown["fastest"] <= np.sqrt(5.0) * np.nanmax(along)
    assert shown["warnings"] == ["one", "two"]
