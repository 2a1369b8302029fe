"""Lines of sight of the virtual camera, and the still picture that they meet: csrc/sightlines.c.

A virtual camera is packed as 17 numbers: height of the lens, height of the oil's surface, refractive index of the oil,
focal length (negative: turned by half a turn), column and row of the optical axis, distortion k1 and k2, and the
rotation matrix from the frame to the tilted camera. It stands at x = y = 0 with z towards it.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, native


@native("seen")
def project(points: Float64[Array, "n 3"], camera: Float64[Array, "17"], seen: Float64[Array, "n 3"]) -> None:
    """Pixel u, v and height z of points, by Snell's law; those above the surface are seen straight."""


@native("rays")
def sightlines(pixels: Float64[Array, "n 2"], camera: Float64[Array, "17"], rays: Float64[Array, "n 5"]) -> None:
    """Lines of sight of pixels: x and y where they cross the surface, unit vector in the oil, away from the camera."""


@native("light", "over", "shine", "floor")
def still_picture(
    camera: Float64[Array, "17"],
    spots: Float64[Array, "16 samples 2"],
    colours: Float64[Array, "3 3"],
    ruler: Float64[Array, "6"],
    tube: Float64[Array, "5"],
    waves: Float64[Array, "waves 4"],
    oil: Float64[Array, "3"],
    light: Float32[Array, "rows columns 3"],
    over: Float32[Array, "rows columns"],
    shine: Float32[Array, "rows columns"],
    floor: Float32[Array, "rows columns 2"],
) -> None:
    """Picture of the still parts: floor with its ruler, seen through oil and a tube of glass.

    Args:
        camera: packed.
        spots: samples of a pixel, for 4 x 4 neighbouring pixels; the first quarter also sees the glass.
        colours: of the ground, the ruler's paper and its ink.
        ruler: smallest |y| of the paper, smallest and largest |y| of the lines, largest |y| of the paper, distance from
            one line to the next, width of a line, m.
        tube: height of its axis, inner and outer radius, half its length (negative: there is none), m, absorption
            coefficient, 1/m.
        waves: of the floor's brightness: wavevector, 1/m, phase, relative amplitude.
        oil: absorption coefficients of red, green and blue, 1/m.
        light: light of the still parts, linear.
        over: transmission of the glass between robot and camera.
        shine: light mirrored by the glass.
        floor: x and y of the floor behind each pixel, m.
    """
