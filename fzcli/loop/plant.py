"""The velocity-level plant: joints follow their commanded rates, the base follows momentum."""

from dataclasses import dataclass

import casadi as ca

from fzcli.model import RobotModel
from fzcli.model.algebra import cross, rotate, symmetric_inverse
from fzcli.model.attitude import attitude_step, rotation_matrix


@dataclass(frozen=True)
class Plant:
    """A plant ready to be composed; ``angular_momentum`` (3) is conserved, about the CoM, world axes.

    ``rate``: (state, command, angular_momentum) -> derivative. ``advance``: (state, derivative, dt)
    -> state, on the group. ``observe``: state -> q (n), base_quat (4). ``motion``: (state, derivative)
    -> qd (n), base_velocity (3) of the base frame's origin relative to the CoM's, base_rate (3);
    world axes. ``residual``: (state, derivative, angular_momentum) -> linear (3) and angular (3)
    momentum that should be zero. ``travel``: (derivative, dt) -> squared size of a step.
    """

    rate: ca.Function
    advance: ca.Function
    observe: ca.Function
    motion: ca.Function
    residual: ca.Function
    travel: ca.Function
    state_size: int
    derivative_size: int


def kinematic_plant(model: RobotModel) -> Plant:
    """State (q, base_quat), derivative (qd, base angular velocity in base axes)."""
    n = model.n
    state, derivative = ca.SX.sym("state", n + 4), ca.SX.sym("derivative", n + 3)
    command, L, dt = ca.SX.sym("command", n), ca.SX.sym("angular_momentum", 3), ca.SX.sym("dt")
    q, quat = state[:n], state[n:]
    qd, w = derivative[:n], derivative[n:]
    com, inertia, com_jacobian, momentum, base_rate = model.function("body")(q)
    R = rotation_matrix(quat)
    if model.floating:
        turn = ca.mtimes(base_rate, command) + rotate(symmetric_inverse(inertia), rotate(R.T, L))
        next_quat = attitude_step(quat, w * dt)
        drift = cross(w, com)
        velocity = -rotate(R, ca.mtimes(com_jacobian, qd) + drift)
        angular = ca.mtimes(inertia, w) + ca.mtimes(momentum, qd) - rotate(R.T, L)
        linear = rotate(R.T, velocity) + drift + ca.mtimes(com_jacobian, qd)  # base axes
    else:
        turn, next_quat, velocity = ca.SX.zeros(3), quat, ca.SX.zeros(3)
        angular = linear = ca.SX.zeros(3)
    return Plant(
        rate=ca.Function("rate", [state, command, L], [ca.vertcat(command, turn)]),
        advance=ca.Function("advance", [state, derivative, dt], [ca.vertcat(q + qd * dt, next_quat)]),
        observe=ca.Function("observe", [state], [q, quat]),
        motion=ca.Function("motion", [state, derivative], [qd, ca.densify(velocity), rotate(R, w)]),
        residual=ca.Function(
            "residual", [state, derivative, L], [ca.densify(model.mass * linear), ca.densify(angular)]
        ),
        travel=ca.Function("travel", [derivative, dt], [ca.sumsqr(derivative) * (dt * dt)]),
        state_size=n + 4,
        derivative_size=n + 3,
    )
