"""The one contract of all references: where the tip, or the base, is to be at a time."""

from dataclasses import dataclass

import casadi as ca

from fzcli.spec.quantity import Parameter


@dataclass(frozen=True)
class TipReference:
    """A tip motion ready to be composed into a closed loop; positions relative to the CoM at the start.

    ``prepare``: (parameters, tip_position (3), tip_quat (4), com (3)) -> constants, once a run;
    tip pose at the start relative to the CoM, and the CoM in the world.
    ``evaluate``: (time, constants) -> tip_position (3), tip_velocity (3), tip_quat (4), tip_rate (3),
    world axes. ``duration``: parameters -> seconds, infinite for a reference without an end.
    """

    prepare: ca.Function
    evaluate: ca.Function
    duration: ca.Function
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class BaseReference:
    """Wanted roll, pitch, yaw of the base.

    ``prepare``: (parameters, angles (3) at the start) -> constants; ``evaluate``: (time, constants)
    -> angles (3) [rad], rates (3) [rad/s].
    """

    prepare: ca.Function
    evaluate: ca.Function
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class TipMotion:
    """What ``evaluate`` of a tip reference computes."""

    position: ca.SX
    velocity: ca.SX
    quat: ca.SX
    rate: ca.SX


def tip_reference(
    *,
    parameters: dict[Parameter, ca.SX],
    start: tuple[ca.SX, ca.SX, ca.SX],
    constants: ca.SX,
    symbols: ca.SX,
    time: ca.SX,
    motion: TipMotion,
    duration: ca.SX,
) -> TipReference:
    """Assemble a TipReference: ``constants`` of (parameters, start); ``motion`` of (time, ``symbols``)."""
    values = ca.vertcat(*parameters.values()) if parameters else ca.SX.sym("none", 0)
    prepare = ca.Function(
        "prepare",
        [values, *start],
        [ca.densify(constants)],
        ["parameters", "tip_position", "tip_quat", "com"],
        ["constants"],
    )
    evaluate = ca.Function(
        "evaluate",
        [time, symbols],
        [ca.densify(part) for part in (motion.position, motion.velocity, motion.quat, motion.rate)],
        ["time", "constants"],
        ["tip_position", "tip_velocity", "tip_quat", "tip_rate"],
    )
    seconds = ca.Function("duration", [values], [ca.densify(duration)], ["parameters"], ["duration"])
    return TipReference(prepare, evaluate, seconds, tuple(parameters))


def start_symbols() -> tuple[ca.SX, ca.SX, ca.SX]:
    """Tip position (3) and quaternion (4) at the start, and CoM (3)."""
    return ca.SX.sym("tip_position", 3), ca.SX.sym("tip_quat", 4), ca.SX.sym("com", 3)
