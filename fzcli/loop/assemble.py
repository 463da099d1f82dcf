"""From a run spec to a closed loop, its engine, and the row of numbers it takes."""

from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.control.registry import controllers
from fzcli.errors import Problem, SpecError
from fzcli.loop.closed_loop import ClosedLoop, build_closed_loop
from fzcli.loop.parts import Parts
from fzcli.loop.plant import kinematic_plant
from fzcli.loop.run_spec import SimulateRun
from fzcli.loop.torque_loop import with_replay
from fzcli.model import RobotModel, build_model
from fzcli.plan.registry import BASE_REFERENCES, TIP_REFERENCES
from fzcli.spec.condition import Condition
from fzcli.spec.quantity import Parameter

Array = NDArray[np.float64]


def closed_loop(
    spec: SimulateRun, record: bool, model: RobotModel | None = None, wanted: tuple[Condition, ...] = ()
) -> ClosedLoop:
    """Build the closed loop of a run; with ``record`` its step gives every signal.

    ``model`` saves building the robot's model again. ``wanted``: conditions without which the run is of no use, so that
    it is given up (`GIVEN_UP`) at the first sample after which its metrics cannot meet them; not of a replay's metrics.
    """
    model = model or build_model(spec.robot)
    tip, controller = getattr(spec.controller, "tip", None), _settled(spec)
    parts = Parts(
        model=model,
        law=controllers()[spec.controller.kind].build(model, controller),
        plant=kinematic_plant(model, spec.plant == "translation_only", spec.method == "gauss_magnus"),
        reference=TIP_REFERENCES[spec.reference.kind].build(spec.reference, model, tip),
        base_reference=BASE_REFERENCES[spec.base_reference.kind].build(spec.base_reference),
        tip=tip,
        dt=spec.step,
        method=spec.method,
        drifting=spec.start.drifting,
        stop=spec.stop,
        wanted=wanted if spec.replay is None else (),
    )
    if spec.replay is None:
        return build_closed_loop(parts, record)
    return with_replay(build_closed_loop(parts, record=False), parts, spec.replay, record)


def _settled(spec: SimulateRun) -> Any:
    """The controller with its search as strict as the run's stop condition asks, where it does not say."""
    restart = getattr(spec.controller, "restart", None)
    if restart is None or spec.stop is None:
        return spec.controller
    stated = {"distance": spec.stop.position * 0.5, "angle": spec.stop.direction and spec.stop.direction * 0.85}
    missing = {name: value for name, value in stated.items() if getattr(restart, name) is None}
    return spec.controller.model_copy(update={"restart": restart.model_copy(update=missing)})


def parameter_row(spec: SimulateRun, parameters: tuple[Parameter, ...]) -> Array:
    """The spec's values of a loop's run-time parameters, one after the other."""
    return np.concatenate([parameter_values(spec, parameter) for parameter in parameters])


def parameter_values(spec: SimulateRun, parameter: Parameter) -> Array:
    """One parameter's numbers (size); a single number stands for all components."""
    value: Any = spec.start.attitude if parameter.path == "start.base_quat" else spec.value_at(parameter.path)
    flat = np.asarray(value, dtype=float).ravel()
    return np.full(parameter.size, flat[0]) if flat.size == 1 else flat


def step_counts(loop: ClosedLoop, spec: SimulateRun, parameters: Array) -> NDArray[np.int64]:
    """Steps of every run (rows of ``parameters``): ``duration`` or ``stop.after``, else the reference's, over the step.

    Raises SpecError when neither ends.
    """
    given = spec.duration if spec.stop is None else spec.stop.after
    seconds = _seconds(loop.duration, parameters) if given is None else np.full(len(parameters), given)
    if not np.isfinite(seconds).all():
        kind = spec.reference.kind
        raise SpecError(Problem(f"is missing: the reference {kind!r} has no end of its own", field="duration"))
    steps = np.ceil(seconds / spec.step - 1e-9)
    if steps.max(initial=0) > MOST_STEPS:
        raise SpecError(
            Problem(f"{steps.max():.3g} steps in one run; at most {MOST_STEPS:.0e} are run", field="duration")
        )
    return steps.astype(np.int64)


def _seconds(duration: ca.Function, parameters: Array) -> Array:
    """What ``duration`` gives for every row: most often one of its numbers as it stands, which takes no call."""
    if duration.n_instructions() == 2 and duration.instruction_id(0) == ca.OP_INPUT:
        return np.asarray(parameters[:, duration.instruction_input(0)[1]])
    return np.array(duration.map(len(parameters))(parameters.T)).ravel()


MOST_STEPS = 10**8
