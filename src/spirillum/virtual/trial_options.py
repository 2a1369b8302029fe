"""Options of virtual trials: tables whose fields are the same in TOML, in Python and on the command line."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, model_validator

from spirillum.argument_validation import as_pixels
from spirillum.errors import InputError
from spirillum.robot.arguments import Options, in_range, one_of, refusal, whole
from spirillum.robot.fields import Angle, LengthOrZero, Rate, SignedLength, Time, Velocity, refuse

_USUAL_FIELD = (150e-3 + 60e-3 / 1.40) * 640.0 / 740.0
"""Width of the usual picture at the reference plane, m: the lens 150 mm above 60 mm of oil, seen through its surface,
and a focal length of 740 pixels for a width of 640; assumed."""


def _read_size(value: Any) -> tuple[int, int]:
    """Width and height from ``640x480`` or a pair."""
    try:
        return as_pixels(value, 64, 4096, even=True)
    except InputError as error:
        raise refusal(str(error).removeprefix("size ")) from None


def _check_heading(angle: float) -> float:
    most = 45.0  # a setup has only right and left
    if abs(angle) > math.radians(most) * (1.0 + 1e-9):
        raise refusal(f"= {math.degrees(angle):.4g} deg; allowed: {-most:g} to {most:g} deg")
    return angle


def _check_field(width: float) -> float:
    low, high = 1e-3, 1.0
    if not low * (1.0 - 1e-9) <= width <= high * (1.0 + 1e-9):
        raise refusal(f"= {1e3 * width:.4g} mm; allowed: {1e3 * low:g} to {1e3 * high:g} mm")
    return width


def _read_frame_rate(value: Any) -> float:
    return float(Fraction(in_range(1.0, 1000.0, " frames a second")(value)).limit_denominator(1001))


class MotionOptions(Options, argument="motion"):
    """Steady swimming: a model's rates, and those that are prescribed instead."""

    model: str | None = None
    """Hydrodynamic model; None: the study's first, without a study the one that `predict` answers with."""
    friction: str | None = None  #: Reading of the friction; None: the robot's own.
    tail_rate: Rate | None = None  #: Lab rotation rate of the tail; None: the robot's drive.
    forward_velocity: Velocity | None = None  #: Forward velocity instead of the model's.
    body_rate: Rate | None = None  #: Lab rotation rate of the body instead of the model's.


class TrialOptions(Options, argument="trial"):
    """Length of a trial, and the robot's pose at its first frame."""

    duration: Time | None = None  #: Of the video; None: 20 s, of a run its length.
    start: SignedLength | None = None
    """x of the body's mid-length at the first frame, from below the lens; None: the path is centred in the picture."""
    lateral: SignedLength = 0.0  #: Horizontal offset across the channel (y of the lab, forward x and upward z).
    heading: Annotated[Angle, AfterValidator(_check_heading)] = 0.0
    """Angle of the robot's axis to the channel in the picture's plane, at most 45 degrees."""
    wobble: LengthOrZero = 0.0  #: Amplitude of a motion across the channel at the tail's rate, in the picture's plane.
    body_angle: Angle = 0.0  #: Of the body at the first frame.
    tail_phase: Angle = 0.0  #: Of the tail at the first frame.
    gap: LengthOrZero | None = None
    """Between body and tube, in the picture and for a model with walls; None: that of the reference pose of `tube`
    (0.5 mm for the paper's body). A run has its own."""


class CameraOptions(Options, argument="camera"):
    """The camera of a trial."""

    view: Annotated[Literal["top", "side"], BeforeValidator(one_of("top", "side"))] = "top"
    """From the `top`, or level from the `side` of the tank."""
    direction: Annotated[Literal["right", "left"], BeforeValidator(one_of("right", "left"))] = "right"
    """Where the nose points in the picture, `right` or `left`."""
    fps: Annotated[float, BeforeValidator(_read_frame_rate)] = 30.0  #: Frames per second.
    size: Annotated[tuple[int, int], BeforeValidator(_read_size)] = (640, 480)
    """Width and height in pixels, even numbers, or ``"640x480"``."""
    exposure: Time = 1.0 / 120.0  #: Of each frame; 1/120 s by default.
    field_of_view: Annotated[SignedLength, AfterValidator(_check_field)] | None = None
    """Width of the picture at the reference plane, 1 mm to 1 m; None: 166.8 mm, about nine of the paper's bodies. In a
    smaller field, as a microscope's, the ruler and the structure of the floor are finer."""
    distortion: Annotated[float, BeforeValidator(in_range(-0.5, 0.5))] = -0.02
    """Coefficient k1 of the lens's radial distortion; beyond 0.5 the corners of a wide picture fold inwards."""

    @model_validator(mode="after")
    def _exposure_fits(self) -> Self:
        if self.exposure > 1.0 / self.fps:
            sentence = f"exposure = {self.exposure:.4g} s; allowed: at most the {1.0 / self.fps:.4g} s of a frame"
            raise refuse(sentence)
        return self

    @property
    def shrunk(self) -> float:
        """Width of the picture over that of the usual one."""
        return 1.0 if self.field_of_view is None else self.field_of_view / _USUAL_FIELD

    @property
    def leftwards(self) -> bool:
        """Whether the nose points to the left in the picture."""
        return self.direction == "left"


class SetupErrors(Options, argument="setup_errors"):
    """Errors planted in the setup; the video does not have them."""

    depth_error: SignedLength = 0.0  #: Planted error of the setup's height of the robot's axis.
    depth_uncertainty: LengthOrZero = 0.0  #: Standard uncertainty of that height in the setup.


class Seeded(Options):
    """Options with a random seed."""

    seed: Annotated[int, BeforeValidator(whole(0, 2**31 - 1))] = 0  #: Of all random numbers.
