"""Chain points of a serial arm: one point on every hinge's axis, so that each link is square to its hinge.

Dong et al. 2022 choose them by hand for the UR5; here they follow from any robot's definition.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.composite import BaseFrame
from fzcli.model.tree import Tree, times

Array = NDArray[np.float64]
TOUCHING = 1e-9  # a point this close to an axis is on it [m]


@dataclass(frozen=True)
class Chain:
    """The m hinges that move a tip, and the points p_1..p_m on their axes; p_{m+1} is the tip.

    From the tip down, p_i is the foot of p_{i+1} on axis i: it is fixed in the links on both sides, every
    link has a constant length and stands square to its hinge. ``joints`` (m): their numbers among the
    robot's. ``along`` (m): place of p_i on its axis, from the joint's origin [m]. ``lengths`` (m) [m].
    ``square``: hinge m runs along link m-1. ``approach``: the tip's z points along the last link.
    ``free``: number of a last joint whose axis carries the tip, so that it only rolls it; -1 without one.
    ``free_sense``: +1 where its axis points along the tip's z, -1 against it, else 0.
    ``reach``: (nearest, farthest) distance [m] that the tip could have, were the hinges ball joints, from
    the system's CoM on a floating base (its virtual manipulator, Vafa and Dubowsky 1990), else from p_1.
    """

    joints: tuple[int, ...]
    along: Array
    lengths: Array
    square: bool
    approach: bool
    free: int
    free_sense: int
    reach: tuple[float, float]

    @property
    def hinges(self) -> int:
        """m, the number of hinges that move the tip."""
        return len(self.joints)

    def points(self, frame: BaseFrame, tip: ca.SX) -> tuple[ca.SX, ca.SX]:
        """p_1..p_{m+1} (3, m+1) from the base frame's origin [m] and hinge axes (3, m), base axes."""
        columns = [frame.columns[j] for j in self.joints]
        points = [c.origin + (float(t) * c.axis if t else 0.0) for c, t in zip(columns, self.along, strict=True)]
        return ca.horzcat(*points, tip), ca.horzcat(*(c.axis for c in columns))


def build_chain(tree: Tree, tip: str) -> Chain:
    """The chain points of the joints that carry ``tip``.

    Raises SpecError naming the joint that slides or has no foot point, and for fewer than two hinges.
    """
    place = tree.tips[tip]
    path = tree.ancestors(place.body)
    for j in path:
        if tree.bodies[j].prismatic:
            raise _refused(f"joint {tree.bodies[j].joint!r} slides: chain points need hinges")
    rotations, origins = _resting(tree, path)
    axes = {j: times(rotations[j], tree.bodies[j].axis[:, None])[:, 0] for j in path}
    if path:
        last = path[-1]
        end = origins[last] + times(rotations[last], place.place.translation[:, None])[:, 0]
        z = times(rotations[last], place.place.rotation)[:, 2]
    free = path[-1] if path and _off_axis(end - origins[last], axes[last]) < TOUCHING else -1
    hinges = path[:-1] if free >= 0 else path
    if len(hinges) < 2:
        raise _refused(f"tip {tip!r} is moved by {len(hinges)} hinge(s): chain points need at least 2")
    points = [end]
    for j in reversed(hinges):
        points.insert(0, origins[j] + axes[j] * float(axes[j] @ (points[0] - origins[j])))
    links = np.diff(np.array(points), axis=0)
    lengths = np.sqrt((links * links).sum(axis=1))
    if lengths[-1] < TOUCHING:
        raise _refused(
            f"joint {tree.bodies[hinges[-1]].joint!r} has no foot point: "
            "its axis passes through the tip, as the next one's does"
        )
    along = np.array([axes[j] @ (p - origins[j]) for j, p in zip(hinges, points[:-1], strict=True)])
    along[np.abs(along) < 1e-12] = 0.0
    before, hinge = links[-2], axes[hinges[-1]]
    return Chain(
        joints=tuple(hinges),
        along=along,
        lengths=lengths,
        square=bool(lengths[-2] > TOUCHING and _off_axis(before, hinge) < TOUCHING),
        approach=bool(np.abs(links[-1] / lengths[-1] - z).max() < TOUCHING),
        free=free,
        free_sense=round(float(axes[free] @ z)) if free >= 0 else 0,
        reach=_reach(tree, path, points, rotations, origins) if tree.floating else _span(lengths),
    )


def _refused(text: str) -> SpecError:
    return SpecError(Problem(text, field="robot"))


def _off_axis(vector: Array, axis: Array) -> float:
    return float(np.linalg.norm(vector - axis * (axis @ vector)))


def _resting(tree: Tree, path: list[int]) -> tuple[dict[int, Array], dict[int, Array]]:
    """Rotations (3, 3) and origins (3) of the bodies on a path, base axes, all joints at 0."""
    rotations: dict[int, Array] = {-1: np.eye(3)}
    origins: dict[int, Array] = {-1: np.zeros(3)}
    for j in path:
        body = tree.bodies[j]
        carrier = rotations[body.parent]
        rotations[j] = times(carrier, body.place.rotation)
        origins[j] = origins[body.parent] + times(carrier, body.place.translation[:, None])[:, 0]
    return rotations, origins


def _reach(
    tree: Tree, path: list[int], points: list[Array], rotations: dict[int, Array], origins: dict[int, Array]
) -> tuple[float, float]:
    """Bounds of the tip's distance from the CoM: lengths of the virtual manipulator's links.

    Tip - CoM = sum over the bodies of v_j = o_j (mass up to j) / M - m_j c_j / M, with o_j from a body's
    inner to its outer joint point and c_j from the inner one to its CoM; v_j is fixed in body j. Not bounded
    where other joints than the tip's own move masses.
    """
    if len(tree.bodies) > len(path):
        return 0.0, np.inf
    inner = [np.zeros(3), *points[:-1], *([points[-1]] if len(path) == len(points) else [])]
    outer = [*inner[1:], points[-1]]
    inertias = [tree.base, *(tree.bodies[j].inertia for j in path)]
    lengths, mass = [], 0.0
    for j, a, o, own in zip([-1, *path], inner, outer, inertias, strict=True):
        mass += own.mass
        moment = times(rotations[j], own.first_moment[:, None])[:, 0] + own.mass * (origins[j] - a)
        lengths.append(float(np.linalg.norm((o - a) * mass - moment)) / tree.mass)
    return _span(np.array(lengths))


def _span(lengths: Array) -> tuple[float, float]:
    """Nearest and farthest distance between the ends of a chain of ball joints."""
    total = float(lengths.sum())
    return max(0.0, 2.0 * float(lengths.max()) - total), total
