"""Where a plan of a planar 3-RRR happens: obstacles in its plane, and its own singularities, as distances."""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import Clearance, Pair, SelfPairs, build_clearance, many
from fzcli.model.planar_3rrr import Planar3RRRModel
from fzcli.model.planar_body import PlanarBody
from fzcli.plan.built import part_of
from fzcli.plan.continuous import PathClearance, Stretches, least_of
from fzcli.plan.planar_bounds import STILL, PlanarBounds
from fzcli.plan.planar_ride import PlanarRide, ride_of
from fzcli.plan.scene import Scene
from fzcli.plan.world import Path

Array = NDArray[np.float64]
SINGULARITIES = (
    *(Pair(f"leg {i}", "its stretched or folded posture (type I)", -1) for i in (1, 2, 3)),
    Pair("the platform", "a posture that the drives do not hold (type II, det A = 0)", -1),
)


@dataclass(frozen=True)
class Limits:
    """Of the driven joints: ``position_limits`` (3, 2) [rad] and ``speed_limits`` (3) [rad/s], infinite for none."""

    position_limits: Array
    speed_limits: Array


@dataclass(frozen=True)
class DrivenJoints:
    """The driven joints of a planar 3-RRR, as planners know a robot's joints."""

    planar: Planar3RRRModel
    floating = False

    @property
    def n(self) -> int:
        """Three."""
        return self.planar.n

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Of the driven joints."""
        return self.planar.joint_names

    @property
    def tree(self) -> Limits:
        """What the joints allow."""
        return Limits(self.planar.limits, self.planar.speeds)


@dataclass(frozen=True)
class PlanarClearance:
    """What is watched: pairs of the robot's solids and obstacles, by ``scene``, then the singularities."""

    scene: Clearance

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """All that has a distance, in the order of the columns."""
        return (*self.scene.pairs, *SINGULARITIES)

    @property
    def own(self) -> SelfPairs:
        """Legs and platform lie in planes of their own: they pass over each other."""
        return self.scene.own


