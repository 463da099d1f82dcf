"""A robot spec as flat arrays: moving bodies only, fixed joints welded into what carries them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.robot import Frame, Friction, Link, Robot, Tip
from fzcli.spec.shapes import Shape, placed

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Placement:
    """A frame in its carrier's frame: ``rotation`` (3, 3) and ``translation`` (3) [m]."""

    rotation: Array
    translation: Array

    def then(self, other: "Placement") -> "Placement":
        """The placement of ``other``, which is given in this frame, in this frame's carrier."""
        return Placement(
            snap(times(self.rotation, other.rotation)),
            self.translation + times(self.rotation, other.translation[:, None])[:, 0],
        )


@dataclass(frozen=True)
class Inertia:
    """Mass [kg], first moment (3) [kg m] and inertia (3, 3) [kg m2], both about the frame's origin."""

    mass: float
    first_moment: Array
    tensor: Array

    def plus(self, other: "Inertia") -> "Inertia":
        """Two bodies welded together, given in one frame."""
        return Inertia(
            self.mass + other.mass, self.first_moment + other.first_moment, self.tensor + other.tensor
        )

    def moved(self, place: Placement) -> "Inertia":
        """The same body seen from the carrier in which its frame has this placement."""
        turned = times(place.rotation, self.first_moment[:, None])[:, 0]
        p, h = place.translation, turned + self.mass * place.translation
        tensor = times(times(place.rotation, self.tensor), place.rotation.T)
        shift = 2 * float((p * turned).sum()) * np.eye(3) - np.outer(p, turned) - np.outer(turned, p)
        shift += self.mass * (float((p * p).sum()) * np.eye(3) - np.outer(p, p))
        return Inertia(self.mass, h, tensor + shift)


@dataclass(frozen=True)
class Body:
    """A rigid body behind one active joint; its frame is the joint's, turning with it."""

    joint: str
    parent: int
    place: Placement
    prismatic: bool
    axis: Array
    inertia: Inertia


@dataclass(frozen=True)
class TipFrame:
    """A tip on body ``body`` (-1: the base)."""

    body: int
    place: Placement


@dataclass(frozen=True)
class BodySolid:
    """A solid of link ``link`` for collisions, in the frame of the body (-1: the base) that carries it."""

    link: str
    body: int
    shape: Shape


@dataclass(frozen=True)
class Tree:
    """The robot's bodies in joint order (depth first, children in file order), its tips and its solids."""

    base: Inertia
    floating: bool
    bodies: tuple[Body, ...]
    tips: dict[str, TipFrame]
    position_limits: Array  # (n, 2), infinite where the spec states none
    speed_limits: Array  # (n,)
    solids: tuple[BodySolid, ...] = ()
    effort_limits: Array = field(default_factory=lambda: np.zeros(0))  # (n,), infinite where the spec states none
    friction: Array = field(default_factory=lambda: np.zeros((0, 3)))  # (n, 3): viscous, Coulomb, smoothing

    def ancestors(self, body: int) -> list[int]:
        """The bodies from the base to ``body``, itself included."""
        chain: list[int] = []
        while body >= 0:
            chain.append(body)
            body = self.bodies[body].parent
        return chain[::-1]

    @property
    def mass(self) -> float:
        """Mass of the whole system [kg]."""
        return self.base.mass + sum(body.inertia.mass for body in self.bodies)


def times(a: Array, b: Array) -> Array:
    """The product of two small matrices without BLAS: the same bits on every machine."""
    return np.asarray((a[:, :, None] * b[None, :, :]).sum(axis=1))


def snap(matrix: Array) -> Array:
    """A rotation's entries as multiples of 2^-50.

    Zeros and ones become exact, so that the symbols stay sparse, and the last bits in which the sines
    of two machines may differ are dropped.
    """
    return np.round(matrix * 2.0**50) * 2.0**-50


def unit(vector: tuple[float, float, float]) -> Array:
    """The vector over its length, (3)."""
    found = np.array(vector, dtype=float)
    return np.asarray(found / np.sqrt((found * found).sum()))


