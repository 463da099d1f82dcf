"""Where a plan happens: the robot, its base at the start, and the scene; distances along whole joint paths."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model import RobotModel
from fzcli.model.attitude import rotation_matrix
from fzcli.model.collision import Clearance, build_clearance, many
from fzcli.model.gauss_magnus import COMMUTATOR, NODES
from fzcli.plan.scene import Scene

Array = NDArray[np.float64]
PIECE = 0.05  # s: the base's attitude is carried along in pieces no longer than this


class Path(Protocol):
    """A joint path over time [s]."""

    @property
    def duration(self) -> float: ...
    @property
    def start(self) -> Array: ...
    @property
    def goal(self) -> Array: ...
    def at(self, time: Array) -> tuple[Array, Array, Array]:
        """q, qd, qdd at times (T,), each (T, n)."""
        ...

    def speed_bound(self, begin: float, end: float) -> Array:
        """No joint is faster than this between two times, (n)."""
        ...


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
    _soft: dict[str, ca.Function] = field(default_factory=dict, repr=False, compare=False)

    def base(self, path: Path, times: Array) -> tuple[Array, Array]:
        """Position (T, 3) [m] and attitude (T, 4) of the base frame at increasing times (T,) of a path."""
        count = len(times)
        if not self.model.floating:
            return np.tile(self.base_position, (count, 1)), np.tile(self.base_quat, (count, 1))
        knots, places = _refined(times)
        steps = np.diff(knots)
        turns = np.zeros((len(steps), 3))
        if len(steps):
            a, b = (self._turns(path, knots[:-1] + node * steps, steps) for node in NODES)
            turns = 0.5 * (a + b) + COMMUTATOR * np.cross(a, b)
        quats = _carried(self.base_quat, turns)[places]
        q = path.at(times)[0]
        com = _column(self.model.com(path.at(np.zeros(1))[0][0], self.base_quat)) + self.base_position
        offsets = many(self.model.function("com"), q, quats)[0]
        return com - offsets, quats

    def _turns(self, path: Path, times: Array, steps: Array) -> Array:
        """The base's rate at times, times the steps, (T, 3) [rad], base axes."""
        q, qd, _ = path.at(times)
        if "rate" not in self._soft:
            symbol, speed = ca.SX.sym("q", self.model.n), ca.SX.sym("qd", self.model.n)
            rate = ca.mtimes(self.model.function("body")(symbol)[4], speed)
            self._soft["rate"] = ca.Function("rate", [symbol, speed], ca.cse([ca.densify(rate)]))
        return many(self._soft["rate"], q, qd)[0] * steps[:, None]

    def distances(self, path: Path, times: Array) -> Array:
        """Of all pairs (T, m) [m] at increasing times (T,) of a path."""
        position, quat = self.base(path, times)
        return self.clearance.at(path.at(times)[0], self.scene.numbers(times), position, quat)

    def nearest(self, q: Array, times: Array, sharpness: float) -> tuple[Array, Array]:
        """Soft minimum (T,) [m] over all pairs, never above the true one, and its derivative by q (T, n).

        The base stands where it starts. ``sharpness`` [1/m]: off by log(pairs)/sharpness at the most.
        """
        if "nearest" not in self._soft:
            self._soft["nearest"] = self._nearest()
        found = many(
            self._soft["nearest"], q, self.scene.numbers(times), self.base_position, self.base_quat, [sharpness]
        )
        return found[0][:, 0], found[1]

    def _nearest(self) -> ca.Function:
        function = self.clearance.distances
        symbols = [ca.SX.sym(name, function.size1_in(name)) for name in function.name_in()]
        q, position, quat, obstacles = symbols
        sharpness = ca.SX.sym("sharpness")
        distances = function(*symbols)
        least = ca.mmin(distances)
        soft = least - ca.log(ca.sum1(ca.exp(-sharpness * (distances - least)))) / sharpness
        return ca.Function(
            "nearest",
            [q, obstacles, position, quat, sharpness],
            ca.cse([soft, ca.densify(ca.gradient(soft, q))]),
        )


def build_world(
    model: RobotModel,
    scene: Scene,
    base_position: Sequence[float] = (0.0, 0.0, 0.0),
    base_quat: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> World:
    """Raises SpecError where the robot has no solids."""
    clearance = build_clearance(model, scene.kinds, scene.names)
    return World(model, scene, clearance, np.array(base_position, float), np.array(base_quat, float))


def _refined(times: Array) -> tuple[Array, NDArray[np.int64]]:
    """Times from 0 that hold all of ``times`` and leave no gap above ``PIECE``, and where those stand."""
    knots: list[float] = [0.0]
    places = []
    for time in times:
        gap = float(time) - knots[-1]
        if gap > 0:
            pieces = int(np.ceil(gap / PIECE))
            knots += [knots[-1] + gap * (i + 1) / pieces for i in range(pieces - 1)] + [float(time)]
        places.append(len(knots) - 1)
    return np.array(knots), np.array(places, dtype=np.int64)


def _carried(quat: Array, turns: Array) -> Array:
    """Attitudes (T+1, 4) after each of the turns (T, 3) [rad], base axes, from ``quat``."""
    angle = np.linalg.norm(turns, axis=1)
    half = 0.5 * angle
    scale = np.where(angle > 0, np.sin(half) / np.where(angle > 0, angle, 1.0), 0.5)
    steps = np.column_stack([np.cos(half), turns * scale[:, None]])
    found = [quat]
    for w, x, y, z in steps:
        a, b, c, d = found[-1]
        found.append(
            np.array(
                [
                    a * w - b * x - c * y - d * z,
                    a * x + b * w + c * z - d * y,
                    a * y - b * z + c * w + d * x,
                    a * z + b * y - c * x + d * w,
                ]
            )
        )
    return np.array(found)


def rotation(quat: Array) -> Array:
    """R (3, 3) of a unit quaternion (4)."""
    return np.array(ca.evalf(rotation_matrix(ca.SX(ca.DM(quat)))))


def _column(values: ca.DM) -> Array:
    return np.array(values).ravel()
