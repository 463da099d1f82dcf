"""The torque-level plant: a robot with inertia, friction and limits, moved by torques and by what acts from outside."""

from dataclasses import dataclass

import casadi as ca

from fzcli.loop.replay_spec import AttitudeSpec, ReplaySpec
from fzcli.model import RobotModel, build_model
from fzcli.model.algebra import rotate
from fzcli.model.attitude import conjugate, multiply, rotation_matrix, rotation_vector
from fzcli.model.free_motion import ATTITUDE, Layout, layout, momentum_motion
from fzcli.model.grasped import grasped_state
from fzcli.model.integrators import euler, munthe_kaas, rk4
from fzcli.model.motion_report import motion_report
from fzcli.spec.quantity import Parameter

INTEGRATORS = {"euler": euler, "rk4": rk4, "munthe_kaas": munthe_kaas}
MASSES, INERTIAS, EACH, ALL = (f"replay.errors.{name}" for name in ("masses", "inertias", "each", "all"))


@dataclass(frozen=True)
class TorquePlant:
    """A plant ready to be composed; its state is that of `momentum_motion`, with work, at ``place``.

    ``rate``: (state, input) -> rate. ``advance``: (state, input, dt) -> state_next. ``report``: see `motion_report`.
    ``limit``: commanded torques (n) -> given ones. ``grasped``: see `grasped_state`, None without a payload.
    ``inputs``: what the input vector is made of, in its order.
    """

    model: RobotModel
    spec: ReplaySpec
    tip: str | None
    place: Layout
    rate: ca.Function
    advance: ca.Function
    report: ca.Function
    limit: ca.Function
    grasped: ca.Function | None
    parameters: tuple[Parameter, ...]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of what acts on the robot."""
        return self.spec.inputs


def torque_plant(model: RobotModel, spec: ReplaySpec, tip: str | None) -> TorquePlant:
    """The plant of a replay; ``model`` is that of the run's robot. Raises SpecError for a joint without inertia."""
    plant = model if spec.robot is None else build_model(spec.robot)
    inputs = spec.inputs
    rate = momentum_motion(plant, inputs, tip, work=True)
    method = INTEGRATORS.get(spec.integrator, munthe_kaas)
    parameters: list[Parameter] = []
    if spec.errors is not None:
        bodies = plant.n + 1
        parameters += [Parameter(ALL), Parameter(EACH), Parameter(MASSES, bodies), Parameter(INERTIAS, bodies)]
    if spec.grasp is not None:
        sizes = {"at": 1, "mass": 1, "com": 3, "inertia": 6, "velocity": 3, "rate": 3}
        parameters += [Parameter(f"replay.grasp.{name}", size) for name, size in sizes.items()]
    return TorquePlant(
        model=plant,
        spec=spec,
        tip=tip,
        place=layout(plant, inputs, work=True),
        rate=rate,
        advance=method(rate, ATTITUDE),
        report=motion_report(plant, inputs, tip, work=True),
        limit=plant.function("limited_torque"),
        grasped=None if spec.grasp is None else grasped_state(plant, inputs, tip, work=True),
        parameters=tuple(parameters),
    )


def input_vector(
    plant: TorquePlant, values: dict[str, ca.SX], torque: ca.SX, time: ca.SX, base: ca.SX, held: ca.SX
) -> ca.SX:
    """The plant's input at a time: ``values`` of its parameters by path, ``torque`` (n), ``base`` (3) the moment of the
    attitude control (thrusters: world axes, wheels: base axes), ``held`` 1 where the payload is on the tip."""
    spec = plant.spec
    pieces = {"torque": torque, "wheel_torque": base}
    for name, on in (("base_wrench", "base"), ("tip_wrench", "tip")):
        pieces[name] = _wrench(spec, on, time)
    if spec.attitude is not None and spec.attitude.by == "thrusters":
        pieces["base_wrench"] = pieces["base_wrench"] + ca.vertcat(ca.SX.zeros(3), base)
    if spec.errors is not None:
        alike, each = 1 + values[ALL], values[EACH]
        pieces["mass_factors"] = alike * (1 + each * values[MASSES])
        pieces["inertia_factors"] = alike * (1 + each * values[INERTIAS])
    if spec.grasp is not None:
        load = ca.vertcat(*(values[f"replay.grasp.{name}"] for name in ("mass", "com", "inertia")))
        pieces["payload"] = load * held
    return ca.densify(ca.vertcat(*(pieces[name] for name in plant.inputs)))


def _wrench(spec: ReplaySpec, on: str, time: ca.SX) -> ca.SX:
    """All wrenches (6) on the base or the tip at a time, world axes."""
    total = ca.SX.zeros(6)
    for wrench in spec.wrenches:
        if wrench.on != on:
            continue
        acting = time >= wrench.begin - 1e-9
        if wrench.end is not None:
            acting = ca.logic_and(acting, time < wrench.end - 1e-9)
        total = total + ca.if_else(acting, ca.SX(ca.DM([*wrench.force, *wrench.moment])), ca.SX.zeros(6))
    return total


def attitude_moment(
    model: RobotModel, spec: AttitudeSpec, q: ca.SX, quat: ca.SX, rate: ca.SX, wanted: ca.SX, wanted_rate: ca.SX
) -> ca.SX:
    """The moment (3) of the attitude control: on the base in world axes of thrusters, in base axes of wheels.

    ``rate`` (3), ``wanted_rate`` (3) in world axes; the inertia is the whole robot's, as its controller knows it.
    """
    R = rotation_matrix(quat)
    error = rotate(R.T, rotation_vector(multiply(wanted, conjugate(quat))))
    faster = rotate(R.T, wanted_rate - rate)
    inertia = model.function("body")(q)[1]
    moment = rotate(inertia, spec.frequency * (spec.frequency * error + 2 * spec.damping * faster))
    if spec.limit is not None:
        moment = ca.vertcat(*(ca.fmin(ca.fmax(moment[i], -spec.limit), spec.limit) for i in range(3)))
    return moment if spec.by == "wheels" else rotate(R, moment)
