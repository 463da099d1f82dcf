"""Where the torque level of a run starts."""

from dataclasses import dataclass

import casadi as ca

from fzcli.loop.calls import joined, parted, sx_function
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.guide import guide_sample, starting_rates
from fzcli.loop.reductions import Accumulators
from fzcli.loop.torque_parts import TorqueParts, TorqueVectors
from fzcli.loop.torque_plant import input_vector
from fzcli.model.algebra import rotate, symmetric_inverse
from fzcli.model.attitude import multiply, quaternion_from_matrix, rotation_matrix
from fzcli.model.motion_report import com_offset


def initial_of(parts: TorqueParts, its: TorqueVectors, loop: ClosedLoop, totals: Accumulators) -> ca.Function:
    """parameters -> state, constants, of the run and of the torque level."""
    paths = (*loop.parameters, *parts.law.parameters, *parts.plant.parameters)
    values = {parameter.path: ca.SX.sym(parameter.path.replace(".", "_"), parameter.size) for parameter in paths}
    start = _start(parts, values)
    known = {path: value for path, value in values.items() if path in its.constants.parts}
    constants = its.constants.filled(start.constants | known)
    state = its.state.filled(start.state | {"totals": totals.first})
    given = ca.vertcat(*values.values())
    of_torque = sx_function("start", [given], [state, constants])
    run_size = sum(parameter.size for parameter in loop.parameters)
    parameters = ca.MX.sym("parameters", given.shape[0])
    own = parted("parameters", (run_size, given.shape[0] - run_size))(parameters)[0]
    run_state, run_constants = loop.initial(own)
    torque_state, torque_constants = of_torque(parameters)
    sizes = (run_state.shape[0], torque_state.shape[0]), (run_constants.shape[0], torque_constants.shape[0])
    outputs = [
        joined("state", sizes[0])(run_state, torque_state),
        joined("constants", sizes[1])(run_constants, torque_constants),
    ]
    return ca.Function("initial", [parameters], outputs, ["parameters"], ["state", "constants"])


@dataclass(frozen=True)
class _Started:
    state: dict[str, ca.SX]
    constants: dict[str, ca.SX]


def _start(parts: TorqueParts, values: dict[str, ca.SX]) -> _Started:
    """The robot stands where the run's does, its arm at rest, with the run's momentum."""
    model, plant, none = parts.run.model, parts.plant, ca.SX.zeros(3)
    q, origin = values["start.q"], values["start.base_position"]
    quat = values["start.base_quat"] / ca.norm_2(values["start.base_quat"])
    R, (position, rotation, _) = rotation_matrix(quat), model.function("tip", parts.run.tip)(q)
    linear, angular = (
        (values["start.momentum.linear"], values["start.momentum.angular"]) if parts.run.drifting else (none, none)
    )
    com, rate = origin, none
    if model.floating:
        inertia = model.function("body")(q)[1]
        com = origin + rotate(R, model.function("body")(q)[0])
        rate = rotate(R, rotate(symmetric_inverse(inertia), rotate(R.T, angular)))
    reference = ca.SX(0, 1)
    if parts.run.reference is not None:
        known = ca.vertcat(*(values[p.path] for p in parts.run.reference.parameters))
        tip_quat = multiply(quat, quaternion_from_matrix(rotation))
        reference = parts.run.reference.prepare(known, q, quat, rotate(R, position), tip_quat, com)
    sample = guide_sample(model, parts.run.tip, q, quat, com)
    velocity = linear / model.mass
    slope = starting_rates(parts.guided, model, sample, com, velocity, rate)
    given = input_vector(plant, values, ca.SX.zeros(model.n), ca.SX(0), none, ca.SX(0))
    offset = com_offset(plant.model, plant.inputs, plant.tip)
    state = ca.SX.zeros(plant.place.size)
    state[plant.place.place] = origin + offset(q, quat, given)
    state[plant.place.quat], state[plant.place.q] = quat, q
    if model.floating:
        state[plant.place.velocity] = ca.vertcat(linear, angular)
    zero = ca.SX(0)
    return _Started(
        {"plant": state, "sample": sample, "slope": slope, "rate": slope, "bend": ca.SX.zeros(sample.shape[0])}
        | {"held": zero, "moved": zero, "count": zero},
        {"com": com, "com_velocity": velocity if model.floating else none, "reference": reference}
        | {"first_quat": quat, "energy0": plant.report(state, given)[2]},
    )


