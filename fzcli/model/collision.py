"""Distances of a robot's solids from obstacles and from each other, as functions of joints, base pose, obstacles."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.composite import BaseFrame, build_base_frame
from fzcli.model.distance import Ball, Box, Capsule, Solid, signed_distance
from fzcli.model.motion_bound import displacements
from fzcli.model.robot_model import RobotModel
from fzcli.model.tree import Tree, rotation_from_rpy
from fzcli.spec.robot import Base, Link
from fzcli.spec.shapes import BoxShape, CapsuleShape, Shape, SphereShape

Array = NDArray[np.float64]
ObstacleKind = Literal["sphere", "capsule", "box"]
NUMBERS: dict[ObstacleKind, int] = {"sphere": 4, "capsule": 7, "box": 10}
ORIGIN, UPRIGHT = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
SAMPLES = 1000
ALIKE = 1e-9  # m: distances that do not change


@dataclass(frozen=True)
class Pair:
    """Two solids whose distance is watched: one of ``link``, and an obstacle's or another link's (``other``).

    ``solid``, ``second``: numbers of the robot's solids (second -1: an obstacle); ``obstacle``: number of the
    obstacle, or -1.
    """

    link: str
    other: str
    solid: int
    second: int = -1
    obstacle: int = -1

    def __str__(self) -> str:
        return f"{self.link} and {self.other}"


@dataclass(frozen=True)
class SelfPairs:
    """Pairs of the robot's own solids: those watched, and those left out with the reason."""

    watched: tuple[Pair, ...]
    left_out: tuple[tuple[Pair, str], ...]


@dataclass(frozen=True)
class Clearance:
    """The distances of all pairs as named Functions.

    ``distances``: (q (n), base_position (3) [m] and base_quat (4) of the base frame in the world, obstacles (k))
    -> distances (m) [m], negative in contact. ``jacobian``: the same -> distances, by_q (m, n) [m/rad, 1] and
    by_base (m, 6), derivatives by a twist of the base at its origin, world axes, linear first.
    ``bounds``: distances, and how far each can change while joints move by at most dq (n), the base's CoM by
    base_shift [m] and its attitude by base_turn [rad], and each obstacle by obstacle_shift [m]: (m) [m].
    ``kinds`` of the obstacles, whose numbers are stacked: see `obstacle_numbers`.
    """

    pairs: tuple[Pair, ...]
    own: SelfPairs
    kinds: tuple[ObstacleKind, ...]
    distances: ca.Function
    bounds: ca.Function

    @cached_property
    def jacobian(self) -> ca.Function:
        """q, base_position, base_quat, obstacles -> distances, by_q, by_base; built when first asked for."""
        f = self.distances
        inputs = {name: ca.SX.sym(name, f.size1_in(name)) for name in f.name_in()}
        distances = f(*inputs.values())
        derivatives = _derivatives(distances, inputs["q"], inputs["base_position"], inputs["base_quat"])
        return _function("jacobian", inputs, {"distances": distances, **derivatives})

    @property
    def with_obstacles(self) -> list[int]:
        """Which pairs (their numbers) have an obstacle; the others are the robot's own."""
        return [i for i, pair in enumerate(self.pairs) if pair.obstacle >= 0]

    def at(
        self,
        q: ArrayLike,
        obstacles: ArrayLike = (),
        base_position: ArrayLike = ORIGIN,
        base_quat: ArrayLike = UPRIGHT,
    ) -> Array:
        """Distances (T, m) at T postures q (T, n); the other arguments one for all, or one a posture."""
        return many(self.distances, q, base_position, base_quat, obstacles)[0]


def many(function: ca.Function, *columns: ArrayLike) -> list[Array]:
    """A Function of vectors at T samples: arguments (T, size) or (size) for all; results (T, size)."""
    tables = [np.asarray(column, dtype=np.float64) for column in columns]
    count = max((len(table) for table in tables if table.ndim == 2), default=1)
    full = [np.broadcast_to(table, (count, table.shape[-1])).T for table in tables]
    found = _mapped(function, count)(*full)
    return [np.array(part).T for part in (found if isinstance(found, tuple) else (found,))]


@lru_cache(maxsize=1024)
def _mapped(function: ca.Function, count: int) -> ca.Function:
    return function.map(count)


