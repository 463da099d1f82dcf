"""The planar 3-RRR: three two-link legs, driven at their feet, that carry one platform."""

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from fzcli.spec.base import SpecModel
from fzcli.spec.robot_file import Name
from fzcli.spec.units import Angle, AngularSpeed, Length

_DISTINCT = 1e-6  # rad: corners nearer than this are one


def _three_corners(angles: tuple[float, float, float]) -> tuple[float, float, float]:
    for i, j in ((0, 1), (0, 2), (1, 2)):
        if abs(math.remainder(angles[i] - angles[j], 2 * math.pi)) < _DISTINCT:
            raise ValueError(f"corners {i + 1} and {j + 1} stand at the same angle, {math.degrees(angles[i]):g} deg")
    return angles


class Triangle(SpecModel):
    """Three corners on a circle, about the origin of their body's frame; leg i joins corners i."""

    radius: Annotated[Length, Field(gt=0, description="of the circle through the corners")]
    angles: Annotated[tuple[Angle, Angle, Angle], AfterValidator(_three_corners)]

    @property
    def corners(self) -> tuple[tuple[float, float], ...]:
        """The corners' x and y [m]."""
        return tuple((self.radius * math.cos(angle), self.radius * math.sin(angle)) for angle in self.angles)


class Legs(SpecModel):
    """The two links of every leg; ``radius`` is half their width, and that of the platform's sides."""

    proximal: Annotated[Length, Field(gt=0, description="from the driven joint to the elbow")]
    distal: Annotated[Length, Field(gt=0, description="from the elbow to the platform")]
    radius: Annotated[Length, Field(ge=0, description="half the width of links and platform sides")] = 0.0


class Drives(SpecModel):
    """Limits of the driven joints; what is not said has none."""

    position: tuple[Angle, Angle] | None = None
    speed: Annotated[AngularSpeed | None, Field(gt=0)] = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.position is not None and self.position[0] >= self.position[1]:
            raise ValueError("position: the lower limit must be below the upper one")
        return self


class Planar3RRR(SpecModel):
    """A planar 3-RRR as its file says it: driven joints on ``base``, platform joints on ``platform``."""

    kind: Literal["planar_3rrr"]
    name: Annotated[Name | None, Field(description="default: the file's name")] = None
    about: str = ""
    base: Triangle
    platform: Triangle
    legs: Legs
    drives: Drives = Drives()
