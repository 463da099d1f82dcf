"""The robot files that users write: explicit frames, a standard DH table, or a URDF with additions."""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, ValidationInfo, WithJsonSchema, field_validator, model_validator
from pydantic.functional_validators import AfterValidator

from fzcli.spec.base import SpecModel
from fzcli.spec.nearest import shown
from fzcli.spec.physics import Inertia6, Vector3, check_body
from fzcli.spec.robot import JointType
from fzcli.spec.shapes import Angles, CollisionFile, Point, Shape
from fzcli.spec.units import (
    Angle,
    InertiaMoment,
    JointDamping,
    JointEffort,
    JointSpeed,
    JointValue,
    Length,
    Mass,
    quantity,
)

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
_INERTIA_SCHEMA = {
    "type": "array",
    "minItems": 3,
    "maxItems": 6,
    "items": {"type": ["number", "string"]},
    "description": "[kg m2] about the CoM, link axes: xx yy zz, or xx yy zz xy xz yz",
}
_AXIS_SCHEMA = {
    "anyOf": [
        {"enum": ["x", "y", "z", "-x", "-y", "-z"]},
        {"type": "array", "minItems": 3, "maxItems": 3, "items": {"type": "number"}},
    ]
}


def _name(text: str) -> str:
    if not text or not all(mark.isalnum() or mark in "_-" for mark in text):
        raise ValueError(f"a name holds letters, digits, _ and -, got {shown(text)}")
    return text


def _inertia(value: Any) -> Any:
    if isinstance(value, list | tuple) and len(value) not in (3, 6):
        raise ValueError(f"needs 3 numbers (xx yy zz) or 6 (xx yy zz xy xz yz), has {len(value)}")
    return [*value, 0, 0, 0] if isinstance(value, list | tuple) and len(value) == 3 else value


def _axis(value: Any) -> Any:
    if isinstance(value, str):
        letter = value.removeprefix("-")
        if letter not in _AXES:
            raise ValueError(f"must be x, y, z, -x, -y, -z or three numbers, got {shown(value)}")
        return tuple(-part + 0.0 if value[0] == "-" else part for part in _AXES[letter])
    return value


def _unit_axis(axis: Vector3) -> Vector3:
    length = math.hypot(*axis)
    if not 1e-9 < length < math.inf:
        raise ValueError("must have a direction, got a zero vector")
    x, y, z = (part / length for part in axis)
    return (x, y, z)


Name = Annotated[str, AfterValidator(_name)]
InertiaNumbers = Annotated[
    tuple[InertiaMoment, InertiaMoment, InertiaMoment, InertiaMoment, InertiaMoment, InertiaMoment],
    BeforeValidator(_inertia),
    WithJsonSchema(_INERTIA_SCHEMA),
]
Axis = Annotated[Vector3, AfterValidator(_unit_axis), BeforeValidator(_axis), WithJsonSchema(_AXIS_SCHEMA)]


class FrameFile(SpecModel):
    """A placement in the parent's frame: xyz, then rpy (roll, pitch, yaw; R = Rz Ry Rx)."""

    xyz: Point = (0.0, 0.0, 0.0)
    rpy: Angles = (0.0, 0.0, 0.0)


def _positive(mass: float | None) -> float | None:
    if mass is not None and mass < 0:
        raise ValueError(f"must be > 0, got {mass:g} kg")
    return mass


def _body_exists(inertia: Inertia6 | None, info: ValidationInfo) -> Inertia6 | None:
    """Mass, read before it, and inertia together make a body that can exist."""
    mass = info.data.get("mass")
    if "mass" in info.data and inertia is not None:
        check_body(mass or 0.0, inertia)
    elif mass:
        raise ValueError("inertia is missing: xx yy zz [xy xz yz] about the CoM, kg m2")
    return inertia


BodyInertia = Annotated[
    InertiaNumbers | None, AfterValidator(_body_exists), Field(default=None, validate_default=True)
]


class BodyFile(CollisionFile):
    """Mass (0: a frame without a body), centre of mass in the body's frame, inertia about it."""

    mass: Annotated[Mass, AfterValidator(_positive)]
    com: Point = (0.0, 0.0, 0.0)
    inertia: BodyInertia = None


class MaybeBodyFile(CollisionFile):
    """The same, where the mass need not be said."""

    mass: Annotated[Mass | None, AfterValidator(_positive)] = None
    com: Point = (0.0, 0.0, 0.0)
    inertia: BodyInertia = None


class BaseFile(MaybeBodyFile):
    """The base body, floating (default) or fixed; a fixed one needs no mass."""

    floating: bool = True

    @model_validator(mode="after")
    def _floats_with_mass(self) -> Self:
        if self.floating and not self.mass:
            raise ValueError("a floating base needs mass > 0 and inertia; say floating: false to fix it")
        return self


class FrictionFile(SpecModel):
    """Friction of a joint: viscous * speed + coulomb * speed / sqrt(speed^2 + smoothing^2)."""

    viscous: Annotated[JointDamping, Field(ge=0)] = 0.0
    coulomb: Annotated[JointEffort, Field(ge=0)] = 0.0
    smoothing: Annotated[JointSpeed, Field(gt=0)] = 0.1


