"""The pieces of a step at torque level: the segment of motion, torque control and integration, and the end of it."""

import casadi as ca

from fzcli.loop.adaptive import AdaptiveStep
from fzcli.loop.calls import outputs_of, sx_function
from fzcli.loop.guide import Segment, guide_sample, wanted_at
from fzcli.loop.reductions import Accumulators
from fzcli.loop.torque_parts import TorqueParts, TorqueVectors
from fzcli.loop.torque_plant import attitude_moment, input_vector
from fzcli.model.algebra import dot
from fzcli.model.free_motion import observe_momentum_motion

FASTEST = 1.0e4  # rad/s or m/s: joint speeds beyond which the integration counts as diverged
UNSTABLE = 4.0  # stop code


def begin(parts: TorqueParts, its: TorqueVectors, size: int) -> ca.Function:
    """(the run's next state, state, constants) -> moving, fixed, guide: the sample to come and how it is reached."""
    following = ca.SX.sym("following", size)
    n, state, constants = parts.run.model.n, its.state, its.constants
    com = constants["com"] + constants["com_velocity"] * ((state["count"] + 1) * parts.run.dt)
    sample = guide_sample(parts.run.model, parts.run.tip, following[:n], following[n : n + 4], com)
    piece = Segment.between(
        parts.guided, state["sample"], sample, state["slope"], state["rate"], state["bend"], parts.run.dt
    )
    zeros = {name: ca.SX.zeros(part.shape[0]) for name, part in its.moving.parts.items()}
    moving = its.moving.filled(zeros | {"plant": state["plant"], "held": state["held"]})
    fixed = its.fixed.filled({"coefficients": piece.coefficients, "time": state["count"] * parts.run.dt})
    guide = ca.vertcat(piece.sample, piece.slope, piece.rate, piece.bend)
    return sx_function("begin", [following, state.symbol, constants.symbol], [moving, fixed, guide])


def turn_of(its: TorqueVectors, control: ca.Function, integrate: ca.Function) -> ca.Function:
    """(moving, fixed, constants) -> moving: one step of torque control and integration."""
    symbols = its.moving.symbol, its.fixed.symbol, its.constants.symbol
    if integrate.is_a("SXFunction"):
        commanded, given = control(*symbols)
        return sx_function("turn", [*symbols], outputs_of(integrate(commanded, given)))
    wide = [ca.MX.sym("vector", symbol.shape[0]) for symbol in symbols]
    return ca.Function("turn", wide, [integrate(*control(*wide))])


def integration(parts: TorqueParts, its: TorqueVectors, adaptive: AdaptiveStep | None) -> ca.Function:
    """(moving, input) -> moving, a torque step later; the plant's state stands first in it."""
    size = parts.plant.place.size
    if adaptive is not None:
        wide, given = ca.MX.sym("moving", its.moving.size), ca.MX.sym("input", parts.plant.rate.size1_in(1))
        return ca.Function("integrate", [wide, given], [ca.vertcat(adaptive(wide[:size], given), wide[size:])])
    moving, held = its.moving.symbol, ca.SX.sym("input", parts.plant.rate.size1_in(1))
    following = parts.plant.advance(moving[:size], held, parts.h)
    return sx_function("integrate", [moving, held], [ca.vertcat(following, moving[size:])])


def control_of(parts: TorqueParts, its: TorqueVectors) -> ca.Function:
    """(moving, fixed, constants) -> moving, input: what the controller commands and what acts, payload seized."""
    plant, moving, constants = parts.plant, its.moving, its.constants
    state, model = moving["plant"], parts.run.model
    time = its.fixed["time"] + moving["number"] * parts.h
    share = moving["number"] * (1 / parts.spec.substeps)
    wanted = wanted_at(parts.guided, its.fixed["coefficients"], share, parts.run.dt)
    values = {parameter.path: constants[parameter.path] for parameter in plant.parameters}
    held, none = moving["held"], ca.SX.zeros(3)
    if plant.grasped is not None:
        held = ca.if_else(time >= values["replay.grasp.at"] - 1e-9, 1.0, 0.0)
        loaded = input_vector(plant, values, ca.SX.zeros(model.n), time, none, ca.SX(1))
        twist = ca.vertcat(values["replay.grasp.velocity"], values["replay.grasp.rate"])
        state = ca.if_else(held > moving["held"], plant.grasped(state, loaded, twist), state)
    measure = observe_momentum_motion(plant.model, plant.inputs, plant.tip, work=True)
    position, twist = measure(state, input_vector(plant, values, ca.SX.zeros(model.n), time, none, held))
    q, quat, qd = state[plant.place.q], state[plant.place.quat], state[plant.place.qd]
    gains = ca.vertcat(*(constants[parameter.path] for parameter in parts.law.parameters))
    asked, *shown = outputs_of(parts.law.function(q, qd, position, quat, twist, *wanted, gains))
    torque = plant.limit(asked)
    moment = none
    if parts.spec.attitude is not None:
        base = (constants["first_quat"], none) if parts.spec.attitude.hold == "start" else (wanted[-2], wanted[-1])
        moment = attitude_moment(model, parts.spec.attitude, q, quat, twist[3:], *base)
    given = input_vector(plant, values, torque, time, moment, held)
    first = moving["number"] < 0.5
    powers, largest = ca.fabs(torque * qd), ca.fabs(torque[0])
    for i in range(1, model.n):
        largest = ca.fmax(largest, ca.fabs(torque[i]))
    power = ca.sum1(powers)
    beyond = ca.if_else(ca.sum1(ca.fabs(asked - torque)) > 0, 1 / parts.spec.substeps, 0.0)
    following = moving.filled(
        {
            "plant": state,
            "held": held,
            "number": moving["number"] + 1,
            "first": ca.if_else(first, state, moving["first"]),
            "given": ca.if_else(first, given, moving["given"]),
            "shown": ca.if_else(first, ca.vertcat(*shown), moving["shown"]) if shown else ca.SX(0, 1),
            "torque_peak": ca.fmax(moving["torque_peak"], largest),
            "power_peak": ca.fmax(moving["power_peak"], power),
            "moved": moving["moved"] + power * parts.h,
            "saturated": moving["saturated"] + beyond,
        }
    )
    return sx_function("control", [moving.symbol, its.fixed.symbol, constants.symbol], [following, given])


def end_of(parts: TorqueParts, its: TorqueVectors, totals: Accumulators, signals: ca.SX) -> ca.Function:
    """(state, constants, moving, guide, stop of the run) -> state_next, stop, signals."""
    state, moving, place = its.state, its.moving, parts.plant.place
    m = parts.guided.size
    guide, stop = ca.SX.sym("guide", 4 * m), ca.SX.sym("stop")
    sample, slope, rate, bend = ca.vertsplit(guide, m)
    following = state.filled(
        {
            "plant": moving["plant"],
            "sample": sample,
            "slope": slope,
            "rate": rate,
            "bend": bend,
            "held": moving["held"],
            "moved": state["moved"] + moving["moved"],
            "totals": totals.updated,
            "count": state["count"] + 1,
        }
    )
    qd, twist = moving["plant"][place.qd], moving["plant"][place.quat]
    sane = ca.logic_and(dot(qd, qd) < FASTEST**2, dot(twist, twist) < 2)
    code = ca.if_else(ca.logic_and(stop == 0, ca.logic_not(sane)), UNSTABLE, stop)
    given = [state.symbol, its.constants.symbol, moving.symbol, guide, stop]
    return sx_function("end", given, [following, code, signals])