def obstacle_numbers(shape: Shape) -> Array:
    """An obstacle's numbers: sphere center (3), radius; capsule from (3), to (3), radius; box center (3),
    quaternion (4) w x y z, size (3). [m]"""
    solid = shape.solid
    if isinstance(solid, SphereShape):
        return np.array([*solid.center, solid.radius])
    if isinstance(solid, CapsuleShape):
        return np.array([*solid.start, *solid.end, solid.radius])
    return np.array([*solid.center, *quaternion_from_rpy(solid.rpy), *solid.size])


def quaternion_from_rpy(rpy: Sequence[float]) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll) as a quaternion (4) w x y z."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(np.array(rpy) / 2), np.cos(np.array(rpy) / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def build_clearance(
    model: RobotModel,
    kinds: Sequence[ObstacleKind],
    names: Sequence[str] = (),
    own: SelfPairs | None = None,
) -> Clearance:
    """The clearance of a robot among obstacles of these kinds, and from itself.

    ``own``: which of its own pairs count (default: `self_pairs`). A fixed base's own solids meet links, not
    obstacles: it may stand on one.

    Raises:
        SpecError: the robot has no solids, or some that could not be read.
    """
    check_solids(model)
    own = self_pairs(model) if own is None else own
    names = tuple(names) or tuple(f"obstacle {i + 1}" for i in range(len(kinds)))
    pairs = [
        Pair(solid.link, name, i, obstacle=k)
        for i, solid in enumerate(model.tree.solids)
        for k, name in enumerate(names)
        if solid.body >= 0 or model.floating
    ]
    pairs += own.watched
    return _assembled(model, tuple(kinds), tuple(pairs), own)


def check_solids(model: RobotModel) -> None:
    """Raises SpecError where collisions of this robot cannot be judged."""
    robot = model.robot
    carriers: list[Base | Link] = [robot.base, *robot.links]
    unread = [(carrier.name, gap) for carrier in carriers for gap in carrier.unread]
    if unread:
        texts = [f"collision of link '{name}' is not known: {gap}" for name, gap in unread]
        advice = "; give its solids by name in a YAML robot that names the URDF: collision: {LINK: [...]}"
        raise SpecError([Problem(text + advice, field="robot") for text in texts])
    if not any(solid.body >= 0 for solid in model.tree.solids):
        text = f"robot '{robot.name}' has no solids to judge collisions by; give its links collision: [...]"
        raise SpecError(Problem(text, field="robot"))


def self_pairs(model: RobotModel, samples: int = SAMPLES, seed: int = 0) -> SelfPairs:
    """The pairs of a robot's own solids that can part and meet.

    Left out: solids of one body, of bodies with one joint between them, and pairs in contact, or always as far
    apart, at all of ``samples`` postures within the joint limits (a full turn or two metres where there are none).
    """
    tree = model.tree
    watched, left_out = [], []
    for i, one in enumerate(tree.solids):
        for j in range(i + 1, len(tree.solids)):
            pair = Pair(one.link, tree.solids[j].link, i, second=j)
            reason = _joined(tree, one.body, tree.solids[j].body)
            if reason:
                left_out.append((pair, reason))
            else:
                watched.append(pair)
    if watched:
        q = np.random.default_rng(seed).uniform(*_ranges(tree), (samples, model.n))
        drawn = _assembled(model, (), tuple(watched), SelfPairs((), ())).at(q)
        reasons = [_settled(values) for values in drawn.T]
        left_out += [(pair, reason) for pair, reason in zip(watched, reasons, strict=True) if reason]
        watched = [pair for pair, reason in zip(watched, reasons, strict=True) if not reason]
    return SelfPairs(tuple(watched), tuple(left_out))


def _settled(distances: Array) -> str:
    """Why a pair with these distances (samples) [m] cannot part and meet, or nothing."""
    if distances.max() < 0:
        return f"in contact at all of {len(distances)} postures"
    if np.ptp(distances) < ALIKE:
        return f"{1e3 * distances[0]:.3g} mm apart at all of {len(distances)} postures"
    return ""


def _ranges(tree: Tree) -> tuple[Array, Array]:
    """Lower and upper joint limits, (n) each, with a full turn or two metres where one or both are not stated."""
    low, high = tree.position_limits.T
    span = np.where([body.prismatic for body in tree.bodies], 2.0, 2 * np.pi)
    lower = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - span, -span / 2))
    return lower, np.where(np.isfinite(high), high, lower + span)


def _joined(tree: Tree, one: int, other: int) -> str:
    """Why two bodies' solids cannot meet freely, or nothing."""
    if one == other:
        return "one rigid body"
    if tree.bodies[max(one, other)].parent == min(one, other):
        return "one joint between them"
    return ""