class MotionFile(SpecModel):
    """What kind of motion a joint allows, how far, how fast and with what force, and its friction."""

    type: JointType = "revolute"
    position: tuple[JointValue, JointValue] | None = None
    speed: JointSpeed | None = None
    effort: JointEffort | None = Field(default=None, description="limit of torque (N m) or force (N)")
    friction: FrictionFile | None = None

    @field_validator("position", mode="before")
    @classmethod
    def _position(cls, value: Any, info: ValidationInfo) -> Any:
        kind = info.data.get("type")
        if value is None or kind is None:
            return value
        if kind in ("fixed", "continuous"):
            advice = "; make it revolute" if kind == "continuous" else ""
            raise ValueError(f"a {kind} joint has no position limits{advice}")
        if not isinstance(value, list | tuple) or len(value) != 2:
            raise ValueError(f"must be two limits, [lower, upper], got {shown(value)}")
        lower, upper = (quantity(item, "length" if kind == "prismatic" else "angle") for item in value)
        if lower >= upper:
            raise ValueError(f"lower limit must be below the upper one, got {shown(list(value))}")
        return (lower, upper)

    @field_validator("speed", "effort", mode="before")
    @classmethod
    def _limit(cls, value: Any, info: ValidationInfo) -> Any:
        kind = info.data.get("type")
        if value is None or kind is None:
            return value
        turning, sliding = ("angular speed", "speed") if info.field_name == "speed" else ("torque", "force")
        if kind == "fixed":
            raise ValueError(f"a fixed joint has no {turning.removeprefix('angular ')} limit")
        limit = quantity(value, sliding if kind == "prismatic" else turning)
        if limit <= 0:
            raise ValueError(f"must be > 0, got {shown(value)}")
        return limit

    @field_validator("friction")
    @classmethod
    def _friction(cls, friction: FrictionFile | None, info: ValidationInfo) -> FrictionFile | None:
        if friction is not None and info.data.get("type") == "fixed":
            raise ValueError("a fixed joint has no friction")
        return friction


class JointFile(MotionFile):
    """The joint that carries a link: name, type, axis (x, y, z or numbers), limits."""

    name: Name | None = Field(default=None, validate_default=True)
    axis: Axis = (0.0, 0.0, 1.0)

    @field_validator("name")
    @classmethod
    def _moving_joints_are_named(cls, name: str | None, info: ValidationInfo) -> str | None:
        if name is None and info.data.get("type", "fixed") != "fixed":
            raise ValueError("name is missing; a moving joint needs one")
        return name


class LinkFile(BodyFile):
    """A link: its joint's frame in the parent's frame, the joint (none: fixed), the body."""

    name: Name
    parent: str | None = Field(default=None, description="a link's name or base; default: the link before")
    at: FrameFile = FrameFile()
    joint: JointFile = JointFile(type="fixed")

    @field_validator("name")
    @classmethod
    def _base_is_taken(cls, name: str) -> str:
        if name == "base":
            raise ValueError("the name base belongs to the base body")
        return name


class TipFile(FrameFile):
    """A frame on a link that tasks speak of."""

    link: str


class RobotFile(SpecModel):
    """A robot as a tree of links with explicit frames."""

    kind: Literal["robot"]
    name: Name | None = Field(default=None, description="default: the file's name")
    about: str = ""
    base: BaseFile
    links: tuple[LinkFile, ...] = Field(min_length=1)
    tips: dict[Name, TipFile] = Field(min_length=1)


class RowFile(BodyFile, MotionFile):
    """A row of a standard DH table: joint i about z of frame i-1; com, inertia and collision in frame i.

    ``theta`` (``d`` for a prismatic joint) is the value at q = 0.
    """

    name: Name = Field(description="the joint's name")
    link: Name | None = Field(default=None, description="the link's name; default: NAME_link")
    type: Literal["revolute", "continuous", "prismatic"] = "revolute"
    theta: Angle
    d: Length
    a: Length
    alpha: Angle


class TableFile(SpecModel):
    """A Denavit-Hartenberg table: A_i = Rz(theta) Tz(d) Tx(a) Rx(alpha)."""

    convention: Literal["standard"]
    rows: tuple[RowFile, ...] = Field(min_length=1)


class MountedBaseFile(BaseFile):
    """The base body and where the arm stands on it: DH frame 0 in the base's frame."""

    mount: FrameFile = FrameFile()


class RowTipFile(FrameFile):
    """A frame in the DH frame after a row (``link``: the row's name; default: the last one)."""

    link: str | None = None


class DhRobotFile(SpecModel):
    """A robot as a standard DH table; without ``tips``, the last DH frame is the tip ``flange``."""

    kind: Literal["robot"]
    name: Name | None = Field(default=None, description="default: the file's name")
    about: str = ""
    base: MountedBaseFile
    dh: TableFile
    tips: dict[Name, RowTipFile] = Field(default_factory=lambda: {"flange": RowTipFile()}, min_length=1)


class UrdfBaseFile(MaybeBodyFile):
    """What to say about the base over the URDF: whether it floats, another mass, CoM and inertia, its solids."""

    floating: bool = True


class UrdfRobotFile(SpecModel):
    """A robot from a URDF; ``base``, ``tips`` and ``collision`` replace what it says."""

    kind: Literal["robot"]
    name: Name | None = Field(default=None, description="default: the URDF's name")
    about: str = ""
    urdf: str = Field(description="the URDF's path, from this file's folder")
    base: UrdfBaseFile = UrdfBaseFile()
    collision: dict[str, tuple[Shape, ...]] = Field(default_factory=dict, description="solids of links, by name")
    tips: dict[Name, TipFile] | None = Field(default=None, min_length=1)
