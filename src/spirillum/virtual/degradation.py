"""Options of the disturbances of a video."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import BeforeValidator, Field

from spirillum.errors import InputError, did_you_mean
from spirillum.robot.arguments import Options, in_range, whole, within
from spirillum.robot.fields import Angle


class Degradation(Options):
    """How much of each disturbance a video has; the defaults are a clean one's."""

    argument: ClassVar[str] = "degradation"

    noise: Annotated[float, BeforeValidator(in_range(0.0, 64.0))] = 0.0
    """Standard deviation of the noise, in steps of 255; independent in every pixel and colour."""
    lamp_drift: Annotated[float, BeforeValidator(in_range(0.0, 0.9))] = 0.0
    """Share by which the lamp's brightness changes; its colour by a quarter of that."""
    crf: Annotated[int, BeforeValidator(whole(0, 51))] = 18
    """Constant rate factor of the compression (H.264), 0 (lossless) to 51."""
    dropped: Annotated[float, BeforeValidator(in_range(0.0, 0.9))] = 0.0
    """Share of frames that are lost; the time stamps of the others stay true."""
    tilt: Annotated[Angle, within(0.0, 0.2, "rad")] = 0.0
    """Angle between optical axis and vertical, in a random direction."""
    glare: Annotated[float, BeforeValidator(in_range(0.0, 1.0))] = 0.0
    """Share of the body's picture under a spot of glare."""
    glare_moves: Annotated[bool, Field(strict=True)] = True
    """The glare moves with the body, instead of standing still in the lab."""
    bubbles: Annotated[int, BeforeValidator(whole(0, 200))] = 0
    """Number of bubbles that drift under the top of the tube."""
    hand: Annotated[bool, Field(strict=True)] = False
    """The shadow of a hand passes over the picture."""

    @classmethod
    def of(cls, value: str | Self | Mapping[str, Any] | None) -> Self:
        """A degradation from what a caller may give.

        Args:
            value: `clean`, `degraded`, a `Degradation`, its fields by name, or None: a clean video. Among the fields
                `preset` names the degradation whose fields the others replace.

        Raises:
            InputError: for an unknown name or field, or a value out of range.
        """
        given = {"preset": value} if isinstance(value, str) else value
        if isinstance(given, Mapping) and given.get("preset") is not None:
            name = str(given["preset"])
            if name not in _PRESETS:
                hint = did_you_mean(name, _PRESETS)
                raise InputError(f"degradation = {name[:40]!r}{hint}; allowed: {', '.join(_PRESETS)}")
            instead = {field: new for field, new in given.items() if field != "preset" and new is not None}
            given = _PRESETS[name] | instead
        return super().of(given)

    def uncompressed(self) -> Self:
        """The degradation of frames that are written as PNG files, which lose nothing.

        Raises:
            InputError: if it has a compression of its own, which no preset has.
        """
        if self.crf and self.crf not in {self.of(name).crf for name in _PRESETS}:
            raise InputError(
                f"crf = {self.crf} (of --crf or --trouble compression) for a folder of PNG files, which lose nothing; "
                "allowed: with a video (.mp4)"
            )
        return self.model_copy(update={"crf": 0})


_PRESETS: dict[str, dict[str, Any]] = {
    "clean": {},
    "degraded": {"noise": 8.0, "lamp_drift": 0.2, "crf": 33, "dropped": 0.05, "tilt": math.radians(2.0), "glare": 0.2},
}
"""Named degradations; `degraded` is what measuring is tested with."""
