"""Triangles into pixels, and light into bytes, the loops of the virtual camera: csrc/raster.c."""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, Int64, UInt8, native


@native("diffuse", "specular")
def shade(
    normals: Float64[Array, "triangles 3 3"],
    turn: Float64[Array, "3 3"],
    towards: Float64[Array, "lamps 3"],
    halfway: Float64[Array, "lamps 3"],
    strength: Float64[Array, "lamps"],
    materials: Float64[Array, "kinds 4"],
    kind: Int64[Array, "triangles"],
    diffuse: Float64[Array, "triangles 3"],
    specular: Float64[Array, "triangles 3"],
) -> None:
    """Light that corners of triangles send to a camera far above them (Blinn-Phong).

    Args:
        normals: unit normals in the frame of their solid.
        turn: rotation of the solid.
        towards: unit vector towards each lamp.
        halfway: unit vector halfway between lamp and camera.
        strength: of each lamp.
        materials: ambient, diffuse and specular reflectance, and exponent of the specular one.
        kind: index of each triangle's material.
        diffuse: diffuse light of each corner.
        specular: specular light of each corner.
    """


@native("depth", "picture")
def draw(
    seen: Float64[Array, "vertices 3"],
    faces: Int64[Array, "triangles 3"],
    colour: Float64[Array, "triangles 3"],
    gloss: Float64[Array, "triangles 3"],
    diffuse: Float64[Array, "triangles 3"],
    specular: Float64[Array, "triangles 3"],
    spots: Float64[Array, "16 2 16"],
    first: int,
    every: int,
    left: int,
    top: int,
    depth: Float32[Array, "rows columns 16"],
    picture: Float32[Array, "rows columns 16 3"],
) -> None:
    """Draw triangles that face the camera into samples, the highest in front.

    Args:
        seen: pixel u, v and height z of each vertex.
        faces: vertices of each triangle, outward oriented.
        colour: linear colour of each triangle's diffuse light.
        gloss: linear colour of its specular light.
        diffuse: diffuse light of its corners.
        specular: specular light of its corners.
        spots: u and v of the samples in a pixel, -0.5 to 0.5, for 4 x 4 neighbouring pixels.
        first: number of the first sample that is drawn.
        every: every how many samples one is drawn from there: those of one moment.
        left: column of the picture's first pixel.
        top: row of the picture's first pixel.
        depth: height z of what each sample has met.
        picture: its colour.
    """


@native("depth", "picture")
def blend(
    depth: Float32[Array, "rows columns 16"],
    samples: Float32[Array, "rows columns 16 3"],
    left: int,
    top: int,
    over: Float32[Array, "whole_rows whole_columns"],
    shine: Float32[Array, "whole_rows whole_columns"],
    floor: Float32[Array, "whole_rows whole_columns 2"],
    shadow: Float64[Array, "8"],
    tint: Float64[Array, "3"],
    picture: Float32[Array, "whole_rows whole_columns 3"],
) -> None:
    """Composite the samples of an exposure and the robot's shadow with the still parts, and clear the samples.

    Args:
        depth: height of what each sample has met; cleared.
        samples: colours of the samples.
        left: column of the whole picture at which the samples begin.
        top: row at which they begin.
        over: transmission of the glass between robot and camera.
        shine: light mirrored by the glass.
        floor: x and y of the floor behind each pixel, m.
        shadow: of the robot on the floor, a rounded bar: its centre, unit vector along it, half length without the
            rounded ends, radius, width of its edge, m, and relative loss of light.
        tint: transmission of red, green and blue by the oil.
        picture: light of the still parts; changed.
    """


@native("image")
def develop(
    light: Float32[Array, "rows columns 3"],
    lens: Float64[Array, "rows columns"],
    gain: Float64[Array, "3"],
    curve: Float64[Array, "steps"],
    grain: Float32[Array, "grains"],
    starts: Int64[Array, "rows"],
    sigma: float,
    image: UInt8[Array, "rows columns 3"],
) -> None:
    """Bytes of a picture from its light: vignetting, lamp, gamma curve, noise.

    Args:
        light: linear light.
        lens: transmission of the lens.
        gain: brightness of the lamp.
        curve: bytes over linear light from 0 to 1 in equal steps.
        grain: a pool of standard normal noise.
        starts: start of each row in it.
        sigma: standard deviation of the noise, bytes.
        image: the picture.
    """