@dataclass(frozen=True)
class PlanarWorld:
    """A planar 3-RRR at the start of a plan, joints ``start`` (3) [rad] and ``pose`` (3), among obstacles.

    What it calls distances are those from the obstacles [m], and beside them ``margin`` [m] + the distal link's
    length times what each singularity measure, positive on the branch, has above ``off_singular``: all of them
    keep the margin where the robot keeps it and stays off its singularities as far as is asked.
    """

    body: PlanarBody
    scene: Scene
    clearance: PlanarClearance
    start: Array
    pose: Array
    margin: float
    off_singular: float

    @property
    def model(self) -> DrivenJoints:
        """The joints that are planned for."""
        return DrivenJoints(self.body.model)

    @property
    def base_position(self) -> Array:
        """Of the base, which stands still, (3) [m]."""
        return np.array(STILL[0])

    @property
    def base_quat(self) -> Array:
        """Of the base, (4)."""
        return np.array(STILL[1])

    @property
    def unit(self) -> float:
        """The length [m] that stands for a singularity measure of 1."""
        return self.body.model.robot.legs.distal

    @cached_property
    def signs(self) -> Array:
        """Of the four singularity measures on the branch, (4)."""
        return np.asarray(np.where(self.body.model.measures(self.pose[None], self.start[None])[0] < 0, -1.0, 1.0))

    def ride(self, path: Path) -> PlanarRide:
        """Poses of the platform along a path from the start."""
        return ride_of(self.body, path, self.pose)

    def measures(self, poses: Array, theta: Array) -> Array:
        """The singularity measures (T, 4), positive on the branch: sines of the elbows, and det A, free of units."""
        return self.body.model.measures(poses, theta) * self.signs

    def columns(self, theta: Array, poses: Array, times: Array) -> Array:
        """What is called distances (T, m) at joint angles and poses (T, 3); where a pose is NaN, the last is -inf."""
        lost = np.asarray(np.isnan(poses).any(axis=1))
        sure = np.where(lost[:, None], self.pose, poses)
        state = many(self.body.state, sure, theta)[0]
        near = self.clearance.scene.at(state, self.scene.numbers(times))
        singular = self.margin + self.unit * (self.measures(sure, theta) - self.off_singular)
        found = np.hstack([near.reshape(len(theta), -1), singular])
        found[lost] = np.inf
        found[lost, -1] = -np.inf
        return found

    def among(self, scene: Scene) -> "PlanarWorld":
        """The same robot at the same start among other obstacles."""
        return build_planar_world(self.body, scene, self.start, self.pose, self.margin, self.off_singular)

    def distances(self, path: Path, times: Array) -> Array:
        """Of all pairs (T, m) [m] at times (T,) of a path from the start."""
        return self.columns(path.at(times)[0], self.ride(path).at(times), times)

    def certified(self, path: Path, begin: float, end: float, tolerance: float, enough: float) -> PathClearance:
        """The least of all distances between two times [s], at all times."""
        return least_of(self._bounds(path, begin, end), self.clearance.pairs, tolerance=tolerance, enough=enough)

    def certified_parts(self, path: Path, tolerance: float) -> tuple[PathClearance, PathClearance]:
        """The least distance [m] from obstacles on a whole path, and the least singularity measure."""
        bounds, count = self._bounds(path, 0.0, path.duration), len(self.clearance.scene.pairs)
        scene = PathClearance(np.inf, np.inf, 0.0, None, 0)
        if count:
            scene = least_of(_Part(bounds, slice(0, count)), self.clearance.scene.pairs, tolerance=tolerance)
        found = least_of(_Part(bounds, slice(count, None)), SINGULARITIES, tolerance=tolerance)
        both = np.array([found.clearance, found.at_least])
        least, sure = ((both - self.margin) / self.unit + self.off_singular).tolist()
        return scene, PathClearance(least, sure, found.time, found.pair, found.samples)

    def _bounds(self, path: Path, begin: float, end: float) -> PlanarBounds:
        ride = self.ride(path)
        return PlanarBounds(
            self.body, self.clearance.scene, path, self.scene, ride.at, self.columns, self.unit, (begin, end)
        )

    def least(self, q: Array, numbers: Array, position: Array, quat: Array) -> Array:
        """The smallest distance (T,) [m] at joint angles q (T, 3), led there straight from the start."""
        inputs = self.start, self.pose, q, numbers, self._asked(1.0)
        return many(self._part("least"), *inputs)[0][:, 0]

    def nearest(self, q: Array, numbers: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum (T,) [m] over all distances, never above the true one, and its derivative by q (T, 3)."""
        found = many(self._part("nearest"), self.start, self.pose, q, numbers, self._asked(sharpness))
        return found[0][:, 0], found[1]

    def _asked(self, sharpness: float) -> Array:
        return np.array([sharpness, self.margin, self.off_singular, *self.signs])

    def _part(self, name: str) -> ca.Function:
        return part_of(self.body.tree, (name, self.scene.kinds), lambda: _search_functions(self)[name])


def _search_functions(world: PlanarWorld) -> dict[str, ca.Function]:
    """ "least" and "nearest": (start, pose, q, numbers, asked) -> distance, and its derivative by q."""
    body, near = world.body, world.clearance.scene.distances
    theta, pose = ca.SX.sym("theta", 3), ca.SX.sym("pose", 3)
    numbers, asked = ca.SX.sym("numbers", near.size1_in("obstacles")), ca.SX.sym("asked", 7)
    sharpness, margin, off, signs = asked[0], asked[1], asked[2], asked[3:]
    measures = body.model.function("singularity")(pose, theta) * signs
    closure = body.model.function("closure")(pose, theta)
    apart = near(body.state(pose, theta), ca.SX(ca.DM(STILL[0])), ca.SX(ca.DM(STILL[1])), numbers)
    columns = ca.vertcat(apart, margin + world.unit * (measures - off) - ca.sqrt(ca.sumsqr(closure) + 1e-24))
    least = ca.mmin(columns)
    soft = least - ca.log(ca.sum1(ca.exp(-sharpness * (columns - least)))) / sharpness
    slope = ca.gradient(soft, theta) + ca.mtimes(body.by_joints(pose, theta).T, ca.gradient(soft, pose))
    inner = ca.Function("inner", [theta, pose, numbers, asked], ca.cse([least, soft, ca.densify(slope)]))
    inputs = [ca.MX.sym(name, size) for name, size in (("start", 3), ("pose", 3), ("q", 3))]
    inputs += [ca.MX.sym("numbers", numbers.shape[0]), ca.MX.sym("asked", 7)]
    found = inner(inputs[2], body.assembled(inputs[1], inputs[0], inputs[2]), *inputs[3:])
    return {
        "least": ca.Function("least", inputs, [found[0]]),
        "nearest": ca.Function("nearest", inputs, [found[1], found[2]]),
    }


@dataclass(frozen=True)
class _Part:
    """Some columns of some bounds."""

    bounds: PlanarBounds
    columns: slice

    @property
    def start(self) -> Stretches:
        return self.bounds.start

    def at(self, stretches: Stretches) -> tuple[Array, Array]:
        distances, change = self.bounds.at(stretches)
        return distances[:, self.columns], change[:, self.columns]


def build_planar_world(
    body: PlanarBody, scene: Scene, start: Array, pose: Array, margin: float, off_singular: float
) -> PlanarWorld:
    """What it builds for a robot and kinds of obstacles serves its other worlds as well."""
    key = ("clearance", scene.kinds, scene.names)
    nothing = SelfPairs((), ())
    own = part_of(body.tree, key, lambda: build_clearance(body.tree, scene.kinds, scene.names, nothing))
    return PlanarWorld(body, scene, PlanarClearance(own), start, pose, margin, off_singular)
