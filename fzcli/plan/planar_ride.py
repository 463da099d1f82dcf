"""How the platform of a planar 3-RRR is carried along by a joint path: forward kinematics, continued in time."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.collision import many
from fzcli.model.planar_body import PlanarBody
from fzcli.plan.built import part_of
from fzcli.plan.world import Path

Array = NDArray[np.float64]
PIECE = 0.01  # rad: the most that a joint turns from knot to knot
FEWEST = 256  # knots; their number is this times a power of two, so that few Functions are made
NEWTON = 4  # steps a knot
CLOSED = 1e-11  # m: of the legs' lengths
LEAP = 0.5  # platform radii or rad: no knot leads the platform this far


@dataclass(frozen=True)
class PlanarRide:
    """Poses of the platform on a path from a known pose.

    ``knots`` (K) [s] and ``poses`` (K, 3) there; ``lost`` [s]: from here on the platform has no pose on its
    branch, because det A vanishes on the way; infinite where all is well.
    """

    body: PlanarBody
    path: Path
    knots: Array
    poses: Array
    lost: float

    def at(self, time: Array) -> Array:
        """x, y [m] and angle [rad] (T, 3) at times (T,); NaN where it is lost."""
        theta = self.path.at(time)[0]
        near = np.searchsorted(0.5 * (self.knots[1:] + self.knots[:-1]), time)
        poses = self.poses[near].copy()
        for _ in range(NEWTON):
            poses = many(self.body.model.function("newton"), poses, theta)[0]
        poses[time >= self.lost] = np.nan
        return poses


def ride_of(body: PlanarBody, path: Path, pose: Array) -> PlanarRide:
    """The ride of the platform from its pose (3) at the path's start."""
    turned = float(path.speed_bound(0.0, path.duration).max()) * path.duration
    count = FEWEST
    while count * PIECE < turned and count < 64 * FEWEST:
        count *= 2
    knots = np.linspace(0.0, path.duration, count + 1)
    theta = path.at(knots)[0]
    follow = part_of(body.tree, ("follow", count), lambda: _follow(body, count))
    poses = np.vstack([pose, np.array(follow(pose, theta[1:].T)).T])
    return PlanarRide(body, path, knots, poses, _lost(body, knots, poses, theta))


def _follow(body: PlanarBody, count: int) -> ca.Function:
    """(pose (3), thetas (3, count)) -> poses (3, count), each by Newton's method from the one before."""
    newton = body.model.function("newton")
    pose, theta = ca.MX.sym("pose", 3), ca.MX.sym("theta", 3)
    found = pose
    for _ in range(NEWTON):
        found = newton(found, theta)
    step = ca.Function("step", [pose, theta], [found, found], ["pose", "theta"], ["next", "found"])
    run = step.mapaccum(count)
    start, thetas = ca.MX.sym("pose", 3), ca.MX.sym("thetas", 3, count)
    return ca.Function("follow", [start, thetas], [run(start, thetas)[1]])


def _lost(body: PlanarBody, knots: Array, poses: Array, theta: Array) -> float:
    """The first knot [s] that is not reached on the branch: legs not closed, a leap, or another sign of det A."""
    model = body.model
    with np.errstate(invalid="ignore"):
        closure = np.abs(many(model.function("closure"), poses, theta)[0]).max(axis=1)
        unit = np.array([model.robot.platform.radius, model.robot.platform.radius, 1.0])
        leaps = np.concatenate([[0.0], np.abs(np.diff(poses, axis=0) / unit).max(axis=1)])
        sign = np.sign(model.measures(poses, theta)[:, 3])
        good = (closure < CLOSED) & (leaps < LEAP) & (sign == sign[0])
    return np.inf if good.all() else float(knots[int(np.argmin(good))])
