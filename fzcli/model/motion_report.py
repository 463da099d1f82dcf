"""What a state of `momentum_motion` says of a moving robot: base, energy, momentum, and the arm's pull on the base."""

import casadi as ca

from fzcli.model.algebra import cross, rotate
from fzcli.model.balance import base_acceleration, kinetic_energy, momentum_of
from fzcli.model.free_motion import TORQUE, Moment
from fzcli.model.newton_euler import Motion, Wrench, acceleration_matrix, inertial_wrench
from fzcli.model.robot_model import RobotModel


def motion_report(
    model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state, input) of `momentum_motion` -> base_position (3), base_twist (6), energy [J], momentum (6),
    base_momentum (6) and base_reaction (6); world axes.

    ``momentum``: of all bodies, payload included, wheels not, from the base's twist, angular about the CoM.
    ``base_momentum``: the base's share of it (the rest has gone into the arm). ``base_reaction``: force and moment
    at the base frame's origin that the arm exerts on the base.
    """
    its = Moment.of(model, inputs, tip, work)
    R, moving = its.R, (its.momenta, its.velocity, its.rate, its.state[its.place.qd])
    linear, angular = momentum_of(*moving)
    own, reaction = _base_momentum(its), _reaction(its)
    outputs = {
        "base_position": its.base_position,
        "base_twist": its.base_twist,
        "energy": kinetic_energy(*moving),
        "momentum": ca.vertcat(rotate(R, linear), rotate(R, angular)),
        "base_momentum": ca.vertcat(rotate(R, own.force), rotate(R, own.moment)),
        "base_reaction": ca.vertcat(rotate(R, reaction.force), rotate(R, reaction.moment)),
    }
    results = ca.cse([ca.densify(value) for value in outputs.values()])
    return ca.Function("motion_report", [its.state, its.given], results, ["state", "input"], list(outputs))


def _base_momentum(its: Moment) -> Wrench:
    """Of the base alone: linear, and angular about the system's CoM; base axes."""
    base, com = its.bodies[-1], its.momenta.frame.com
    linear = base.mass * its.velocity + cross(its.rate, base.first_moment)
    about_origin = rotate(base.tensor, its.rate) + cross(base.first_moment, its.velocity)
    return Wrench(linear, about_origin - cross(com, linear))


def _reaction(its: Moment) -> Wrench:
    """What the arm does to the base, about the base frame's origin; base axes."""
    bias, qdd = its.bias(), its.joint_acceleration()
    moved = base_acceleration(its.momenta, bias, its.felt, qdd)
    if not its.model.floating:
        force = bias.force + ca.mtimes(its.momenta.linear, qdd)
        moment = bias.moment + ca.mtimes(its.momenta.angular, qdd) + cross(its.momenta.frame.com, force)
        wrench, place = its.acting["tip_wrench"], its.tip_point
        force = force - rotate(its.R.T, wrench[:3])
        moment = moment - rotate(its.R.T, wrench[3:]) - cross(place, rotate(its.R.T, wrench[:3]))
        return Wrench(-force, -moment)
    motion = Motion(its.rate, moved.angular, moved.linear)
    needed = inertial_wrench(its.bodies[-1], motion.linear, acceleration_matrix(motion))
    given = its.acting["base_wrench"] + its.by_wheels
    return needed.minus(Wrench(rotate(its.R.T, given[:3]), rotate(its.R.T, given[3:])))


def com_offset(model: RobotModel, inputs: tuple[str, ...] = TORQUE, tip: str | None = None) -> ca.Function:
    """(q, base_quat, input) -> the CoM (3) from the base frame's origin, world axes, without a payload; 0 if fixed."""
    its = Moment.of(model, inputs, tip, work=False).unloaded()
    found = rotate(its.R, its.momenta.frame.com) if model.floating else ca.SX.zeros(3)
    whole = ca.Function("com", [its.state, its.given], [ca.densify(found)])
    q, quat, given = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4), ca.SX.sym("input", its.given.shape[0])
    state = ca.SX.zeros(its.place.size)
    state[its.place.q], state[its.place.quat] = q, quat
    return ca.Function("com_offset", [q, quat, given], [whole(state, given)], ["q", "base_quat", "input"], ["offset"])
