"""Where a plan happens: the robot, its base at the start, and the scene; distances along whole joint paths."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.collision import Clearance, Pair, SelfPairs, build_clearance, many, self_pairs, turned_by
from fzcli.plan.base_ride import Path, build_ride
from fzcli.plan.built import part_of
from fzcli.plan.continuous import Motion, PathClearance, path_clearance
from fzcli.plan.scene import Scene

__all__ = ["AnyWorld", "Path", "World", "build_world"]

Array = NDArray[np.float64]


class _Limits(Protocol):
    @property
    def position_limits(self) -> Array: ...
    @property
    def speed_limits(self) -> Array: ...


class _Joints(Protocol):
    @property
    def n(self) -> int: ...
    @property
    def joint_names(self) -> tuple[str, ...]: ...
    @property
    def floating(self) -> bool: ...
    @property
    def tree(self) -> _Limits: ...


class _Watched(Protocol):
    @property
    def pairs(self) -> tuple[Pair, ...]: ...
    @property
    def own(self) -> SelfPairs: ...


class AnyWorld(Protocol):
    """What planners ask of the place where a plan happens, whatever the robot; see `World`."""

    @property
    def model(self) -> _Joints: ...
    @property
    def scene(self) -> Scene: ...
    @property
    def clearance(self) -> _Watched: ...
    @property
    def base_position(self) -> Array: ...
    @property
    def base_quat(self) -> Array: ...
    def among(self, scene: Scene) -> "AnyWorld": ...
    def distances(self, path: Path, times: Array) -> Array: ...
    def certified(self, path: Path, begin: float, end: float, tolerance: float, enough: float) -> PathClearance: ...
    def least(self, q: Array, numbers: Array, position: Array, quat: Array) -> Array: ...
    def nearest(self, q: Array, numbers: Array, sharpness: float) -> tuple[Array, Array]: ...


@dataclass(frozen=True)
class World:
    """A robot at the start of a plan among the obstacles of a scene.

    ``base_position`` (3) [m], ``base_quat`` (4) of the base frame at the start, at rest. A free base follows the
    joints by momentum, whatever the timing.
    """

    model: RobotModel
    scene: Scene
    clearance: Clearance
    base_position: Array
    base_quat: Array

    def base(self, path: Path, times: Array) -> tuple[Array, Array]:
        """Position (T, 3) [m] and attitude (T, 4) of the base frame at times (T,) of a path."""
        return self.carrier(path)(times)

    def carrier(self, path: Path) -> Callable[[Array], tuple[Array, Array]]:
        """`base` of a path that is asked for more than once."""
        if not self.model.floating:
            return lambda times: (
                np.tile(self.base_position, (len(times), 1)),
                np.tile(self.base_quat, (len(times), 1)),
            )
        ride, com = build_ride(self.model, path, self.base_quat), self.com(path.at(np.zeros(1))[0][0])

        def poses(times: Array) -> tuple[Array, Array]:
            quats = ride.at(times)
            return com - many(self.model.function("com"), path.at(times)[0], quats)[0], quats

        return poses

    def com(self, start: Array) -> Array:
        """The system's CoM (3) [m], which stays where it is at the start of a path, joints at ``start`` (n)."""
        return np.asarray(_column(self.model.com(start, self.base_quat)) + self.base_position)

    def distances(self, path: Path, times: Array) -> Array:
        """Of all pairs (T, m) [m] at times (T,) of a path."""
        position, quat = self.base(path, times)
        return self.clearance.at(path.at(times)[0], self.scene.numbers(times), position, quat)

    def among(self, scene: Scene) -> "World":
        """The same robot at the same start among other obstacles."""
        return build_world(self.model, scene, self.base_position.tolist(), self.base_quat.tolist())

    def certified(self, path: Path, begin: float, end: float, tolerance: float, enough: float) -> PathClearance:
        """The least distance between two times [s] of a path, at all times; above ``enough`` [m] nobody asks."""
        motion = Motion(self.model, path, self.scene, self.carrier(path))
        return path_clearance(self.clearance, motion, begin, end, tolerance=tolerance, enough=enough)

    def least(self, q: Array, numbers: Array, position: Array, quat: Array) -> Array:
        """The smallest distance (T,) [m] of all pairs, obstacles and base as told, each one for all or one a row."""
        return many(self._part("least", _least), q, numbers, position, quat)[0][:, 0]

    def nearest(self, q: Array, numbers: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum (T,) [m] over all pairs, never above the true one, and its derivative by q (T, n).

        The base stands where it starts. ``numbers`` (T, k) of the obstacles, see `Scene.numbers`. ``sharpness``
        [1/m]: off by log(pairs)/sharpness at the most.
        """
        found = many(self._part("nearest", _nearest), q, numbers, self.base_position, self.base_quat, [sharpness])
        return found[0][:, 0], found[1]

    def nearest_afloat(
        self, q: Array, numbers: Array, com: Array, quat: Array, sharpness: float
    ) -> tuple[Array, Array, Array]:
        """The same on a free base of attitudes (T, 4) about the CoM (3), and its derivative by the base's turn (T, 3).

        The base frame's origin follows; turns are in world axes.
        """
        found = many(self._part("nearest afloat", _nearest_afloat), q, numbers, com, quat, [sharpness])
        return found[0][:, 0], found[1], found[2]

    def _part(self, name: str, build: Callable[["World"], ca.Function]) -> ca.Function:
        return part_of(self.model, (name, self.scene.kinds), lambda: build(self))


def _least(world: World) -> ca.Function:
    q, position, quat, obstacles = _symbols(world.clearance)
    least = ca.mmin(world.clearance.distances(q, position, quat, obstacles))
    return ca.Function("least", [q, obstacles, position, quat], ca.cse([least]))


def _nearest(world: World) -> ca.Function:
    q, position, quat, obstacles = _symbols(world.clearance)
    sharpness = ca.SX.sym("sharpness")
    soft = _soft(world.clearance.distances(q, position, quat, obstacles), sharpness)
    outputs = [soft, ca.densify(ca.gradient(soft, q))]
    return ca.Function("nearest", [q, obstacles, position, quat, sharpness], ca.cse(outputs))


def _nearest_afloat(world: World) -> ca.Function:
    q, com, quat, obstacles = _symbols(world.clearance)
    sharpness = ca.SX.sym("sharpness")
    position = com - world.model.com(q, quat)
    soft = _soft(world.clearance.distances(q, position, quat, obstacles), sharpness)
    by_turn = ca.mtimes(turned_by(quat).T, ca.gradient(soft, quat))
    outputs = [soft, ca.densify(ca.gradient(soft, q)), ca.densify(by_turn)]
    return ca.Function("nearest_afloat", [q, obstacles, com, quat, sharpness], ca.cse(outputs))


def _symbols(clearance: Clearance) -> list[ca.SX]:
    function = clearance.distances
    return [ca.SX.sym(name, function.size1_in(name)) for name in function.name_in()]


def _soft(distances: ca.SX, sharpness: ca.SX) -> ca.SX:
    least = ca.mmin(distances)
    return least - ca.log(ca.sum1(ca.exp(-sharpness * (distances - least)))) / sharpness


def build_world(
    model: RobotModel,
    scene: Scene,
    base_position: Sequence[float] = (0.0, 0.0, 0.0),
    base_quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> World:
    """What it builds for a model and kinds of obstacles serves the model's other worlds as well.

    Raises SpecError where the robot has no solids.
    """

    def build() -> Clearance:
        own = part_of(model, "own pairs", lambda: self_pairs(model))
        return build_clearance(model, scene.kinds, scene.names, own)

    clearance = part_of(model, ("clearance", scene.kinds, scene.names), build)
    return World(model, scene, clearance, np.array(base_position, float), np.array(base_quat, float))


def _column(values: ca.DM) -> Array:
    return np.array(values).ravel()
