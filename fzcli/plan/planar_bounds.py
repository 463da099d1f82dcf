"""How far a planar 3-RRR can get within a short time: a bound on its platform's way, from the joints' speeds.

At a posture let A be the Jacobian for unit directions and the platform's radius as unit of length, s its smallest
singular value, and y the pose in these units: A y' = l1 (sines) theta' / radius, each sine at most 1. While y stays
within r of where it is, A changes by at most D(r), so that |y'| <= l1 |theta'| / radius / (s - D(r)). Where that
speed does not lead as far as r in the time that there is, y stays within r: no singularity is met, and all solids
move by little.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import Clearance, many
from fzcli.model.planar_3rrr import Planar3RRRModel
from fzcli.model.planar_body import PlanarBody
from fzcli.plan.continuous import Stretches
from fzcli.plan.scene import Scene
from fzcli.plan.world import Path

Array = NDArray[np.float64]
STILL = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
ROUNDS = 30  # of widening r until it holds
WIDER = 1.0001  # than the fixed point
FAR = 10.0  # rad and m: stands for unbounded where numbers must be finite


@dataclass(frozen=True)
class Reach:
    """What can change within times (T,): pose by ``way`` (platform radii), directions of rods and joints (T, 3) [rad].

    Infinite where no bound is found: a singularity may be near.
    """

    way: Array
    rods: Array
    joints: Array

    def of_measures(self) -> Array:
        """By how much the sines of the elbows and det A can change, (T, 4)."""
        sines = self.rods + self.joints
        rows = np.sqrt(self.rods**2 + (self.rods + self.way[:, None]) ** 2)
        return np.column_stack([sines, 2.0 * rows.sum(axis=1)])  # each row of A is at most sqrt(2) long

    def of_tree(self, radius: float) -> Array:
        """By how much the joints of the open tree can change, (T, 9) [rad, m]."""
        legs = np.stack([self.joints, self.rods + self.joints], axis=2).reshape(len(self.way), 6)
        return np.column_stack([legs, radius * self.way, radius * self.way, self.way])


def reach_of(model: Planar3RRRModel, poses: Array, theta: Array, turns: Array) -> Reach:
    """The reach from poses (T, 3) at joint angles (T, 3) while the driven joints turn by at most ``turns`` (T, 3)."""
    legs, unit = model.robot.legs, model.robot.platform.radius
    smallest = _smallest(model, poses, theta)
    push = legs.proximal / unit * np.linalg.norm(turns, axis=1)

    def rods_at(way: Array) -> Array:
        chord = unit * np.sqrt(2.0) * way[:, None] + legs.proximal * turns
        return np.asarray(2.0 * np.arcsin(np.minimum(chord / (2.0 * legs.distal), 1.0)))

    def needed(way: Array) -> Array:
        rods = rods_at(way)
        change = np.sqrt((rods**2 + (rods + way[:, None]) ** 2).sum(axis=1))
        left = smallest - change
        return np.where(left > 0, push / np.maximum(left, 1e-300), np.inf)

    way = needed(np.zeros(len(push)))
    for _ in range(ROUNDS):
        way = WIDER * needed(np.minimum(way, FAR))
    held = np.isfinite(way) & (way < FAR)
    held &= np.where(held, needed(np.minimum(way, FAR)), np.inf) <= way
    way = np.where(held, way, np.inf)
    return Reach(way, np.where(held[:, None], rods_at(np.minimum(way, FAR)), np.inf), turns)


def _smallest(model: Planar3RRRModel, poses: Array, theta: Array) -> Array:
    """(T,) smallest singular value of A for unit directions, the platform's radius as unit of length."""
    robot = model.robot
    columns = many(model.function("jacobians"), poses, theta)[0].reshape(len(poses), 3, 3)  # A's columns are rows here
    scaled = columns / robot.legs.distal / np.array([1.0, 1.0, robot.platform.radius])[:, None]
    return np.asarray(np.linalg.svd(scaled, compute_uv=False)[:, -1])


class PlanarBounds:
    """Distances from obstacles and from singularities at the middles of stretches, and how far each can change.

    ``columns``: (theta (T, 3), poses (T, 3), times (T,)) -> distances (T, m): the scene's pairs of ``clearance``,
    then the four singularity measures as lengths, ``unit`` [m] for 1. ``ride``: times -> poses, NaN where lost.
    """

    def __init__(
        self,
        body: PlanarBody,
        clearance: Clearance,
        path: Path,
        scene: Scene,
        ride: Callable[[Array], Array],
        columns: Callable[[Array, Array, Array], Array],
        unit: float,
        between: tuple[float, float],
    ) -> None:
        self.body, self.clearance, self.path, self.scene = body, clearance, path, scene
        self.ride, self.columns, self.unit = ride, columns, unit
        self.start, cells = Stretches.between(*between)
        self.joints = np.array([path.speed_bound(*cell) for cell in cells])
        self.obstacles = np.array([scene.speed_bounds(*cell) for cell in cells])

    def at(self, stretches: Stretches) -> tuple[Array, Array]:
        """Distances (T, m) and how far each can change (T, m), [m]."""
        time, half = stretches.middle, stretches.half[:, None]
        theta, poses = self.path.at(time)[0], self.ride(time)
        distances = self.columns(theta, poses, time)
        found = np.asarray(~np.isnan(poses).any(axis=1))
        turns = self.joints[stretches.cell] * half
        sure = np.where(found[:, None], poses, 0.0)
        reach = reach_of(self.body.model, sure, theta, turns)
        moves = np.where(np.isfinite(reach.way)[:, None], reach.of_tree(self.body.model.robot.platform.radius), 0.0)
        state = many(self.body.state, sure, theta)[0]
        shifts = self.obstacles[stretches.cell] * half
        solid = many(self.clearance.bounds, state, *STILL, self.scene.numbers(time), moves, [0.0], [0.0], shifts)[1]
        change = np.hstack([solid, self.unit * reach.of_measures()])
        change[~np.isfinite(reach.way)] = np.inf
        change[~found] = 0.0  # what is lost is as near as can be
        return distances, change
