"""How far a robot's solids can move while its joints move a little: bounds that hold for every motion between.

From posture q, let joint 1 move first, then joint 2, and so on: joint j turns all that it carries, which still
stands to its axis as at q, by dq_j. So no point goes farther than the sum of |dq_j| times its distance from
axis j at q. The bound needs no posture but q, and at q it is exact to first order for one joint.
"""

from collections.abc import Sequence
from itertools import product
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, dot, rotate
from fzcli.model.composite import BaseFrame
from fzcli.model.tree import Tree, rotation_from_rpy
from fzcli.spec.shapes import CapsuleShape, Shape, SphereShape

Array = NDArray[np.float64]


class Watched(Protocol):
    """A pair of solids: a robot's, and an obstacle or another of the robot's (then ``obstacle`` is -1)."""

    @property
    def solid(self) -> int: ...
    @property
    def second(self) -> int: ...
    @property
    def obstacle(self) -> int: ...


def displacements(
    tree: Tree,
    frame: BaseFrame,
    pairs: Sequence[Watched],
    dq: ca.SX,
    base_shift: ca.SX,
    base_turn: ca.SX,
    obstacle_shift: ca.SX,
) -> ca.SX:
    """By how much each pair's distance can change, (m) [m], for moves of at most dq (n) >= 0, ... (`Clearance`)."""
    center = ca.SX(ca.DM(base_center(tree)))
    points = [[_placed(point, frame, solid.body) for point in _points(solid.shape)] for solid in tree.solids]
    arms = _Arms(tree, frame, points)
    found = []
    for pair in pairs:
        index = pair.solid if pair.obstacle >= 0 else pair.second
        joints = set(tree.ancestors(tree.solids[index].body))
        if pair.obstacle < 0:  # seen from the one solid, only the joints between them move the other
            joints ^= set(tree.ancestors(tree.solids[pair.solid].body))
        farthest = ca.SX(0)
        for k, place in enumerate(points[index]):
            way = ca.SX(0)
            for j in joints:
                way = way + dq[j] * arms.of(index, k, j)
            if pair.obstacle >= 0:
                way = way + base_turn * _length(place - center)
            farthest = ca.fmax(farthest, way)
        if pair.obstacle >= 0:
            farthest = farthest + base_shift + obstacle_shift[pair.obstacle]
        found.append(farthest)
    return ca.densify(ca.vertcat(*found)) if found else ca.SX.zeros(0, 1)


class _Arms:
    """Distances of the solids' points from joint axes, each written once; 1 for a joint that slides."""

    def __init__(self, tree: Tree, frame: BaseFrame, points: list[list[ca.SX]]) -> None:
        self.tree, self.frame, self.points = tree, frame, points
        self.known: dict[tuple[int, int, int], ca.SX | float] = {}

    def of(self, solid: int, point: int, joint: int) -> ca.SX | float:
        """The arm [m] of a solid's point about a joint."""
        key = (solid, point, joint)
        if key not in self.known:
            column = self.frame.columns[joint]
            across = cross(column.axis, self.points[solid][point] - column.origin)
            self.known[key] = 1.0 if self.tree.bodies[joint].prismatic else _length(across)
        return self.known[key]


def _points(shape: Shape) -> list[Array]:
    """The points whose hull, grown by a radius, is the solid: no other point of it moves farther than they do."""
    solid = shape.solid
    if isinstance(solid, SphereShape):
        return [np.array(solid.center)]
    if isinstance(solid, CapsuleShape):
        return [np.array(solid.start), np.array(solid.end)]
    turn, half = rotation_from_rpy(solid.rpy), 0.5 * np.array(solid.size)
    return [np.array(solid.center) + turn @ (np.array(signs) * half) for signs in product((-1, 1), repeat=3)]


def _placed(point: Array, frame: BaseFrame, body: int) -> ca.SX:
    own = ca.SX(ca.DM(point))
    return frame.origins[body] + rotate(frame.rotations[body], own) if body >= 0 else own


def _length(vector: ca.SX) -> ca.SX:
    return ca.sqrt(dot(vector, vector))


def base_center(tree: Tree) -> Array:
    """The base body's CoM in its frame, (3) [m]; the origin for one without mass."""
    return tree.base.first_moment / tree.base.mass if tree.base.mass else np.zeros(3)


class BaseSpeedBound:
    """How fast a free base can move, at most, for joints of given speeds, at any posture and zero momentum.

    The kinetic energy is then the least that any base motion gives with these joint rates, so not above that with
    the base at rest, 2T <= E. Momentum and angular momentum about the base's CoM are those of the links
    reversed: by Cauchy and Schwarz (m0 v)^2 <= m (E - m0 v^2) with m their mass, and |I0 w|^2 <= G (E - w.I0 w)
    with G the most that their moment about the base's CoM can be.

    Raises:
        SpecError: a sliding joint without limits, which may carry its links any distance away.
    """

    def __init__(self, tree: Tree) -> None:
        n = len(tree.bodies)
        self.masses = np.array([body.inertia.mass for body in tree.bodies])
        self.arms = np.zeros((n, n))  # [k, j]: farthest that the CoM of body k can be from axis j
        self.turning = np.zeros((n, n))
        self.moments = np.zeros(n)
        far = []  # that each CoM can be from the base's origin
        for k, body in enumerate(tree.bodies):
            mass, first = body.inertia.mass, body.inertia.first_moment
            com = first / mass if mass else np.zeros(3)
            about = body.inertia.tensor - mass * (com @ com * np.eye(3) - np.outer(com, com))
            self.moments[k] = float(np.linalg.eigvalsh(about)[-1])
            reach = float(np.linalg.norm(com))
            for j in reversed(tree.ancestors(k)):
                prismatic = tree.bodies[j].prismatic
                self.arms[k, j] = 1.0 if prismatic else reach
                self.turning[k, j] = 0.0 if prismatic else 1.0
                reach += float(np.linalg.norm(tree.bodies[j].place.translation))
                reach += _stroke(tree, j) if prismatic else 0.0
            far.append(reach)
        com = base_center(tree)
        about = tree.base.tensor - tree.base.mass * (com @ com * np.eye(3) - np.outer(com, com))
        moment, mass = float(np.linalg.eigvalsh(about)[0]), tree.base.mass
        spread = float((self.moments + self.masses * (np.array(far) + np.linalg.norm(com)) ** 2).sum())
        links = float(self.masses.sum())
        self.shares = links / (mass * (mass + links)), spread / (moment * (moment + spread))

    def __call__(self, speeds: Array) -> tuple[Array, Array]:
        """Speed of the base's CoM [m/s] and its angular speed [rad/s], (...), for joint speeds (..., n)."""
        linear = (self.masses * (speeds @ self.arms.T) ** 2).sum(axis=-1)
        angular = (self.moments * (speeds @ self.turning.T) ** 2).sum(axis=-1)
        energy = linear + angular
        return np.sqrt(energy * self.shares[0]), np.sqrt(energy * self.shares[1])


def _stroke(tree: Tree, joint: int) -> float:
    stroke = float(np.abs(tree.position_limits[joint]).max())
    if not np.isfinite(stroke):
        name = tree.bodies[joint].joint
        text = f"joint '{name}' slides without limits: nothing bounds the base's motion"
        raise SpecError(Problem(text, field="robot"))
    return stroke
