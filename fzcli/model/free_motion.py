"""The robot under torques as an ordinary differential equation: (state, input) -> rate, the attitude on the group.

Two choices of the state, of one size and order (`layout`), for the integrators of `fzcli.model.integrators`:

`twist_motion`     base_position (3), base_quat (4), q (n), base_twist (6), qd (n)
`momentum_motion`  com (3), base_quat (4), q (n), momentum (6: linear, then angular about the CoM), qd (n)

all in world axes. The momentum of the second changes by outer forces alone, so that without them no step
size can spoil it, nor the CoM's straight path; the first serves fixed bases too. The rate has three
entries in place of the quaternion: the base's angular velocity in its own axes.

Inputs are named in the order of the input vector; those not named are zero and cost nothing:
torque (n) of the motors, base_wrench (6, thrusters), wheel_torque (3), tip_wrench (6), payload (10).
A wheel's torque acts on the base in base axes and takes its opposite into the wheels' momentum (3, base
axes), which then follows in the state; the base's inertia must leave out the wheels' spin. With ``work``
the state ends with the work [J] of all that acts, friction's with its sign: the kinetic energy less this
stays what it was, to the integrator's order.
"""

from dataclasses import dataclass
from itertools import accumulate, pairwise

import casadi as ca

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.balance import Momenta, build_bias, build_momenta, joint_share, moved_to_com, tip_place
from fzcli.model.forward_dynamics import check_inertia, joint_acceleration
from fzcli.model.newton_euler import Wrench
from fzcli.model.payload import PAYLOAD, loaded_bodies
from fzcli.model.robot_model import RobotModel
from fzcli.model.tree import TipFrame

ATTITUDE = 3  # where the quaternion starts in the state
TORQUE = ("torque",)


@dataclass(frozen=True)
class Layout:
    """Where the parts of a state stand; ``wheels`` and ``work`` are empty where they are not asked for."""

    place: slice
    quat: slice
    q: slice
    velocity: slice
    qd: slice
    wheels: slice
    work: slice
    size: int


def layout(model: RobotModel, inputs: tuple[str, ...] = TORQUE, work: bool = False) -> Layout:
    """The layout of the states of both motions under these inputs."""
    n, wheels = model.n, 3 if "wheel_torque" in inputs else 0
    ends = list(accumulate((3, 4, n, 6, n, wheels, 1 if work else 0), initial=0))
    place, quat, q, velocity, qd, wheel, done = (slice(a, b) for a, b in pairwise(ends))
    return Layout(place, quat, q, velocity, qd, wheel, done, ends[-1])


def twist_motion(
    model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state, input) -> rate, with the base's twist in the state; ``tip`` takes wrench and payload.

    Raises SpecError for a joint that moves no inertia.
    """
    place = layout(model, inputs, work)
    state = ca.SX.sym("state", place.size)
    given, acting = _inputs(model, inputs)
    q, quat, qd, twist = state[place.q], state[place.quat], state[place.qd], state[place.velocity]
    R = rotation_matrix(quat)
    rate = rotate(R.T, twist[3:])
    on_base = acting["base_wrench"] + _by_wheels(state, place, acting, R, rate)
    qdd, acceleration = model.function("forward_dynamics", tip)(
        q, quat, qd, twist, acting["torque"], on_base, acting["tip_wrench"], acting["payload"]
    )
    rates = [twist[:3], rate, qd, acceleration, qdd]
    if "wheel_torque" in inputs:
        rates.append(-acting["wheel_torque"])
    if work:
        rates.append(_power(model, tip, (q, quat, qd, twist), acting, on_base))
    return _motion("twist_motion", state, given, rates)


def momentum_motion(
    model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state, input) -> rate, with CoM and momentum in the state, the wheels' and the payload's included.

    Raises SpecError for a fixed base, and for a joint that moves no inertia.
    """
    if not model.floating:
        raise SpecError(Problem("momentum is conserved on a floating base only", field="base.floating"))
    check_inertia(model)
    place = layout(model, inputs, work)
    state = ca.SX.sym("state", place.size)
    given, acting = _inputs(model, inputs)
    frame = model.tree.tips[model.tips[0] if tip is None else tip]
    q, qd, R = state[place.q], state[place.qd], rotation_matrix(state[place.quat])
    parts = loaded_bodies(model.tree, frame, acting["payload"])
    momenta = build_momenta(model.tree, q, parts)
    velocity, rate = _base_motion(momenta, state, place, R)
    bias = build_bias(momenta, parts, q, qd, rate)
    by_wheels = _by_wheels(state, place, acting, R, rate)
    outer, share = _outer(momenta, frame, R, acting)
    felt = Wrench(outer.force, outer.moment + rotate(R.T, by_wheels[3:]))
    qdd = joint_acceleration(momenta, bias, qd, acting["torque"], felt, share)
    changes = ca.vertcat(rotate(R, outer.force), rotate(R, outer.moment))
    rates = [state[place.velocity][:3] / momenta.mass, rate, qd, changes, qdd]
    if "wheel_torque" in inputs:
        rates.append(-acting["wheel_torque"])
    if work:
        twist = ca.vertcat(rotate(R, velocity), rotate(R, rate))
        moved = (q, state[place.quat], qd, twist)
        rates.append(_power(model, tip, moved, acting, acting["base_wrench"] + by_wheels))
    return _motion("momentum_motion", state, given, rates)


