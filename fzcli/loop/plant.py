"""The velocity-level plant: joints follow their commanded rates, the base follows momentum."""

from dataclasses import dataclass

import casadi as ca

from fzcli.model import RobotModel
from fzcli.model.algebra import cross, rotate, symmetric_inverse
from fzcli.model.attitude import attitude_step, rotation_matrix
from fzcli.model.gauss_magnus import NODES, magnus


@dataclass(frozen=True)
class Plant:
    """A plant ready to be composed; ``angular_momentum`` (3) is conserved, about the CoM, world axes.

    ``rate``: (state, command, angular_momentum) -> derivative. ``advance``: (state, derivative, dt) -> state,
    on the group. ``magnus``: (state, command, angular_momentum, dt) -> the derivative that makes the
    fourth-order step, where that was asked for. ``observe``: state -> q (n), base_quat (4). ``motion``:
    (state, derivative) -> qd (n), base_velocity (3) of the base frame's origin relative to the CoM's,
    base_rate (3); world axes. ``residual``: (state, derivative, angular_momentum) -> linear (3) and angular
    (3) momentum that should be zero. ``travel``: (derivative, dt) -> squared size of a step. ``truth``:
    state -> the base_quat (4) that momentum really leads to, of a plant that leaves it out, else None.
    """

    rate: ca.Function
    advance: ca.Function
    magnus: ca.Function | None
    observe: ca.Function
    motion: ca.Function
    residual: ca.Function
    travel: ca.Function
    truth: ca.Function | None
    state_size: int
    derivative_size: int


def kinematic_plant(model: RobotModel, translation_only: bool = False, fourth_order: bool = False) -> Plant:
    """State (q, base_quat), derivative (qd, base angular velocity in base axes).

    ``translation_only``: the base moves so that the CoM stands still but does not turn, as in Dong 2022; the
    attitude that the true base takes under the same joint motion is carried along behind (quat, rate).
    ``fourth_order``: with ``magnus``.
    """
    n = model.n
    shadow = translation_only and model.floating
    state, derivative = ca.SX.sym("state", n + (8 if shadow else 4)), ca.SX.sym("derivative", n + (6 if shadow else 3))
    command, L, dt = ca.SX.sym("command", n), ca.SX.sym("angular_momentum", 3), ca.SX.sym("dt")
    q, quat = state[:n], state[n : n + 4]
    qd, w = derivative[:n], derivative[n : n + 3]
    com, inertia, com_jacobian, momentum, _ = model.function("body")(q)
    R = rotation_matrix(quat)
    angular = linear = velocity = ca.SX.zeros(3)
    if model.floating:
        drift = cross(w, com)
        velocity = -rotate(R, ca.mtimes(com_jacobian, qd) + drift)
        angular = ca.mtimes(inertia, w) + ca.mtimes(momentum, qd) - rotate(R.T, L)
        linear = rotate(R.T, velocity) + drift + ca.mtimes(com_jacobian, qd)  # base axes
    real = state[n + 4 :] if shadow else quat
    turn = _turn_rate(model, q, real, command, L)
    still = [ca.SX.zeros(3)] if shadow else []
    quats = [quat, state[n + 4 :]] if shadow else [quat]
    rates = [w, derivative[n + 3 :]] if shadow else [w]
    following = [attitude_step(a, b * dt) if model.floating else a for a, b in zip(quats, rates, strict=True)]
    return Plant(
        rate=ca.Function("rate", [state, command, L], [ca.vertcat(command, *still, turn)]),
        advance=ca.Function("advance", [state, derivative, dt], [ca.vertcat(q + qd * dt, *following)]),
        magnus=ca.Function(
            "magnus",
            [state, command, L, dt],
            [ca.vertcat(command, *still, _gauss_rate(model, q, real, command, L, dt))],
        )
        if fourth_order
        else None,
        observe=ca.Function("observe", [state], [q, quat]),
        motion=ca.Function("motion", [state, derivative], [qd, ca.densify(velocity), rotate(R, w)]),
        residual=ca.Function(
            "residual", [state, derivative, L], [ca.densify(model.mass * linear), ca.densify(angular)]
        ),
        travel=ca.Function("travel", [derivative, dt], [ca.sumsqr(derivative) * (dt * dt)]),
        truth=ca.Function("truth", [state], [real]) if shadow else None,
        state_size=state.shape[0],
        derivative_size=derivative.shape[0],
    )


def _turn_rate(model: RobotModel, q: ca.SX, quat: ca.SX, command: ca.SX, L: ca.SX) -> ca.SX:
    """The base's angular velocity (3), base axes."""
    if not model.floating:
        return ca.SX.zeros(3)
    _, inertia, _, _, base_rate = model.function("body")(q)
    return ca.mtimes(base_rate, command) + rotate(symmetric_inverse(inertia), rotate(rotation_matrix(quat).T, L))


def _gauss_rate(model: RobotModel, q: ca.SX, quat: ca.SX, command: ca.SX, L: ca.SX, dt: ca.SX) -> ca.SX:
    """The base's mean angular velocity (3), base axes, over a period of constant joint rates.

    The rate at the Gauss nodes hangs on the attitude there where there is momentum. Each pass predicts it
    from the polynomial through the rates found so far, at the start and at the nodes, which raises the order
    of the whole by one, to four with the last.
    """
    if not model.floating:
        return ca.SX.zeros(3)

    def at(share: float, turned: ca.SX) -> ca.SX:
        return _turn_rate(model, q + command * (share * dt), attitude_step(quat, turned), command, L)

    first = at(0.0, ca.SX.zeros(3))
    nodes = [at(c, first * (c * dt)) for c in NODES]
    for _ in range(2):
        nodes = [at(c, _turn_to(c, first, nodes, dt)) for c in NODES]
    return magnus(nodes[0] * dt, nodes[1] * dt) / dt


def _turn_to(share: float, first: ca.SX, nodes: list[ca.SX], dt: ca.SX) -> ca.SX:
    """The rotation vector (3) from the start to ``share`` of the period, from rates at 0 and both nodes.

    Integral of the parabola through the rates, and the leading term of Magnus, (t^3/12) (w0 x w0').
    """
    a, b = NODES
    slope_a, slope_b = (nodes[0] - first) / a, (nodes[1] - first) / b
    bend = (slope_b - slope_a) / (b - a)  # w(s) = first + slope s + bend s^2
    slope = slope_a - a * bend
    mean = first * share + slope * (share**2 / 2) + bend * (share**3 / 3)
    return mean * dt + cross(first, slope) * (dt * dt * (share**3 / 12))
