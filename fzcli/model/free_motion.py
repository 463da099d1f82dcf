"""The robot under torques as an ordinary differential equation: (state, input) -> rate, the attitude on the group.

Two choices of the state, of one size and order (`layout`), for the integrators of `fzcli.model.integrators`:

`twist_motion`     base_position (3), base_quat (4), q (n), base_twist (6), qd (n)
`momentum_motion`  com (3), base_quat (4), q (n), momentum (6: linear, then angular about the CoM), qd (n)

all in world axes. The momentum of the second changes by outer forces alone, so that without them no step
size can spoil it, nor the CoM's straight path. On a fixed base, which stays where it is, the base's origin
stands for the CoM. The rate has three entries in place of the quaternion: the base's angular velocity in its
own axes.

Inputs are named in the order of the input vector; those not named are zero and cost nothing:
torque (n) of the motors, base_wrench (6, thrusters), wheel_torque (3), tip_wrench (6), payload (10);
`momentum_motion` alone takes mass_factors and inertia_factors (n+1 each, 1 unless given): see `loaded_bodies`.
A wheel's torque acts on the base in base axes and takes its opposite into the wheels' momentum (3, base
axes), which then follows in the state; the base's inertia must leave out the wheels' spin. With ``work``
the state ends with the work [J] of all that acts, friction's with its sign: the kinetic energy less this
stays what it was, to the integrator's order.
"""

from dataclasses import dataclass, replace
from itertools import accumulate, pairwise

import casadi as ca

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, rotate
from fzcli.model.attitude import rotation_matrix
from fzcli.model.balance import Bias, Momenta, build_bias, build_momenta, joint_share, moved_to_com, tip_place
from fzcli.model.composite import Composite
from fzcli.model.forward_dynamics import check_inertia, joint_acceleration
from fzcli.model.newton_euler import Wrench
from fzcli.model.payload import PAYLOAD, loaded_bodies
from fzcli.model.robot_model import RobotModel
from fzcli.model.tree import TipFrame

FACTORS = ("mass_factors", "inertia_factors")
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

    Raises SpecError for a joint that moves no inertia.
    """
    check_inertia(model)
    its = Moment.of(model, inputs, tip, work)
    place, acting, state = its.place, its.acting, its.state
    none = ca.SX.zeros(3)
    changes, of_com = ca.SX.zeros(6), none
    if model.floating:
        changes = ca.vertcat(rotate(its.R, its.outer.force), rotate(its.R, its.outer.moment))
        of_com = state[place.velocity][:3] / its.momenta.mass
    rates = [of_com, its.rate, state[place.qd], changes, its.joint_acceleration()]
    if "wheel_torque" in inputs:
        rates.append(-acting["wheel_torque"] if model.floating else none)
    if work:
        moved = (state[place.q], state[place.quat], state[place.qd], its.base_twist)
        rates.append(_power(model, tip, moved, acting, acting["base_wrench"] + its.by_wheels))
    return _motion("momentum_motion", state, its.given, rates)


def observe_momentum_motion(
    model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state of `momentum_motion`, input) -> base_position (3), base_twist (6), world axes."""
    its = Moment.of(model, inputs, tip, work)
    outputs = ca.cse([ca.densify(its.base_position), ca.densify(its.base_twist)])
    names = ["base_position", "base_twist"]
    return ca.Function("observe_momentum_motion", [its.state, its.given], outputs, ["state", "input"], names)


def _base_motion(momenta: Momenta, state: ca.SX, place: Layout, R: ca.SX) -> tuple[ca.SX, ca.SX]:
    """The base frame's velocity and angular velocity (3), base axes, that the momentum in the state means."""
    if not momenta.tree.floating:
        return ca.SX.zeros(3), ca.SX.zeros(3)
    momentum, qd = state[place.velocity], state[place.qd]
    stored = state[place.wheels] if place.wheels.start < place.wheels.stop else ca.SX.zeros(3)
    rate = rotate(momenta.inverse, rotate(R.T, momentum[3:]) - stored) + ca.mtimes(momenta.base_rate, qd)
    of_com = (rotate(R.T, momentum[:3]) - ca.mtimes(momenta.linear, qd)) / momenta.mass
    return of_com - cross(rate, momenta.frame.com), rate


