"""Wires that are bent to rings, whose ends meet."""

import numpy as np

from spirillum.fluid.wire.stokeslets import Wire


def ring_wire(radius: float, *, spacing: float = 1.0, start: float = 0.0) -> Wire:
    """A wire along a ring of radius 1 about the x axis, its stations as far apart as those of other wires."""
    count = int(np.ceil(2.0 * np.pi / (0.75 * spacing * np.exp(0.5) * radius)))
    angle = start + 2.0 * np.pi * np.arange(count) / count
    points, tangents = (
        np.stack([0.0 * angle, *parts], axis=1)
        for parts in ((np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle)))
    )
    return Wire(points, tangents, np.full(count, 2.0 * np.pi / count), radius)
