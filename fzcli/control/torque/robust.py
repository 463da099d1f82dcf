"""Computed torque with a sliding term: holds tip and base where the masses are not what the controller believes."""

from typing import Annotated, Literal

import casadi as ca
from pydantic import Field, field_validator

from fzcli.control.constraint import ConstraintName
from fzcli.control.torque.computed_torque import inverse_dynamics
from fzcli.control.torque.followed import Followed, base_followed, size, tip_followed
from fzcli.control.torque.law import TorqueInputs, TorqueLaw, make_torque_law, parameter
from fzcli.model import RobotModel
from fzcli.model.algebra import damped_pseudo_inverse
from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Signal
from fzcli.spec.units import AngularSpeed, Frequency


class RobustSpec(SpecModel):
    """sigma = de/dt + rate e of tip and base; acceleration = rate de/dt + reach sigma + switch sat(sigma/layer)."""

    kind: Literal["robust"] = "robust"
    task: Literal["position", "pose"] = "position"
    tip: Annotated[str | None, Field(description="the tip that is held; the first by default")] = None
    base: Annotated[
        tuple[ConstraintName, ...],
        Field(description="base angles held besides: any of roll, pitch, yaw; or rotation_vector; or none"),
    ] = ("yaw",)
    rate: Annotated[Frequency, Field(gt=0, description="at which errors die out on the sliding surface, 1/s")] = 40.0
    reach: Annotated[Frequency, Field(gt=0, description="at which the surface is reached, 1/s")] = 40.0
    switch: Annotated[float, Field(ge=0, description="size of the sliding term, m/s2 or rad/s2")] = 1.0
    layer: Annotated[AngularSpeed, Field(gt=0, description="boundary layer in which it is linear, m/s or rad/s")] = 0.05
    tip_damping: Annotated[float, Field(gt=0, description="lambda in J^T (J J^T + lambda^2 E)^-1, of the tip")] = 0.05
    base_damping: Annotated[float, Field(gt=0, description="lambda of the base angles, below the tip")] = 0.1
    base_limit: Annotated[
        AngularSpeed, Field(gt=0, description="largest rate at which the base is led back: no violent motion for it")
    ] = 0.1
    posture: Annotated[
        Frequency, Field(gt=0, description="natural, rad/s, of the joints' own errors in what tip and base leave free")
    ] = 2.0

    @field_validator("base")
    @classmethod
    def _distinct(cls, names: tuple[ConstraintName, ...]) -> tuple[ConstraintName, ...]:
        if len(set(names)) != len(names) or ("rotation_vector" in names and len(names) > 1):
            raise ValueError("every angle once; rotation_vector stands alone")
        return names


def build(model: RobotModel, spec: RobustSpec) -> TorqueLaw:
    """Task-space sliding control (after Slotine and Li 1991, chapter 7) on the free base, in three ranks.

    The tip comes first, the base's angles in what it leaves free, the joints' own reference, gently, in what both
    leave free and near singular postures, where the damped inverses give way to it. Inverse dynamics and Jacobians are
    those of the robot as the controller knows it; errors and their rates are measured.
    """
    inputs = TorqueInputs.symbols(model.n)
    gain = {name: ca.SX.sym(name) for name in ("rate", "reach", "switch", "layer", "base_limit", "posture")}
    ranks = [(tip_followed(model, inputs, spec.tip, spec.task == "pose"), spec.tip_damping)]
    if spec.base and model.floating:
        ranks.append((base_followed(model, inputs, spec.base), spec.base_damping))
    qdd, free = ca.SX.zeros(model.n), ca.SX.eye(model.n)
    slides: list[ca.SX] = []
    for followed, damping in ranks:
        limit = gain["base_limit"] if slides else None
        J = ca.mtimes(followed.rows, free)
        inverse = damped_pseudo_inverse(J, damping**2)
        wanted, slide = _correction(followed, gain, limit)
        qdd = qdd + ca.mtimes(inverse, wanted - ca.mtimes(followed.rows, qdd))
        free = free - ca.mtimes(inverse, J)
        slides.append(slide)
    own = gain["posture"] * (2 * (inputs.qd_wanted - inputs.qd) + gain["posture"] * (inputs.q_wanted - inputs.q))
    qdd = inputs.qdd_wanted + qdd + ca.mtimes(free, own)
    units = {"tip": "m/s", "base": "rad/s"}
    signals = {
        Signal(f"{name}_slide", unit, f"distance from the {name}'s sliding surface"): size(slide)
        for (name, unit), slide in zip(units.items(), slides, strict=False)
    }
    parameters = {parameter(name): symbol for name, symbol in gain.items()}
    return make_torque_law(inputs, inverse_dynamics(model, inputs, qdd), parameters, signals)


def _correction(followed: Followed, gain: dict[str, ca.SX], limit: ca.SX | None) -> tuple[ca.SX, ca.SX]:
    """Acceleration (k) beside the reference's own, and sigma (k); ``limit`` of the rate at which errors die out."""
    back = gain["rate"] * followed.error
    if limit is not None:
        back = ca.fmax(-limit, ca.fmin(limit, back))
    slide = followed.rate + back
    inside = ca.fmax(-1.0, ca.fmin(1.0, slide / gain["layer"]))
    return gain["rate"] * followed.rate + gain["reach"] * slide + gain["switch"] * inside, slide
