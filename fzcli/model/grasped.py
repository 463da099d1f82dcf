"""A payload seized by a tip, in the terms of `momentum_motion`: momentum passes through, energy may not."""

import casadi as ca

from fzcli.model.algebra import rotate
from fzcli.model.balance import kinetic_energy, momentum_of
from fzcli.model.forward_dynamics import grasp_jump
from fzcli.model.free_motion import Moment
from fzcli.model.robot_model import RobotModel


def grasped_state(
    model: RobotModel, inputs: tuple[str, ...], tip: str | None = None, work: bool = False
) -> ca.Function:
    """(state, input, payload_twist) -> state_next of `momentum_motion`, after the tip has seized the payload.

    Before, the robot moves without the ``payload`` of the input, which has a twist (6) of its own, at the tip, world
    axes; after, both are one: an inelastic impact that no motor resists (see `forward_dynamics.grasp_jump`). What
    energy the robot gains or loses by it is booked as work, so that the balance stays closed.
    """
    its = Moment.of(model, inputs, tip, work)
    before, place, R = its.unloaded(), its.place, its.R
    own, qd = ca.SX.sym("payload_twist", 6), its.state[place.qd]
    twist = (rotate(R.T, own[:3]), rotate(R.T, own[3:]))
    was = (before.velocity, before.rate, qd)
    jump, moved = grasp_jump(its.momenta, its.frame, was, its.acting["payload"], twist)
    now = (before.velocity + moved.linear, before.rate + moved.angular, qd + jump)
    following = ca.SX(its.state)
    following[place.qd] = now[2]
    if model.floating:
        linear, angular = momentum_of(its.momenta, *now)
        wheels = its.state[place.wheels] if place.wheels.start < place.wheels.stop else ca.SX.zeros(3)
        following[place.place] = before.base_position + rotate(R, its.momenta.frame.com)
        following[place.velocity] = ca.vertcat(rotate(R, linear), rotate(R, angular + wheels))
    if work:
        gain = kinetic_energy(its.momenta, *now) - kinetic_energy(before.momenta, *was)
        following[place.work] = its.state[place.work] + gain
    names = ["state", "input", "payload_twist"]
    return ca.Function(
        "grasped_state", [its.state, its.given, own], ca.cse([ca.densify(following)]), names, ["state_next"]
    )
