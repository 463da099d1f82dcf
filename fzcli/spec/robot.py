"""What every robot becomes, whichever dialect (frames, DH table, URDF) it was written in."""

from typing import Literal

from pydantic import Field

from fzcli.spec.base import SpecModel
from fzcli.spec.shapes import Shape

Vector3 = tuple[float, float, float]
JointType = Literal["revolute", "continuous", "prismatic", "fixed"]


class Frame(SpecModel):
    """A placement in the parent's frame: translation [m], then roll-pitch-yaw [rad] (R = Rz Ry Rx)."""

    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)


class Friction(SpecModel):
    """Friction of a joint: viscous * qd + coulomb * qd / sqrt(qd^2 + smoothing^2).

    ``viscous`` [N m s/rad or N s/m], ``coulomb`` [N m or N], ``smoothing`` [rad/s or m/s] > 0: the speed at
    which the Coulomb part has reached 71 % of itself.
    """

    viscous: float = 0.0
    coulomb: float = 0.0
    smoothing: float = 0.1


class Joint(SpecModel):
    """The joint that carries a link; its frame is the link's frame at q = 0.

    ``position`` [rad or m], ``speed`` [rad/s or m/s] and ``effort`` [N m or N] are limits; None means not stated.
    """

    name: str
    type: JointType
    axis: Vector3 = (0.0, 0.0, 1.0)
    position: tuple[float, float] | None = None
    speed: float | None = None
    effort: float | None = None
    friction: Friction | None = None


class Link(SpecModel):
    """A rigid body: mass [kg], centre of mass ``com`` [m] and inertia about it [kg m2], link axes.

    ``inertia`` is xx, yy, zz, xy, xz, yz; ``parent`` is a link's name, or "base". ``collision``: its solids in
    the link's frame; ``unread``: collision geometry that could not be read, so that planning refuses the robot.
    """

    name: str
    parent: str
    at: Frame = Frame()
    joint: Joint
    mass: float
    com: Vector3 = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float]
    collision: tuple[Shape, ...] = ()
    unread: tuple[str, ...] = ()


class Base(SpecModel):
    """The base body; with ``floating`` False its inertia counts as infinite. Collision as of a link."""

    name: str = "base"
    floating: bool = True
    mass: float
    com: Vector3 = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float, float, float, float]
    collision: tuple[Shape, ...] = ()
    unread: tuple[str, ...] = ()


class Tip(SpecModel):
    """A named frame on a link, the point that tasks speak of."""

    link: str
    xyz: Vector3 = (0.0, 0.0, 0.0)
    rpy: Vector3 = (0.0, 0.0, 0.0)


class Robot(SpecModel):
    """A tree of links on a base, in file order (a parent stands before its children)."""

    kind: Literal["robot"] = "robot"
    name: str
    about: str = ""
    base: Base
    links: tuple[Link, ...]
    tips: dict[str, Tip] = Field(min_length=1)
