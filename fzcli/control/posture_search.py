"""Search for a posture from which the target is met: random seeds, each swept with the base's motion predicted."""

from typing import Annotated

import casadi as ca
from pydantic import Field

from fzcli.control.aim import Aim
from fzcli.control.fabrik_sweep import Links, SweepRule, followed_points, virtual_sweep
from fzcli.control.law import NOT_FOUND, LawInputs, Search
from fzcli.model import RobotModel
from fzcli.model.algebra import angle_between, dot, rotate
from fzcli.model.attitude import exponential, rotation_matrix
from fzcli.model.gauss_magnus import path_piece
from fzcli.spec.base import SpecModel
from fzcli.spec.units import Angle, Length

VIRTUAL_TIP = 0.2  # m: length that a direction is weighed with
DISTANCE, ANGLE = 5e-3, 0.0296705972839036  # m and rad (1.7 deg), where nothing is said
SWEEP_CAP = 0.2  # rad a hinge and sweep
UNSTATED = 20.0  # rad/s: of a joint without a stated speed


class PostureSearchSpec(SpecModel):
    """How to search."""

    seeds: Annotated[int, Field(ge=1, le=4096, description="postures that a search starts from")] = 16
    rounds: Annotated[int, Field(ge=1, description="times that the base is predicted and the arm swept")] = 15
    sweeps: Annotated[int, Field(ge=1, description="sweeps in a round")] = 8
    pieces: Annotated[int, Field(ge=1, description="of the path along which the base is predicted")] = 8
    distance: Annotated[
        Length | None, Field(gt=0, description="a posture will do within it; half of stop.position by default")
    ] = None
    angle: Annotated[
        Angle | None, Field(gt=0, description="and within this angle; 0.85 of stop.direction by default")
    ] = None
    seed: Annotated[int, Field(ge=0, description="of the random postures")] = 0


class _Parts:
    """The constants of a search by name: q (n) now, and the target, base axes now, relative to the CoM."""

    def __init__(self, n: int) -> None:
        self.vector = ca.SX.sym("constants", n + 12)
        self.q, self.target, self.direction, self.velocity, self.rate = ca.vertsplit(
            self.vector, [0, n, n + 3, n + 6, n + 9, n + 12]
        )


def posture_search(
    spec: PostureSearchSpec,
    model: RobotModel,
    inputs: LawInputs,
    aim: Aim,
    directed: bool,
    tip: str | None,
    memory: ca.SX,
    number: ca.SX,
    accept: ca.Function,
) -> Search:
    """The search of a law whose ``memory`` knows the ``number`` of searches so far.

    A round: predict the base's attitude after the straight joint path to the posture, in ``pieces``, with
    momentum conserved; place the base by the CoM; sweep the arm there towards the target, the base standing
    still. Of the postures that end within ``distance`` and ``angle`` the soonest reached is taken.
    """
    n, chain = model.n, model.chain(tip)
    given = ca.vertcat(inputs.q, aim.target, aim.direction, aim.velocity, aim.rate)
    constants, posture = ca.MX.sym("constants", n + 12), ca.MX.sym("posture", n)
    rule = SweepRule(chain, directed, followed_points(False, chain.hinges, directed), VIRTUAL_TIP, chain.square)
    swept = virtual_sweep(rule, model.tree.position_limits[list(chain.joints)], SWEEP_CAP)
    attitude = _attitude(model, spec.pieces, posture, constants)
    moving, fixed = _arrival(model, tip)(posture, attitude, constants)
    for _ in range(spec.sweeps):
        moving = swept(moving, fixed)
    return Search(
        request=ca.Function(
            "request",
            [*inputs.as_dict().values(), memory],
            [ca.densify(given), number],
            [*inputs.as_dict(), "memory"],
            ["constants", "number"],
        ),
        first=_first(model, chain.joints),
        turn=ca.Function("search_round", [posture, constants], [_departure(model, chain.joints)(posture, moving)]),
        result=ca.Function(
            "search_result",
            [posture, constants],
            [_copy(n)(posture), _judge(spec, model, directed, tip)(posture, attitude, constants)],
        ),
        accept=accept,
        turns=spec.rounds,
        seeds=spec.seeds,
        offsets=chain.hinges,
        seed=spec.seed,
    )


