"""The one contract of all references: where the tip, or the base, is to be at a time."""

from dataclasses import dataclass
from typing import Literal

import casadi as ca

from fzcli.spec.quantity import Parameter


@dataclass(frozen=True)
class TipReference:
    """A tip motion ready to be composed into a closed loop; positions relative to the CoM at the start.

    ``prepare``: (parameters, then the fields of `Start`) -> constants, once a run.
    ``evaluate``: (time, constants) -> tip_position (3), tip_velocity (3), tip_quat (4), tip_rate (3),
    world axes. ``duration``: parameters -> seconds, infinite for a reference without an end. ``aim``: what a
    reference that is a target to arrive at fixes: the tip's position, also the direction of its z, or the
    whole pose; "" for one that is followed.
    """

    prepare: ca.Function
    evaluate: ca.Function
    duration: ca.Function
    parameters: tuple[Parameter, ...]
    aim: "AimName" = ""


AimName = Literal["", "position", "direction", "pose"]


@dataclass(frozen=True)
class Start:
    """Where a run starts: joints (n), base_quat (4), tip pose relative to the CoM, CoM (3) in the world."""

    q: ca.SX
    base_quat: ca.SX
    tip_position: ca.SX
    tip_quat: ca.SX
    com: ca.SX

    @staticmethod
    def symbols(n: int) -> "Start":
        """Fresh symbols for a robot of n joints."""
        sizes = {"q": n, "base_quat": 4, "tip_position": 3, "tip_quat": 4, "com": 3}
        return Start(**{name: ca.SX.sym(name, size) for name, size in sizes.items()})

    def as_dict(self) -> dict[str, ca.SX]:
        """Name -> symbol, in the order of the fields."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


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
    start: Start,
    constants: ca.SX,
    symbols: ca.SX,
    time: ca.SX,
    motion: TipMotion,
    duration: ca.SX,
    aim: AimName = "",
) -> TipReference:
    """Assemble a TipReference: ``constants`` of (parameters, start); ``motion`` of (time, ``symbols``)."""
    values = ca.vertcat(*parameters.values()) if parameters else ca.SX.sym("none", 0)
    prepare = ca.Function(
        "prepare",
        [values, *start.as_dict().values()],
        [ca.densify(constants)],
        ["parameters", *start.as_dict()],
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
    return TipReference(prepare, evaluate, seconds, tuple(parameters), aim)
