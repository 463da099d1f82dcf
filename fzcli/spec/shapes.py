"""Solids by which collisions are judged: spheres, capsules and boxes, of links, of the base and of scenes."""

from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from fzcli.spec.base import SpecModel
from fzcli.spec.physics import Array, rotation_of, rpy_of, snapped, vector
from fzcli.spec.units import Angle, Length

Point = tuple[Length, Length, Length]
Angles = tuple[Angle, Angle, Angle]
Extent = Annotated[Length, Field(gt=0)]


class SphereShape(SpecModel):
    """A ball about ``center`` [m]."""

    center: Point = (0.0, 0.0, 0.0)
    radius: Extent


class CapsuleShape(SpecModel):
    """All points within ``radius`` [m] of the segment between two points [m]."""

    start: Point = Field(alias="from")
    end: Point = Field(alias="to")
    radius: Extent

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if self.start == self.end:
            raise ValueError("from and to are one point; write a sphere")
        return self


class BoxShape(SpecModel):
    """A box: ``center`` [m], orientation ``rpy`` (R = Rz Ry Rx) and whole edge lengths ``size`` [m]."""

    center: Point = (0.0, 0.0, 0.0)
    rpy: Angles = (0.0, 0.0, 0.0)
    size: tuple[Extent, Extent, Extent]


class Shape(SpecModel):
    """One solid: a sphere, a capsule or a box."""

    sphere: SphereShape | None = None
    capsule: CapsuleShape | None = None
    box: BoxShape | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [kind for kind in ("sphere", "capsule", "box") if getattr(self, kind) is not None]
        if len(given) != 1:
            have = f", has {' and '.join(given)}" if given else ""
            raise ValueError(f"needs one of sphere, capsule and box{have}")
        return self

    @property
    def solid(self) -> SphereShape | CapsuleShape | BoxShape:
        """The one that is given."""
        found = self.sphere or self.capsule or self.box
        if found is None:
            raise ValueError("needs one of sphere, capsule and box")
        return found

    @property
    def kind(self) -> str:
        """sphere, capsule or box."""
        return type(self.solid).__name__.removesuffix("Shape").lower()


class CollisionFile(SpecModel):
    """What a body is for collisions; empty: it meets nothing."""

    collision: tuple[Shape, ...] = Field(default=(), description="solids in the body's frame, as com")

    @field_validator("collision", mode="before")
    @classmethod
    def _a_list(cls, value: object) -> object:
        if isinstance(value, dict):
            raise ValueError("must be a list of solids: write '- ' before sphere, capsule or box")
        return value


def placed(shape: Shape, rotation: Array, translation: Array) -> Shape:
    """The same solid seen from the frame in which its own has this rotation (3, 3) and translation (3)."""

    def point(own: tuple[float, float, float]) -> tuple[float, float, float]:
        return vector(rotation @ own + translation)

    solid = shape.solid
    if isinstance(solid, SphereShape):
        return Shape(sphere=SphereShape(center=point(solid.center), radius=solid.radius))
    if isinstance(solid, CapsuleShape):
        moved = CapsuleShape(start=point(solid.start), end=point(solid.end), radius=solid.radius)
        return Shape(capsule=moved)
    turn = rpy_of(snapped(rotation @ rotation_of(solid.rpy)))
    return Shape(box=BoxShape(center=point(solid.center), rpy=turn, size=solid.size))
