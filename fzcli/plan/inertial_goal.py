"""Final joint values of a free-floating arm: those at which a joint path ends with the tip at an inertial pose.

The base turns as the arm moves, by an angle that hangs on the whole path, so that the pose is met by Newton's
method on the final joints, through the path. Geometry only: at zero momentum no timing matters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model import RobotModel
from fzcli.model.algebra import rotate
from fzcli.model.attitude import attitude_step, rotation_matrix
from fzcli.model.gauss_magnus import NODES, magnus
from fzcli.model.inverse import InverseKinematics, Solution
from fzcli.model.inverse.pose_error import TINY, pose_error

Array = NDArray[np.float64]
Target = tuple[Array, Array]
Curve = Callable[[Array], tuple[Array, Array]]
PIECES = 16  # of the path: at half a turn a joint the attitude is within 3e-6 rad
SAME = 1e-6  # rad or m: ends closer than this are one
SLACK = 1e-9  # rad or m past a limit that counts as rounding
ROUNDS = 2  # in which a branch is followed before Newton's method
STEPS = 12  # of Newton's method for one branch
STRIDE = 1.0  # rad or m: longest Newton step of one joint


@dataclass(frozen=True)
class PathLaw:
    """A joint path q(s) = start + share(s) (goal - start) + offset(s), s from 0 to 1, at two Gauss nodes a piece.

    ``share`` and ``share_way`` (2 K): share, and its derivative times the piece's length in s; ``offset`` and
    ``offset_way`` (n, 2 K) [rad, m] alike. share runs from 0 to 1, offset from 0 to 0.
    """

    share: Array
    share_way: Array
    offset: Array
    offset_way: Array


def path_law(n: int, share: Curve | None = None, offset: Curve | None = None, pieces: int = PIECES) -> PathLaw:
    """A path of ``pieces`` equal pieces in s; the default is the straight line.

    ``share``: s (k) -> values and derivatives by s, (k) each; ``offset``: the same, (n, k) each [rad, m].
    """
    h = 1.0 / pieces
    s = ((np.arange(pieces)[:, None] + np.array(NODES)) * h).ravel()
    part, rate = (s, np.ones_like(s)) if share is None else share(s)
    still = np.zeros((n, len(s)))
    aside, aside_rate = (still, still) if offset is None else offset(s)
    return PathLaw(part, h * rate, aside, h * aside_rate)


@dataclass(frozen=True)
class Departure:
    """Where a path begins, at rest: joints q (n), base attitude (4) and position (3) [m] of its frame, world axes."""

    q: Array
    base_quat: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    base_position: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class InertialEnd:
    """Where a path ends: joints q (n), base attitude (4) and position (3) [m], and how the tips miss their poses.

    ``distance`` [m] and ``angle`` [rad] of the worst tip; ``steps`` that Newton took.
    """

    q: Array
    base_quat: Array
    base_position: Array
    distance: float
    angle: float
    steps: int

    @property
    def error(self) -> float:
        """The larger of distance [m] and angle [rad]."""
        return max(self.distance, self.angle)


@dataclass(frozen=True)
class InertialGoal:
    """Newton's method on the final joints of a path, for the poses of ``tips`` in the world.

    ``ride``: one piece for `mapaccum`; ``along``: the same with derivatives; ``miss``: attitude (4), its derivative
    (4, n), goal q (n), targets -> error (6 a tip) and its Jacobian (6 a tip, n). ``moving``: joints that are
    varied, those that carry the tips.
    """

    model: RobotModel
    tips: tuple[str, ...]
    moving: tuple[int, ...]
    ride: ca.Function
    along: ca.Function
    miss: ca.Function
    _chains: dict[tuple[str, int], ca.Function] = field(default_factory=dict, repr=False, compare=False)

    def attitudes(self, departure: Departure, goal: Array, law: PathLaw) -> Array:
        """The base's attitudes (K+1, 4) at the ends of the path's pieces, the departure's first."""
        return np.vstack([departure.base_quat, self._accumulated(self.ride, departure, goal, law, departure.base_quat)])

    def base_after(self, departure: Departure, goal: Array, law: PathLaw) -> tuple[Array, Array]:
        """The base's attitude (4) and position (3) [m] at the path's end."""
        quat = self.attitudes(departure, goal, law)[-1]
        return quat, self._base_position(goal, quat, self._com(departure))

    def solve(
        self,
        departure: Departure,
        targets: Sequence[Target],
        guess: Array,
        law: PathLaw | None = None,
        *,
        tolerance: float = 1e-9,
        steps: int = 20,
    ) -> InertialEnd:
        """The end of the path whose tips meet ``targets``, a position (3) [m] and rotation (3, 3) a tip, in the world.

        ``guess`` (n) begins the search, and stays where joints carry none of the tips. The path is straight unless
        ``law`` says otherwise. The best end found is returned, met or not within ``tolerance`` [m and rad] and
        ``steps``; without steps, the end that the guess leads to.
        """
        law = path_law(self.model.n) if law is None else law
        com, columns = self._com(departure), list(self.moving)
        given = np.concatenate([np.concatenate([p - com, R.ravel("F")]) for p, R in targets])
        goal, best, taken = np.array(guess, dtype=float), None, 0
        while True:
            quat, slope = self._along(departure, goal, law)
            error, jacobian = (np.array(values) for values in self.miss(quat, slope, goal, given))
            end = self._end(goal, quat, com, error.ravel(), taken)
            best = end if best is None or end.distance + end.angle < best.distance + best.angle else best
            if best.error <= tolerance or taken >= steps:
                return best
            way = -np.linalg.lstsq(jacobian[:, columns], error.ravel(), rcond=1e-9)[0]
            goal = goal.copy()
            goal[columns] += way * min(1.0, STRIDE / max(float(np.abs(way).max()), 1e-300))
            taken += 1

    def _along(self, departure: Departure, goal: Array, law: PathLaw) -> tuple[Array, Array]:
        """The attitude (4) at the path's end and its derivative (4, n) by the goal."""
        n = self.model.n
        first = np.concatenate([departure.base_quat, np.zeros(4 * n)])
        last = self._accumulated(self.along, departure, goal, law, first)[-1]
        return last[:4], last[4:].reshape(n, 4).T

    def _accumulated(self, piece: ca.Function, departure: Departure, goal: Array, law: PathLaw, first: Array) -> Array:
        """The states (K, k) after each piece of the path."""
        n, pieces = self.model.n, len(law.share) // 2
        key = (piece.name(), pieces)
        if key not in self._chains:
            self._chains[key] = piece.mapaccum(pieces)
        rows = np.concatenate([law.share[None], law.share_way[None], law.offset, law.offset_way])
        rows = rows.reshape(2 * n + 2, pieces, 2).transpose(2, 0, 1).reshape(4 * n + 4, pieces)
        ends = np.concatenate([departure.q, goal])
        return np.array(self._chains[key](first, np.tile(ends[:, None], (1, pieces)), rows)).T

    def _base_position(self, q: Array, quat: Array, com: Array) -> Array:
        return com - _vector(self.model.com(q, quat)) if self.model.floating else com

    def _com(self, departure: Departure) -> Array:
        """The point that stays: the system's CoM, or the origin of a fixed base, world axes."""
        if not self.model.floating:
            return departure.base_position
        return departure.base_position + _vector(self.model.com(departure.q, departure.base_quat))

    def _end(self, goal: Array, quat: Array, com: Array, error: Array, taken: int) -> InertialEnd:
        parts = np.linalg.norm(error.reshape(-1, 2, 3), axis=2).max(axis=0)
        place = self._base_position(goal, quat, com)
        return InertialEnd(goal, quat, place, float(parts[0]), float(parts[1]), taken)


