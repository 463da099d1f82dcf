"""Chain points of a serial arm, FABRIK's forward stage and classic FABRIK, in plain NumPy.

Rows of ``points`` are p_1..p_{m+1}, the last one the tip; ``lengths[i]`` lies between rows i and i+1.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.spec.robot import Robot
from tests.oracle.numpy_reference import NumpyReference, active_joint_names, depth_first

Array = NDArray[np.float64]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
TOUCHING = 1e-9  # a point this close to an axis is on it [m]


def unit(v: Array) -> Array:
    """v (3,) scaled to length one; zero stays zero, so that a link without direction has no say."""
    length = float(np.linalg.norm(v))
    return v / length if length > 0.0 else v


def without(v: Array, axis: Array) -> Array:
    """v (3,) less its part along a unit axis (3,)."""
    return v - axis * (axis @ v)


def forward_stage(
    points: Array, lengths: Array, target: Array, direction: Array | None = None, square: bool = False
) -> Array:
    """p' (m+1, 3), from the tip down: p'_i = p'_{i+1} + l_i unit(p_i - p'_{i+1}).

    With a direction p'_m = X - l_m d; with ``square`` the next link is laid square to d.
    """
    m = len(lengths)
    reached = [target]
    for i in range(m - 1, -1, -1):
        away = points[i] - reached[0]
        if direction is not None and i == m - 1:
            away = -direction
        elif direction is not None and i == m - 2 and square:
            away = without(away, direction)
        reached.insert(0, reached[0] + lengths[i] * unit(away))
    return np.array(reached)


@dataclass(frozen=True)
class Classic:
    """Points (m+1, d) reached, iterations, distance left, and how far out of reach the target is [m]."""

    points: Array
    iterations: int
    error: float
    missing: float


def classic_iteration(points: Array, lengths: Array, target: Array) -> Array:
    """One forward and one backward pass of ball joints in d dimensions: (m+1, d) -> (m+1, d)."""
    reached = forward_stage(points, lengths, target)
    placed = [points[0]]
    for i, length in enumerate(lengths):
        placed.append(placed[i] + length * unit(reached[i + 1] - placed[i]))
    return np.array(placed)


def classic_fabrik(points: Array, target: Array, tolerance: float, limit: int = 100) -> Classic:
    """Iterate until the tip is within tolerance [m]; a target out of reach is not tried."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    distance, reach = float(np.linalg.norm(target - points[0])), float(lengths.sum())
    hole = 2.0 * float(lengths.max()) - reach
    missing = max(distance - reach, hole - distance, 0.0)
    count = 0
    while missing == 0.0 and np.linalg.norm(points[-1] - target) >= tolerance and count < limit:
        points, count = classic_iteration(points, lengths, target), count + 1
    return Classic(points, count, float(np.linalg.norm(points[-1] - target)), missing)


@dataclass(frozen=True)
class Chain:
    """A serial arm as hinges and points, and the limits of its n joints.

    ``local`` (m, 3): p_1..p_m in the frames of ``carriers``, the links behind the joints. ``lengths``
    (m,). ``square``: hinge m runs along link m-1, so that link stays square to the last one.
    ``approach``: the tip's z is the last link's direction. lower, upper [rad], speed [rad/s]: (n,).
    """

    body: NumpyReference
    carriers: tuple[str, ...]
    local: Array
    axes: Array
    lengths: Array
    square: bool
    approach: bool
    lower: Array
    upper: Array
    speed: Array

    @property
    def hinges(self) -> int:
        """m, the number of joints that move the tip: n, or n - 1 with a free last joint."""
        return len(self.lengths)

    def at(self, q: Array) -> tuple[Array, Array]:
        """Points (m+1, 3) from the base frame's origin and hinge axes (m, 3), in base axes."""
        bodies = self.body.bodies(q, UPRIGHT)
        links = [bodies[name] for name in self.carriers[: self.hinges]]
        points = [b.origin + b.rotation @ p for b, p in zip(links, self.local, strict=True)]
        end = self.body.forward_kinematics(q, UPRIGHT)[0] + self.body.reference_point(q, UPRIGHT)
        return np.array([*points, end]), np.array([b.rotation @ a for b, a in zip(links, self.axes, strict=True)])


def chain_of(robot: Robot) -> Chain:
    """The chain points of a serial arm: from the tip down, p_i is the foot of p_{i+1} on axis i.

    p_{i+1} lies on axis i+1, so it is fixed in link i; its foot on axis i is fixed in link i too and,
    lying on that axis, in link i-1. So every link has a constant length and is square to its hinge,
    for parallel, crossing and skew axes alike. A last joint whose axis carries the tip is free. A foot
    may fall on its point (a link of length 0, as in a spherical wrist): that hinge then moves only
    points further out. Raises ValueError naming the joint that has no foot point.
    """
    body = NumpyReference(robot)
    links = [link for link in depth_first(robot) if link.joint.type != "fixed"]
    for link, parent in zip(depth_first(robot)[1:], depth_first(robot), strict=False):
        if link.parent != parent.name:
            raise ValueError(f"joint {link.joint.name!r} branches off: chain points need one serial arm")
    for link in links:
        if link.joint.type == "prismatic":
            raise ValueError(f"joint {link.joint.name!r} slides: chain points need hinges")
    start = body.bodies(np.zeros(body.n), UPRIGHT)
    position, turn = body.forward_kinematics(np.zeros(body.n), UPRIGHT)
    end = position + body.reference_point(np.zeros(body.n), UPRIGHT)
    axes = [start[link.name].rotation @ unit(np.array(link.joint.axis)) for link in links]
    origins = [start[link.name].origin for link in links]
    if np.linalg.norm(without(end - origins[-1], axes[-1])) < TOUCHING:
        links = links[:-1]
    if len(links) < 2:
        raise ValueError(f"{robot.name!r} has {len(links)} hinges that move the tip: at least 2 are needed")
    points = [end]
    for axis, origin in list(zip(axes, origins, strict=True))[len(links) - 1 :: -1]:
        points.insert(0, origin + axis * (axis @ (points[0] - origin)))
    if np.linalg.norm(points[-1] - points[-2]) < TOUCHING:
        name = links[-1].joint.name
        raise ValueError(f"joint {name!r} has no foot point: its axis passes through the tip, as the next one's does")
    return _chain(body, tuple(link.name for link in links), np.array(points), np.array(axes), turn[:, 2])


def _chain(body: NumpyReference, carriers: tuple[str, ...], points: Array, axes: Array, tip_z: Array) -> Chain:
    start, m = body.bodies(np.zeros(body.n), UPRIGHT), len(carriers)
    frames = [start[name] for name in carriers]
    along = np.diff(points, axis=0)
    joints = {link.joint.name: link.joint for link in body.robot.links}
    moving = [joints[name] for name in active_joint_names(body.robot)]
    limits = np.array([joint.position or (-np.inf, np.inf) for joint in moving])
    return Chain(
        body,
        carriers,
        np.array([b.rotation.T @ (p - b.origin) for b, p in zip(frames, points[:-1], strict=True)]),
        np.array([b.rotation.T @ a for b, a in zip(frames, axes[:m], strict=True)]),
        np.linalg.norm(along, axis=1),
        bool(np.linalg.norm(along[-2]) > TOUCHING and np.linalg.norm(np.cross(along[-2], axes[m - 1])) < TOUCHING),
        bool(np.linalg.norm(unit(along[-1]) - tip_z) < TOUCHING),
        limits[:, 0],
        limits[:, 1],
        np.array([np.inf if joint.speed is None else joint.speed for joint in moving]),
    )