def rotation_from_rpy(rpy: tuple[float, float, float]) -> Array:
    """R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3), from roll, pitch, yaw [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return snap(
        np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )
    )


def place_of(frame: Frame | Tip) -> Placement:
    """The placement a spec's frame stands for."""
    return Placement(rotation_from_rpy(frame.rpy), np.array(frame.xyz, dtype=float))


def inertia_of(mass: float, com: tuple[float, ...], moments: tuple[float, ...]) -> Inertia:
    """From a spec's numbers (inertia about the CoM) to one about the link frame's origin."""
    xx, yy, zz, xy, xz, yz = moments
    c = np.array(com, dtype=float)
    about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Inertia(mass, mass * c, about_com + mass * (float((c * c).sum()) * np.eye(3) - np.outer(c, c)))


def build_tree(robot: Robot) -> Tree:
    """Flatten a robot: active joints become bodies, fixed ones are welded to their carrier."""
    children: dict[str, list[Link]] = {}
    for link in robot.links:
        parent = "base" if link.parent == robot.base.name else link.parent
        children.setdefault(parent, []).append(link)
    welded: list[Inertia] = [inertia_of(robot.base.mass, robot.base.com, robot.base.inertia)]
    drafts: list[tuple[Link, int, Placement]] = []
    frames: dict[str, TipFrame] = {"base": TipFrame(-1, Placement(np.eye(3), np.zeros(3)))}
    frames[robot.base.name] = frames["base"]
    stack = list(reversed(children.get("base", [])))
    while stack:
        link = stack.pop()
        carrier = frames[link.parent]
        place = carrier.place.then(place_of(link.at))
        own = inertia_of(link.mass, link.com, link.inertia)
        if link.joint.type == "fixed":
            frames[link.name] = TipFrame(carrier.body, place)
            welded[carrier.body + 1] = welded[carrier.body + 1].plus(own.moved(place))
        else:
            drafts.append((link, carrier.body, place))
            welded.append(own)
            frames[link.name] = TipFrame(len(drafts) - 1, Placement(np.eye(3), np.zeros(3)))
        stack.extend(reversed(children.get(link.name, [])))
    bodies = tuple(
        Body(
            link.joint.name,
            parent,
            place,
            link.joint.type == "prismatic",
            snap(unit(link.joint.axis)),
            inertia,
        )
        for (link, parent, place), inertia in zip(drafts, welded[1:], strict=True)
    )
    limits = [link.joint.position or (-np.inf, np.inf) for link, _, _ in drafts]
    speeds = [np.inf if link.joint.speed is None else link.joint.speed for link, _, _ in drafts]
    tips = {
        name: TipFrame(frames[tip.link].body, frames[tip.link].place.then(place_of(tip)))
        for name, tip in robot.tips.items()
    }
    return Tree(
        welded[0],
        robot.base.floating,
        bodies,
        tips,
        np.array(limits, dtype=float).reshape(-1, 2),
        np.array(speeds, dtype=float),
        _solids(robot, frames),
        np.array([np.inf if link.joint.effort is None else link.joint.effort for link, _, _ in drafts], dtype=float),
        np.array([_friction_of(link) for link, _, _ in drafts], dtype=float).reshape(-1, 3),
    )


def _friction_of(link: Link) -> tuple[float, float, float]:
    found = link.joint.friction or Friction()
    return found.viscous, found.coulomb, found.smoothing


def _solids(robot: Robot, frames: dict[str, TipFrame]) -> tuple[BodySolid, ...]:
    """The base's solids, then the links' in file order, each in its body's frame."""
    found = [BodySolid(robot.base.name, -1, shape) for shape in robot.base.collision]
    for link in robot.links:
        frame = frames[link.name]
        turn, shift = frame.place.rotation, frame.place.translation
        found += [BodySolid(link.name, frame.body, placed(shape, turn, shift)) for shape in link.collision]
    return tuple(found)
