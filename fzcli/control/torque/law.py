"""The one contract of all torque controllers: what is measured, what is wanted, and the torques."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from fzcli.model import RobotModel
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Parameter, Signal


@dataclass(frozen=True)
class TorqueInputs:
    """Symbols a torque controller may use; world axes.

    Measured: q, qd (n), base_position (3) of the base frame's origin, base_quat (4) body to world, base_twist (6).
    Wanted, of the motion that is followed: q_wanted, qd_wanted, qdd_wanted (n), tip_position_wanted,
    tip_velocity_wanted (3), tip_quat_wanted (4), tip_rate_wanted (3), base_quat_wanted (4), base_rate_wanted (3).
    """

    q: ca.SX
    qd: ca.SX
    base_position: ca.SX
    base_quat: ca.SX
    base_twist: ca.SX
    q_wanted: ca.SX
    qd_wanted: ca.SX
    qdd_wanted: ca.SX
    tip_position_wanted: ca.SX
    tip_velocity_wanted: ca.SX
    tip_quat_wanted: ca.SX
    tip_rate_wanted: ca.SX
    base_quat_wanted: ca.SX
    base_rate_wanted: ca.SX

    @staticmethod
    def symbols(n: int) -> "TorqueInputs":
        """Fresh symbols for a robot of n joints."""
        sizes = dict.fromkeys(("q", "qd", "q_wanted", "qd_wanted", "qdd_wanted"), n)
        sizes |= {"base_quat": 4, "tip_quat_wanted": 4, "base_quat_wanted": 4, "base_twist": 6}
        names = TorqueInputs.__dataclass_fields__
        return TorqueInputs(**{name: ca.SX.sym(name, sizes.get(name, 3)) for name in names})

    def as_dict(self) -> dict[str, ca.SX]:
        """Name -> symbol, in the order of the fields."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class TorqueLaw:
    """A torque controller ready to be composed.

    ``function``: inputs are those of `TorqueInputs`, then ``parameters``; outputs are ``torque`` (n) and one a
    signal. It knows the run's robot, whatever the robot is that its torques move.
    """

    function: ca.Function
    parameters: tuple[Parameter, ...]
    signals: tuple[Signal, ...]


def make_torque_law(
    inputs: TorqueInputs, torque: ca.SX, parameters: dict[Parameter, ca.SX], signals: dict[Signal, ca.SX] | None = None
) -> TorqueLaw:
    """Assemble a TorqueLaw from its expressions."""
    shown = signals or {}
    bound = {**inputs.as_dict(), "parameters": ca.vertcat(*parameters.values())}
    results = ca.cse([ca.densify(value) for value in (torque, *shown.values())])
    names = ["torque", *(signal.name for signal in shown)]
    function = ca.Function("torque_law", list(bound.values()), results, list(bound), names)
    return TorqueLaw(function, tuple(parameters), tuple(shown))


@dataclass(frozen=True)
class TorqueController:
    """A controller's spec model (with a literal ``kind``) and its builder (model, spec) -> TorqueLaw."""

    spec: type[SpecModel]
    build: Callable[[RobotModel, Any], TorqueLaw]


FIELD = "replay.controller"


def parameter(name: str, size: int = 1) -> Parameter:
    """A field of a torque controller as a run-time parameter."""
    return Parameter(f"{FIELD}.{name}", size)
