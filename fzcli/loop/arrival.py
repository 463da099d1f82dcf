"""A target to arrive at: what is left to it, when a run has arrived, and the metrics of that."""

from dataclasses import dataclass

import casadi as ca

from fzcli.loop.reductions import FAR
from fzcli.loop.run_spec import StopSpec
from fzcli.model import RobotModel
from fzcli.model.algebra import angle_between, dot, rotate
from fzcli.model.attitude import conjugate, multiply, quaternion_from_matrix, rotation_matrix, rotation_vector
from fzcli.plan.reference import AimName
from fzcli.spec.quantity import Metric, Signal

XYZ = ("x", "y", "z")


@dataclass(frozen=True)
class Arrival:
    """``arrived`` (0 or 1) at a sample; what is recorded, what is reduced, and to which metrics."""

    arrived: ca.SX
    signals: dict[Signal, ca.SX]
    reduced: dict[str, ca.SX]
    metrics: tuple[Metric, ...]


@dataclass(frozen=True)
class Motion:
    """How the sample was come to: joint rates (n) over the step before, and the base's attitude (4) at the start."""

    qd: ca.SX
    first_quat: ca.SX


@dataclass(frozen=True)
class Target:
    """The reference at a sample: position, velocity (3) relative to the CoM's, quat (4), CoM (3); world axes."""

    position: ca.SX
    velocity: ca.SX
    quat: ca.SX
    com: ca.SX


def arrival(
    model: RobotModel,
    tip: str | None,
    aim: AimName,
    stop: StopSpec | None,
    target: Target,
    state: tuple[ca.SX, ca.SX],
    truth: ca.SX | None,
    time: ca.SX,
    motion: Motion,
) -> Arrival:
    """Of a run at ``state``: q (n) and base_quat (4); ``truth``: the real base_quat of a plant that leaves it out."""
    q, quat = state
    distance, angle = _left(model, tip, aim, target, q, quat)
    signals = {
        Signal("target_distance", "m", "left between tip and target"): distance,
        Signal("target_position", "m", "target of the tip, world", XYZ): target.com + target.position,
    }
    metrics = [Metric("target_distance_final", "target_distance", "last", "m", "left between tip and target")]
    if aim in ("direction", "pose"):
        what = "the tip's z and its direction" if aim == "direction" else "the tip's orientation and its target's"
        signals[Signal("target_angle", "rad", f"between {what}")] = angle
        signals[Signal("target_direction", "1", "wanted direction of the tip's z, world", XYZ)] = rotation_matrix(
            target.quat
        )[:, 2]
        metrics.append(Metric("target_angle_final", "target_angle", "last", "rad", f"between {what}"))
    reduced = _speeds(model, tip, target, q, quat, motion)
    metrics += [
        Metric("tip_speed_final", "tip_speed", "last", "m/s", "of the tip relative to the target, over the last step"),
        Metric("joint_speed_final", "joint_speed", "last", "rad/s or m/s", "largest joint speed, over the last step"),
    ]
    if model.floating:
        metrics.append(Metric("base_turn_final", "base_turn", "last", "rad", "turn of the base since the start"))
    arrived = ca.SX(0)
    if stop is not None:
        there = _within(aim, stop, distance, angle)
        if stop.speed is not None:
            there = ca.logic_and(there, reduced["tip_speed"] < stop.speed)
        arrived = ca.if_else(there, 1.0, 0.0)
        reduced["arrived"] = arrived
        reduced["arrival_time"] = ca.if_else(there, time, FAR)
        metrics += [
            Metric("arrived", "arrived", "last", "1", "whether the target was reached", truth=True),
            Metric("arrival_time", "arrival_time", "last", "s", "when the target was reached"),
        ]
    if truth is not None:
        missed = _missed(aim, stop, *_left(model, tip, aim, target, q, truth))
        signals.update(missed.signals)
        reduced.update(missed.reduced)
        metrics += missed.metrics
    reduced.update({signal.name: value for signal, value in signals.items() if not signal.components})
    return Arrival(arrived, signals, reduced, tuple(metrics))


def _within(aim: AimName, stop: StopSpec, distance: ca.SX, angle: ca.SX) -> ca.SX:
    """Whether distance and angle are as small as the stop asks for."""
    there = distance < stop.position
    if aim == "direction" and stop.direction is not None:
        there = ca.logic_and(there, angle < stop.direction)
    elif aim == "pose" and stop.orientation is not None:
        there = ca.logic_and(there, angle < stop.orientation)
    return there


def _missed(aim: AimName, stop: StopSpec | None, miss: ca.SX, off: ca.SX) -> Arrival:
    """What a plant that leaves the base's turn out truly misses by: distance and angle on the base that turns."""
    signals = {Signal("miss_distance", "m", "between target and the tip on the base that turns"): miss}
    metrics = [Metric("miss_distance_final", "miss_distance", "last", "m", "by which the plan really misses")]
    if aim in ("direction", "pose"):
        signals[Signal("miss_angle", "rad", "from the wanted direction, on the base that turns")] = off
        metrics.append(Metric("miss_angle_final", "miss_angle", "last", "rad", "by which it really misses"))
    if stop is None:
        return Arrival(ca.SX(0), signals, {}, tuple(metrics))
    wide = ca.logic_not(_within(aim, stop, miss, off))
    text = "whether the tip misses the target on the base that turns"
    metrics.append(Metric("missed", "missed", "last", "1", text, truth=True))
    return Arrival(ca.SX(0), signals, {"missed": ca.if_else(wide, 1.0, 0.0)}, tuple(metrics))


def _speeds(
    model: RobotModel, tip: str | None, target: Target, q: ca.SX, quat: ca.SX, motion: Motion
) -> dict[str, ca.SX]:
    """Of the tip relative to the target, of the fastest joint, and how far the base has turned."""
    R = rotation_matrix(quat)
    own = ca.mtimes(model.function("tip", tip)(q)[2][:3, :], motion.qd)
    apart = own - rotate(R.T, target.velocity)
    fastest = ca.fabs(motion.qd[0])
    for i in range(1, model.n):
        fastest = ca.fmax(fastest, ca.fabs(motion.qd[i]))
    turn = rotation_vector(multiply(conjugate(motion.first_quat), quat))
    return {
        "tip_speed": ca.sqrt(dot(apart, apart)),
        "joint_speed": fastest,
        "base_turn": ca.sqrt(dot(turn, turn)),
    }


def _left(
    model: RobotModel, tip: str | None, aim: AimName, target: Target, q: ca.SX, quat: ca.SX
) -> tuple[ca.SX, ca.SX]:
    """Distance [m] and angle [rad] between tip and target."""
    position, rotation, _ = model.function("tip", tip)(q)
    R = rotation_matrix(quat)
    away = rotate(R.T, target.position) - position
    distance = ca.sqrt(dot(away, away))
    if aim == "pose":
        tip_quat = multiply(quat, quaternion_from_matrix(rotation))
        turn = rotation_vector(multiply(target.quat, conjugate(tip_quat)))
        return distance, ca.sqrt(dot(turn, turn))
    direction = rotate(R.T, rotation_matrix(target.quat)[:, 2])
    return distance, angle_between(rotation[:, 2], direction)