def slowest(model: RobotModel, way: ca.SX) -> ca.SX:
    """Seconds that the joint which needs longest takes for its part of ``way`` (n) at its speed limit."""
    needed = ca.SX(0)
    for i, speed in enumerate(model.tree.speed_limits):
        pace = float(speed) if speed < float("inf") else UNSTATED
        needed = ca.fmax(needed, ca.fabs(way[i]) * (1 / pace))
    return needed


def _first(model: RobotModel, hinges: tuple[int, ...]) -> ca.Function:
    """Seeds: q + U(-pi, pi) on the hinges, clipped to the joint limits."""
    parts, offsets = _Parts(model.n), ca.SX.sym("offsets", len(hinges))
    posture = ca.SX(parts.q)
    for place, j in enumerate(hinges):
        low, high = model.tree.position_limits[j]
        value = parts.q[j] + ca.pi * offsets[place]
        value = ca.fmax(value, float(low)) if low > -float("inf") else value
        posture[j] = ca.fmin(value, float(high)) if high < float("inf") else value
    return ca.Function("search_first", [parts.vector, offsets], [posture], ["constants", "offsets"], ["state"])


def _attitude(model: RobotModel, pieces: int, posture: ca.MX, constants: ca.MX) -> ca.MX:
    """The base's attitude (4) after the straight path, from its attitude now."""
    parts, goal = _Parts(model.n), ca.SX.sym("posture", model.n)
    split = ca.Function(
        "path_start", [goal, parts.vector], [ca.SX([1, 0, 0, 0]), parts.q, (goal - parts.q) * (1 / pieces)]
    )
    quat, q, way = split(posture, constants)
    piece = path_piece(model)
    for _ in range(pieces):
        quat, q = piece(quat, q, way)
    return quat


def _there(model: RobotModel, parts: _Parts, posture: ca.SX, quat: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Target and direction (3) when the arm arrives, in the axes of the base then."""
    R = rotation_matrix(quat)
    later = slowest(model, posture - parts.q)
    target = parts.target + parts.velocity * later
    direction = rotate(rotation_matrix(exponential(parts.rate * later)), parts.direction)
    return rotate(R.T, target), rotate(R.T, direction)


def _arrival(model: RobotModel, tip: str | None) -> ca.Function:
    """(posture, attitude, constants) -> what a virtual sweep starts from: moving, fixed."""
    parts, posture, quat = _Parts(model.n), ca.SX.sym("posture", model.n), ca.SX.sym("quat", 4)
    points, axes = model.function("chain", tip)(posture)
    angles = ca.vertcat(*(posture[j] for j in model.chain(tip).joints))
    moving = ca.vertcat(angles, Links.of(points, axes).vector)
    fixed = ca.vertcat(*_there(model, parts, posture, quat))
    return ca.Function("search_arrival", [posture, quat, parts.vector], ca.cse([moving, fixed]))


def _departure(model: RobotModel, hinges: tuple[int, ...]) -> ca.Function:
    """(posture, moving) -> posture with the hinges where the sweeps have put them."""
    m = len(hinges)
    posture, moving = ca.SX.sym("posture", model.n), ca.SX.sym("moving", 3 + 7 * m)
    after = ca.SX(posture)
    for place, j in enumerate(hinges):
        after[j] = moving[place]
    return ca.Function("search_departure", [posture, moving], [after])


def _judge(spec: PostureSearchSpec, model: RobotModel, directed: bool, tip: str | None) -> ca.Function:
    """(posture, attitude, constants) -> cost: seconds of the way there where the tip arrives, else `NOT_FOUND`."""
    parts, posture, quat = _Parts(model.n), ca.SX.sym("posture", model.n), ca.SX.sym("quat", 4)
    position, rotation, _ = model.function("tip", tip)(posture)
    target, direction = _there(model, parts, posture, quat)
    away = target - position
    good = dot(away, away) < (DISTANCE if spec.distance is None else spec.distance) ** 2
    if directed:
        within = ANGLE if spec.angle is None else spec.angle
        good = ca.logic_and(good, angle_between(rotation[:, 2], direction) < within)
    cost = ca.if_else(good, slowest(model, posture - parts.q), NOT_FOUND)
    return ca.Function("search_judge", [posture, quat, parts.vector], ca.cse([cost]))


def _copy(n: int) -> ca.Function:
    """The same numbers: outputs of the step's graphs are results of calls alone."""
    values = ca.SX.sym("values", n)
    return ca.Function("copied", [values], [values])