def observe_momentum_motion(
    model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state of `momentum_motion`, input) -> base_position (3), base_twist (6), world axes."""
    place = layout(model, inputs, work)
    state = ca.SX.sym("state", place.size)
    given, acting = _inputs(model, inputs)
    frame = model.tree.tips[model.tips[0] if tip is None else tip]
    momenta = build_momenta(model.tree, state[place.q], loaded_bodies(model.tree, frame, acting["payload"]))
    R = rotation_matrix(state[place.quat])
    velocity, rate = _base_motion(momenta, state, place, R)
    position = state[place.place] - rotate(R, momenta.frame.com)
    outputs = ca.cse([ca.densify(position), ca.densify(ca.vertcat(rotate(R, velocity), rotate(R, rate)))])
    names = ["base_position", "base_twist"]
    return ca.Function("observe_momentum_motion", [state, given], outputs, ["state", "input"], names)


def _base_motion(momenta: Momenta, state: ca.SX, place: Layout, R: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The base frame's velocity and angular velocity (3), base axes, that the momentum in the state means."""
    momentum, qd = state[place.velocity], state[place.qd]
    stored = state[place.wheels] if place.wheels.start < place.wheels.stop else ca.SX.zeros(3)
    rate = rotate(momenta.inverse, rotate(R.T, momentum[3:]) - stored) + ca.mtimes(momenta.base_rate, qd)
    of_com = (rotate(R.T, momentum[:3]) - ca.mtimes(momenta.linear, qd)) / momenta.mass
    return of_com - cross(rate, momenta.frame.com), rate


def _by_wheels(state: ca.SX, place: Layout, acting: dict[str, ca.SX], R: ca.SX, rate: ca.SX) -> ca.SX:
    """The wrench (6) of the wheels on the base, world axes: their torque, and what turning their momentum takes."""
    if place.wheels.start == place.wheels.stop:
        return ca.SX.zeros(6)
    moment = acting["wheel_torque"] - cross(rate, state[place.wheels])
    return ca.vertcat(ca.SX.zeros(3), rotate(R, moment))


def _power(
    model: RobotModel, tip: str | None, moved: tuple[ca.SX, ...], acting: dict[str, ca.SX], on_base: ca.SX
) -> ca.SX:
    """The power [W] of all that acts at (q, base_quat, qd, base_twist)."""
    motors, friction, base, on_tip = model.function("power", tip)(
        *moved, acting["torque"], on_base, acting["tip_wrench"]
    )
    total = base + on_tip
    for i in range(model.n):
        total = total + motors[i] + friction[i]
    return total


def _inputs(model: RobotModel, inputs: tuple[str, ...]) -> tuple[ca.SX, dict[str, ca.SX]]:
    """The input vector, and every input by name, zeros where it is not asked for."""
    sizes = {"torque": model.n, "base_wrench": 6, "wheel_torque": 3, "tip_wrench": 6, "payload": PAYLOAD}
    unknown = [name for name in inputs if name not in sizes]
    if unknown:
        raise SpecError(Problem(f"no input {unknown[0]!r}; the motion takes {', '.join(sizes)}", field="inputs"))
    symbols = {name: ca.SX.sym(name, sizes[name]) for name in inputs}
    zeros = {name: ca.SX.zeros(size) for name, size in sizes.items()}
    return ca.vertcat(*symbols.values()), zeros | symbols


def _outer(momenta: Momenta, tip: TipFrame, R: ca.SX, acting: dict[str, ca.SX]) -> tuple[Wrench, ca.SX]:
    """Wrenches on base and tip together about the CoM, base axes, and what the tip's does at the joints."""
    on_base, on_tip = (
        Wrench(rotate(R.T, acting[name][:3]), rotate(R.T, acting[name][3:])) for name in ("base_wrench", "tip_wrench")
    )
    on_tip = moved_to_com(momenta, on_tip, tip_place(momenta, tip)[0])
    return moved_to_com(momenta, on_base, ca.SX.zeros(3)).plus(on_tip), joint_share(momenta, tip, on_tip)


def _motion(name: str, state: ca.SX, given: ca.SX, rates: list[ca.SX]) -> ca.Function:
    outputs = ca.cse([ca.densify(ca.vertcat(*rates))])
    return ca.Function(name, [state, given], outputs, ["state", "input"], ["rate"])