def build_inertial_goal(model: RobotModel, tips: Sequence[str] | None = None) -> InertialGoal:
    """For the poses of ``tips`` (default: the first tip alone); on a fixed base too, where the base does not turn.

    Raises SpecError for an unknown tip.
    """
    names = model.tips[:1] if tips is None else tuple(tips)
    moving = sorted({joint for name in names for joint in _carriers(model, name)})
    return InertialGoal(model, names, tuple(moving), *_pieces(model), _miss(model, names))


def inertial_goals(
    goal: InertialGoal,
    inverse: InverseKinematics,
    departure: Departure,
    target: Target,
    law: PathLaw | None = None,
    *,
    tolerance: float = 1e-9,
) -> list[InertialEnd]:
    """The ends that meet one tip's inertial pose inside the joint limits, least joint travel first.

    Each branch of the inverse kinematics is followed to where the path to it leaves the base, `ROUNDS` times, which
    makes the guess; where Newton's method does not end from there, so is the branch with the base where it starts.
    """
    law = path_law(goal.model.n) if law is None else law
    found: list[InertialEnd] = []
    for first in inverse.branches(*_seen(target, departure.base_quat, departure.base_position), near=departure.q):
        followed = _followed(goal, inverse, departure, target, law, first)
        end = goal.solve(departure, [target], followed, law, tolerance=tolerance, steps=STEPS)
        if end.error > tolerance:
            end = goal.solve(departure, [target], first.q, law, tolerance=tolerance, steps=STEPS)
        known = any(float(np.abs(end.q - other.q).max()) < SAME for other in found)
        if end.error <= tolerance and not known and _inside(goal.model, end.q):
            found.append(end)
    return sorted(found, key=lambda end: float(((end.q - departure.q) ** 2).sum()))


