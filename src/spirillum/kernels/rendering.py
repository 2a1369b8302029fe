"""Loops of the virtual camera: triangles into pixels, lines of sight, colours of a video.

A virtual camera is packed as 17 numbers: height of the lens, height of the oil's surface, refractive index of the oil,
focal length (negative: turned by half a turn), column and row of the optical axis, distortion k1 and k2, and the
rotation matrix from the frame to the tilted camera. It stands at x = y = 0 with z towards it.
"""

from __future__ import annotations

from spirillum.kernels.native import Array, Float32, Float64, Int64, UInt8, native


@native("diffuse", "specular")
def shade(
    normals: Float64[Array, "triangles 3 3"],  # unit normals in the frame of their solid
    turn: Float64[Array, "3 3"],  # rotation of the solid
    towards: Float64[Array, "lamps 3"],  # unit vector towards each lamp
    halfway: Float64[Array, "lamps 3"],  # unit vector halfway between lamp and camera
    strength: Float64[Array, "lamps"],  # of each lamp
    materials: Float64[Array, "kinds 4"],  # ambient, diffuse and specular reflectance, and exponent of the specular one
    kind: Int64[Array, "triangles"],  # index of each triangle's material
    diffuse: Float64[Array, "triangles 3"],  # diffuse light of each corner
    specular: Float64[Array, "triangles 3"],  # specular light of each corner
) -> None:
    """Light that corners of triangles send to a camera far above them (Blinn-Phong)."""


@native("depth", "picture")
def draw(
    seen: Float64[Array, "vertices 3"],  # pixel u, v and height z of each vertex
    faces: Int64[Array, "triangles 3"],  # vertices of each triangle, outward oriented
    colour: Float64[Array, "triangles 3"],  # linear colour of each triangle's diffuse light
    gloss: Float64[Array, "triangles 3"],  # linear colour of its specular light
    diffuse: Float64[Array, "triangles 3"],  # diffuse light of its corners
    specular: Float64[Array, "triangles 3"],  # specular light of its corners
    spots: Float64[Array, "16 2 16"],  # u and v of the samples in a pixel, -0.5 to 0.5, for 4 x 4 neighbouring pixels
    first: int,  # number of the first sample that is drawn
    every: int,  # every how many samples one is drawn from there: those of one moment
    left: int,  # column of the picture's first pixel
    top: int,  # row of the picture's first pixel
    depth: Float32[Array, "rows columns 16"],  # height z of what each sample has met
    picture: Float32[Array, "rows columns 16 3"],  # its colour
) -> None:
    """Draw triangles that face the camera into samples, the highest in front."""


@native("depth", "picture")
def blend(
    depth: Float32[Array, "rows columns 16"],  # height of what each sample has met; cleared
    samples: Float32[Array, "rows columns 16 3"],  # colours of the samples
    left: int,  # column of the whole picture at which the samples begin
    top: int,  # row at which they begin
    over: Float32[Array, "whole_rows whole_columns"],  # transmission of the glass between robot and camera
    shine: Float32[Array, "whole_rows whole_columns"],  # light mirrored by the glass
    floor: Float32[Array, "whole_rows whole_columns 2"],  # x and y of the floor behind each pixel, m
    # of the robot on the floor, a rounded bar: its centre, unit vector along it, half length without the rounded ends,
    # radius, width of its edge, m, and relative loss of light
    shadow: Float64[Array, "8"],
    tint: Float64[Array, "3"],  # transmission of red, green and blue by the oil
    picture: Float32[Array, "whole_rows whole_columns 3"],  # light of the still parts; changed
) -> None:
    """Composite the samples of an exposure and the robot's shadow with the still parts, and clear the samples."""


@native("image")
def develop(
    light: Float32[Array, "rows columns 3"],  # linear light
    lens: Float64[Array, "rows columns"],  # transmission of the lens
    gain: Float64[Array, "3"],  # brightness of the lamp
    curve: Float64[Array, "steps"],  # bytes over linear light from 0 to 1 in equal steps
    grain: Float32[Array, "grains"],  # a pool of standard normal noise
    starts: Int64[Array, "rows"],  # start of each row in it
    sigma: float,  # standard deviation of the noise, bytes
    image: UInt8[Array, "rows columns 3"],  # the picture
) -> None:
    """Bytes of a picture from its light: vignetting, lamp, gamma curve, noise."""


@native("seen")
def project(points: Float64[Array, "n 3"], camera: Float64[Array, "17"], seen: Float64[Array, "n 3"]) -> None:
    """Pixel u, v and height z of points, by Snell's law; those above the surface are seen straight."""


@native("rays")
def sightlines(pixels: Float64[Array, "n 2"], camera: Float64[Array, "17"], rays: Float64[Array, "n 5"]) -> None:
    """Lines of sight of pixels: x and y where they cross the surface, unit vector in the oil, away from the camera."""


@native("light", "over", "shine", "floor")
def still_picture(
    camera: Float64[Array, "17"],  # packed
    # samples of a pixel, for 4 x 4 neighbouring pixels; the first quarter also sees the glass
    spots: Float64[Array, "16 samples 2"],
    colours: Float64[Array, "3 3"],  # of the ground, the ruler's paper and its ink
    # smallest |y| of the paper, smallest and largest |y| of the lines, largest |y| of the paper, distance from one line
    # to the next, width of a line, m
    ruler: Float64[Array, "6"],
    # height of its axis, inner and outer radius, half its length (negative: there is none), m, absorption coefficient,
    # 1/m
    tube: Float64[Array, "5"],
    waves: Float64[Array, "waves 4"],  # of the floor's brightness: wavevector, 1/m, phase, relative amplitude
    oil: Float64[Array, "3"],  # absorption coefficients of red, green and blue, 1/m
    light: Float32[Array, "rows columns 3"],  # light of the still parts, linear
    over: Float32[Array, "rows columns"],  # transmission of the glass between robot and camera
    shine: Float32[Array, "rows columns"],  # light mirrored by the glass
    floor: Float32[Array, "rows columns 2"],  # x and y of the floor behind each pixel, m
) -> None:
    """Picture of the still parts: floor with its ruler, seen through oil and a tube of glass."""


@native("out")
def film_colours(
    image: UInt8[Array, "height width 3"],  # sRGB bytes; height and width are even
    out: UInt8[Array, "rows width"],  # bytes, rows = 3 height / 2: luma, then both parts of chroma row by row
) -> None:
    """Luma, and chroma at half the size, of a picture: 8-bit YUV 4:2:0 of BT.709 in the limited range.

    A sample of chroma lies on an even column between two rows, where H.264 takes it to lie unless told otherwise. It is
    the mean of the two rows, with weights of 1/4, 1/2, 1/4 along them.
    """