def _assembled(
    model: RobotModel, kinds: tuple[ObstacleKind, ...], pairs: tuple[Pair, ...], own: SelfPairs
) -> Clearance:
    q, position, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_position", 3), ca.SX.sym("base_quat", 4)
    obstacles = ca.SX.sym("obstacles", sum(NUMBERS[kind] for kind in kinds))
    frame = build_base_frame(model.tree, q)
    turn = rotation_matrix(quat)
    bodies = [_solid(solid.shape, frame, solid.body) for solid in model.tree.solids]
    others = _obstacles(kinds, obstacles, position, turn)
    distances = ca.vertcat(
        *(
            signed_distance(bodies[pair.solid], others[pair.obstacle] if pair.obstacle >= 0 else bodies[pair.second])
            for pair in pairs
        )
    )
    distances = ca.densify(distances) if pairs else ca.SX.zeros(0, 1)
    inputs = {"q": q, "base_position": position, "base_quat": quat, "obstacles": obstacles}
    moves = {"dq": ca.SX.sym("dq", model.n), "base_shift": ca.SX.sym("base_shift")}
    moves |= {"base_turn": ca.SX.sym("base_turn"), "obstacle_shift": ca.SX.sym("obstacle_shift", len(kinds))}
    reach = displacements(model.tree, frame, pairs, *moves.values())
    return Clearance(
        pairs,
        own,
        kinds,
        _function("distances", inputs, {"distances": distances}),
        _function("bounds", inputs | moves, {"distances": distances, "reach": reach}),
    )


def _derivatives(distances: ca.SX, q: ca.SX, position: ca.SX, quat: ca.SX) -> dict[str, ca.SX]:
    """By the joints, and by the base's twist."""
    by_turn = ca.mtimes(ca.jacobian(distances, quat), turned_by(quat))
    return {
        "by_q": ca.densify(ca.jacobian(distances, q)),
        "by_base": ca.densify(ca.horzcat(ca.jacobian(distances, position), by_turn)),
    }


def turned_by(quat: ca.SX) -> ca.SX:
    """How a quaternion changes with a turn w in world axes, by (0, w) quat / 2: (4, 3)."""
    w, x, y, z = (quat[i] for i in range(4))
    return 0.5 * ca.vertcat(
        ca.horzcat(-x, -y, -z), ca.horzcat(w, z, -y), ca.horzcat(-z, w, x), ca.horzcat(y, -x, w)
    )


def _function(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
    results = ca.cse(list(outputs.values()))
    return ca.Function(name, list(inputs.values()), results, list(inputs), list(outputs))


def _solid(shape: Shape, frame: BaseFrame, body: int) -> Solid:
    """A body's solid in base axes."""
    rotation = frame.rotations[body] if body >= 0 else ca.SX.eye(3)
    origin = frame.origins[body] if body >= 0 else ca.SX.zeros(3)

    def point(own: tuple[float, float, float]) -> ca.SX:
        return origin + rotate(rotation, ca.SX(ca.DM(own)))

    solid = shape.solid
    if isinstance(solid, SphereShape):
        return Ball(point(solid.center), solid.radius)
    if isinstance(solid, CapsuleShape):
        return Capsule(point(solid.start), point(solid.end), solid.radius)
    own = ca.SX(ca.DM(rotation_from_rpy(solid.rpy)))
    return Box(ca.mtimes(rotation, own), point(solid.center), _half(solid))


def _half(solid: BoxShape) -> ca.SX:
    return ca.SX(ca.DM([0.5 * edge for edge in solid.size]))


def _obstacles(kinds: Sequence[ObstacleKind], numbers: ca.SX, position: ca.SX, turn: ca.SX) -> list[Solid]:
    """The obstacles as seen from the base."""

    def seen(point: ca.SX) -> ca.SX:
        return rotate(turn.T, point - position)

    found: list[Solid] = []
    start = 0
    for kind in kinds:
        own = numbers[start : start + NUMBERS[kind]]
        start += NUMBERS[kind]
        if kind == "sphere":
            found.append(Ball(seen(own[:3]), own[3]))
        elif kind == "capsule":
            found.append(Capsule(seen(own[:3]), seen(own[3:6]), own[6]))
        else:
            found.append(Box(ca.mtimes(turn.T, rotation_matrix(own[3:7])), seen(own[:3]), 0.5 * own[7:10]))
    return found