def _followed(
    goal: InertialGoal,
    inverse: InverseKinematics,
    departure: Departure,
    target: Target,
    law: PathLaw,
    first: Solution,
) -> Array:
    """A branch's posture (n) with the base where the path to it ends, found by going there and looking again."""
    q = first.q
    for _ in range(ROUNDS):
        again = inverse.branches(*_seen(target, *goal.base_after(departure, q, law)), near=departure.q)
        q = next((one.q for one in again if one.branch == first.branch), again[0].q)
    return q


def _seen(target: Target, quat: Array, place: Array) -> tuple[Array, Array]:
    """A pose in the world, from a base of attitude ``quat`` (4) at ``place`` (3)."""
    R = np.array(ca.evalf(rotation_matrix(ca.SX(ca.DM(quat)))))
    return R.T @ (target[0] - place), R.T @ target[1]


def _carriers(model: RobotModel, tip: str) -> list[int]:
    if tip not in model.tips:
        raise SpecError(Problem(f"no tip {tip!r}; the robot has {', '.join(model.tips)}", field="tip"))
    return model.carriers(tip)


def _inside(model: RobotModel, q: Array) -> bool:
    low, high = model.tree.position_limits.T
    return bool(((q >= low - SLACK) & (q <= high + SLACK)).all())


def _vector(values: ca.DM) -> Array:
    return np.array(values).ravel()


def _pieces(model: RobotModel) -> tuple[ca.Function, ca.Function]:
    """(state, ends, nodes) -> state after a piece, without and with derivatives.

    The state is the attitude (4), then its derivative (4, n) by the goal. ``ends``: start (n), goal (n).
    ``nodes``: at either Gauss node share, its way, offset (n), its way (n).
    """
    n = model.n
    state, ends, nodes = ca.SX.sym("state", 4 + 4 * n), ca.SX.sym("ends", 2 * n), ca.SX.sym("nodes", 4 * n + 4)
    quat, slope = state[:4], ca.reshape(state[4:], 4, n)
    start, goal = ca.vertsplit(ends, n)
    turns = []
    for share, way, offset, offset_way in (
        ca.vertsplit(part, [0, 1, 2, 2 + n, 2 + 2 * n]) for part in ca.vertsplit(nodes, 2 * n + 2)
    ):
        q = start + share * (goal - start) + offset
        turns.append(ca.mtimes(model.function("body")(q)[4], way * (goal - start) + offset_way))
    after = attitude_step(quat, magnus(*turns) + ca.vertcat(TINY, 0, 0)) if model.floating else quat
    slope = ca.mtimes(ca.jacobian(after, quat), slope) + ca.jacobian(after, goal)
    both = ca.vertcat(after, ca.vec(ca.densify(slope)))
    return (
        ca.Function("path_ride", [quat, ends, nodes], ca.cse([after])),
        ca.Function("path_of_goal", [state, ends, nodes], ca.cse([both])),
    )


def _miss(model: RobotModel, tips: tuple[str, ...]) -> ca.Function:
    quat, slope, goal = ca.SX.sym("quat", 4), ca.SX.sym("slope", 4, model.n), ca.SX.sym("q", model.n)
    targets = ca.SX.sym("targets", 12 * len(tips))
    R, errors = rotation_matrix(quat), []
    for tip, target in zip(tips, ca.vertsplit(targets, 12), strict=True):
        position, rotation, _ = model.function("tip", tip)(goal)
        wanted = ca.reshape(target[3:], 3, 3)
        errors.append(pose_error(rotate(R, position), ca.mtimes(R, rotation), target[:3], wanted))
    error = ca.vertcat(*errors)
    jacobian = ca.mtimes(ca.jacobian(error, quat), slope) + ca.jacobian(error, goal)
    outputs = ca.cse([ca.densify(error), ca.densify(jacobian)])
    return ca.Function("goal_miss", [quat, slope, goal, targets], outputs)
