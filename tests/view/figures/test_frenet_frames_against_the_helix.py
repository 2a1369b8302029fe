"""Local frames of a plain helix against their closed forms; the drawn arrows start on the wire."""

import numpy as np
import pytest
from frenet_figure import frenet_figure, frenet_frames
from matplotlib.patches import FancyArrowPatch

import spirillum as sp

XI = np.linspace(0.001, 0.059, 40)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_frames_of_a_plain_helix(hand: str) -> None:
    robot = sp.load("biorob2012-wide", **{"tail.taper": "none", "tail.handedness": hand})
    found = frenet_frames(robot, XI)
    slope = 2.0 * np.pi * 2.5 / 25.0
    alpha, sign = 1.0 / np.hypot(1.0, slope), 1.0 if hand == "right" else -1.0
    outwards = found.position * [0, 1, 1] / 0.0025
    around = np.cross([-1.0, 0.0, 0.0], outwards)
    # Away from the root a right-handed helix turns in the positive sense about its direction of travel, -x.
    assert found.tangent == pytest.approx(alpha * np.array([-1.0, 0, 0]) + sign * alpha * slope * around, abs=1e-9)
    assert found.normal == pytest.approx(-outwards, abs=1e-6)
    assert found.binormal == pytest.approx(np.cross(found.tangent, -outwards), abs=1e-6)


def test_frames_of_a_tapered_tail_are_orthonormal_and_right_handed() -> None:
    found = frenet_frames(sp.load("biorob2012-wide"), np.concatenate([[0.0], XI, [0.060]]))
    frame = np.stack([found.tangent, found.normal, found.binormal], axis=1)
    assert frame @ np.swapaxes(frame, 1, 2) == pytest.approx(np.broadcast_to(np.eye(3), frame.shape), abs=1e-9)
    assert np.linalg.det(frame) == pytest.approx(1.0)


def test_figure_has_a_frame_at_each_marked_point_and_the_labs() -> None:
    axes = frenet_figure(sp.load("biorob2012-wide")).axes[0]
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch) and patch.get_zorder() == 8.0]
    assert len(arrows) == 4 * 3 + 3
    names = [text.get_text() for text in axes.texts]
    assert names.count("$\\mathbf{t}$") == 4
    assert {"$x$", "$y$", "$z$"} <= set(names)