def _bodies(model: RobotModel, frame: TipFrame, acting: dict[str, ca.SX], payload: ca.SX) -> list[Composite]:
    factors = (acting[FACTORS[0]], acting[FACTORS[1]]) if FACTORS[0] in acting else None
    return loaded_bodies(model.tree, frame, payload, factors)


@dataclass(frozen=True)
class Moment:
    """What a state of `momentum_motion` and an input mean: symbols, masses, forces and the base's motion.

    ``bodies``: the parts of the tree, the base last; ``velocity`` and ``rate`` (3) of the base frame, base axes;
    ``outer``: all that acts on the system from outside, about the CoM, base axes; ``by_wheels`` (6), world axes.
    """

    model: RobotModel
    frame: TipFrame
    place: Layout
    state: ca.SX
    given: ca.SX
    acting: dict[str, ca.SX]
    bodies: list[Composite]
    momenta: Momenta
    R: ca.SX
    velocity: ca.SX
    rate: ca.SX
    outer: Wrench
    share: ca.SX
    by_wheels: ca.SX

    @staticmethod
    def of(model: RobotModel, inputs: tuple[str, ...], tip: str | None, work: bool) -> "Moment":
        """At fresh symbols."""
        place = layout(model, inputs, work)
        state = ca.SX.sym("state", place.size)
        given, acting = _inputs(model, inputs, FACTORS)
        frame = model.tree.tips[model.tips[0] if tip is None else tip]
        bodies = _bodies(model, frame, acting, acting["payload"])
        momenta, R = build_momenta(model.tree, state[place.q], bodies), rotation_matrix(state[place.quat])
        velocity, rate = _base_motion(momenta, state, place, R)
        outer, share = _outer(momenta, frame, R, acting)
        by_wheels = _by_wheels(state, place, acting, R, rate)
        return Moment(
            model, frame, place, state, given, acting, bodies, momenta, R, velocity, rate, outer, share, by_wheels
        )

    def unloaded(self) -> "Moment":
        """The same without the payload: its masses, and what the momentum in the state means then."""
        empty = _bodies(self.model, self.frame, self.acting, ca.SX.zeros(PAYLOAD))
        momenta = build_momenta(self.model.tree, self.state[self.place.q], empty)
        velocity, rate = _base_motion(momenta, self.state, self.place, self.R)
        return replace(self, bodies=empty, momenta=momenta, velocity=velocity, rate=rate)

    @property
    def base_position(self) -> ca.SX:
        """Of the base frame's origin, (3), world."""
        held = self.state[self.place.place]
        return held - rotate(self.R, self.momenta.frame.com) if self.model.floating else held

    @property
    def base_twist(self) -> ca.SX:
        """At the base frame's origin, (6), world axes."""
        return ca.vertcat(rotate(self.R, self.velocity), rotate(self.R, self.rate))

    @property
    def felt(self) -> Wrench:
        """All that acts from outside and the wheels' torque, about the CoM, base axes."""
        return Wrench(self.outer.force, self.outer.moment + rotate(self.R.T, self.by_wheels[3:]))

    @property
    def tip_point(self) -> ca.SX:
        """The tip's origin, (3), from the base frame's, base axes."""
        return tip_place(self.momenta, self.frame)[0]

    def bias(self) -> Bias:
        """Forces of the motion without acceleration."""
        return build_bias(self.momenta, self.bodies, self.state[self.place.q], self.state[self.place.qd], self.rate)

    def joint_acceleration(self) -> ca.SX:
        """qdd (n)."""
        qd = self.state[self.place.qd]
        return joint_acceleration(self.momenta, self.bias(), qd, self.acting["torque"], self.felt, self.share)


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


def _inputs(
    model: RobotModel, inputs: tuple[str, ...], more: tuple[str, ...] = ()
) -> tuple[ca.SX, dict[str, ca.SX]]:
    """The input vector, and every input by name, zeros where it is not asked for."""
    sizes = {"torque": model.n, "base_wrench": 6, "wheel_torque": 3, "tip_wrench": 6, "payload": PAYLOAD}
    sizes |= dict.fromkeys(more, model.n + 1)
    unknown = [name for name in inputs if name not in sizes]
    if unknown:
        raise SpecError(Problem(f"no input {unknown[0]!r}; the motion takes {', '.join(sizes)}", field="inputs"))
    symbols = {name: ca.SX.sym(name, sizes[name]) for name in inputs}
    zeros = {name: ca.SX.zeros(size) for name, size in sizes.items() if name not in FACTORS}
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
