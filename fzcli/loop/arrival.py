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
class Target:
    """The reference at a sample: position (3) relative to the CoM, quat (4), CoM (3); world axes."""

    position: ca.SX
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
    speed: ca.SX,
) -> Arrival:
    """Of a run at ``state``: q (n) and base_quat (4); ``truth``: the real base_quat of a plant that leaves it out.

    ``speed``: the joint rates' largest magnitude.
    """
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
    reduced: dict[str, ca.SX] = {}
    if truth is not None:
        miss, off = _left(model, tip, aim, target, q, truth)
        signals[Signal("miss_distance", "m", "between target and the tip on the base that turns")] = miss
        metrics.append(Metric("miss_distance_final", "miss_distance", "last", "m", "by which the plan really misses"))
        if aim in ("direction", "pose"):
            signals[Signal("miss_angle", "rad", "from the wanted direction, on the base that turns")] = off
            metrics.append(Metric("miss_angle_final", "miss_angle", "last", "rad", "by which it really misses"))
    arrived = ca.SX(0)
    if stop is not None:
        there = distance < stop.position
        if aim == "direction" and stop.direction is not None:
            there = ca.logic_and(there, angle < stop.direction)
        elif aim == "pose" and stop.orientation is not None:
            there = ca.logic_and(there, angle < stop.orientation)
        arrived = ca.if_else(there, 1.0, 0.0)
        reduced["arrived"] = arrived
        reduced["arrival_time"] = ca.if_else(there, time, FAR)
        reduced["joint_speed"] = speed
        metrics += [
            Metric("arrived", "arrived", "last", "1", "whether the target was reached", truth=True),
            Metric("arrival_time", "arrival_time", "last", "s", "when the target was reached"),
            Metric("joint_speed_final", "joint_speed", "last", "rad/s or m/s", "largest joint speed at the end"),
        ]
    reduced.update({signal.name: value for signal, value in signals.items() if not signal.components})
    return Arrival(arrived, signals, reduced, tuple(metrics))


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
