"""A run at torque level: its own step makes the motion, a torque controller follows it with a robot that has inertia.

Both advance in one compiled step. The run's part is untouched: the same numbers as without a replay.
"""

from dataclasses import replace

import casadi as ca

from fzcli.control.torque.registry import TORQUE_CONTROLLERS
from fzcli.loop.adaptive import AdaptiveStep
from fzcli.loop.calls import cut, joined, parted, sx_function
from fzcli.loop.closed_loop import ClosedLoop
from fzcli.loop.guide import Guided
from fzcli.loop.reductions import Accumulators
from fzcli.loop.replay_spec import ReplaySpec
from fzcli.loop.search_loop import SearchLoop
from fzcli.loop.torque_numbers import Row, Seen, torque_rows
from fzcli.loop.torque_parts import Motion, TorqueParts, TorqueVectors
from fzcli.loop.torque_plant import torque_plant
from fzcli.loop.torque_start import initial_of
from fzcli.loop.torque_step import begin, control_of, end_of, integration, turn_of
from fzcli.model.free_motion import ATTITUDE
from fzcli.model.integrators import dormand_prince
from fzcli.spec.quantity import Metric, Signal

INNER_STEPS = 200  # of the adaptive integrator in one torque step


def with_replay(loop: ClosedLoop, run: Motion, spec: ReplaySpec, record: bool) -> ClosedLoop:
    """The closed loop with its motion followed at torque level; ``loop`` is that of the run, not recording."""
    law = TORQUE_CONTROLLERS[spec.controller.kind].build(run.model, spec.controller)
    parts = TorqueParts(run, spec, law, torque_plant(run.model, spec, run.tip), Guided(run.model.n))
    rows = _rows(parts, TorqueVectors.of(parts, 0))
    metrics = [metric for row in rows for metric in row.described()]
    its = TorqueVectors.of(parts, len(metrics))
    rows = _rows(parts, its)
    totals = _totals(its, rows, metrics)
    certified = tuple(metric.name for row in rows for metric in row.described() if row.certified)
    signals = {row.signal: row.value for row in rows} | _law_signals(parts, its)
    parameters = (*loop.parameters, *law.parameters, *parts.plant.parameters)
    adaptive = _adaptive(parts)
    shown = ca.vertcat(*signals.values()) if record else ca.SX(0, 1)
    step = _step(parts, its, loop, totals, shown, adaptive)
    balance = Metric("energy_balance_max", "", "max", "1", "largest energy error over the largest kinetic energy")
    return replace(
        loop,
        initial=initial_of(parts, its, loop, totals),
        step=step,
        finish=_finish(its, loop, totals, metrics),
        duration=cut(loop.duration, sum(p.size for p in parameters)),
        parameters=parameters,
        signals=tuple(signals) if record else (),
        metrics=(*metrics, balance, *(_of_the_motion(metric) for metric in loop.metrics)),
        certificate_names=(*certified, balance.name),
        search=_lifted(loop.search, step),
        path_piece=None,
        adaptive=adaptive,
    )


def _of_the_motion(metric: Metric) -> Metric:
    """A metric of the run whose motion is followed."""
    return replace(metric, name=f"kinematic_{metric.name}", long_name=f"of the motion followed: {metric.long_name}")


def _rows(parts: TorqueParts, its: TorqueVectors) -> list[Row]:
    """Signals and metrics at a sample."""
    moving, state, constants = its.moving, its.state, its.constants
    time = state["count"] * parts.run.dt
    reference, wanted = parts.run.reference, state["sample"][parts.guided.tip]
    if reference is not None:
        wanted = reference.evaluate(time, constants["reference"])[0] + constants["com"]
    seen = Seen(
        state=moving["first"],
        given=moving["given"],
        torque=moving["given"][: parts.plant.model.n],
        sample=state["sample"],
        wanted=wanted,
        torque_peak=moving["torque_peak"],
        power_peak=moving["power_peak"],
        saturated=moving["saturated"],
        moved=state["moved"],
        energy0=constants["energy0"],
    )
    return torque_rows(parts.plant, parts.guided, seen, bool(reference and reference.aim))


def _law_signals(parts: TorqueParts, its: TorqueVectors) -> dict[Signal, ca.SX]:
    found, place = {}, 0
    for signal in parts.law.signals:
        found[signal] = its.moving["shown"][place : place + signal.size]
        place += signal.size
    return found


def _totals(its: TorqueVectors, rows: list[Row], metrics: list[Metric]) -> Accumulators:
    """Running totals of the metrics, in their place of the state."""
    found = Accumulators.of(tuple(metrics), {row.signal.name: row.value for row in rows}, its.state["count"])
    pairs = ([found.symbols], [its.state["totals"]])
    updated, results = ca.substitute([found.updated, found.results], *pairs)
    return replace(found, symbols=its.state["totals"], updated=updated, results=results)


def _adaptive(parts: TorqueParts) -> AdaptiveStep | None:
    """The adaptive integrator, where the replay asks for it."""
    if parts.spec.integrator != "dormand_prince":
        return None
    tolerance = parts.spec.tolerance
    return AdaptiveStep(dormand_prince(parts.plant.rate, ATTITUDE, tolerance, tolerance, INNER_STEPS), parts.h)


def _step(
    parts: TorqueParts,
    its: TorqueVectors,
    loop: ClosedLoop,
    totals: Accumulators,
    signals: ca.SX,
    adaptive: AdaptiveStep | None,
) -> ca.Function:
    """The step as calls: the run's own, the segment of motion that it made, the torque steps, and the rest."""
    own, more = (loop.step.size1_in("state"), its.state.size), (loop.step.size1_in("constants"), its.constants.size)
    state, constants = ca.MX.sym("state", sum(own)), ca.MX.sym("constants", sum(more))
    history = ca.MX.sym("history", loop.step.size1_in("history"))
    of_run, of_torque = parted("state", own)(state)
    run_constants, torque_constants = parted("constants", more)(constants)
    following, samples, stop, _ = loop.step(of_run, run_constants, history)
    moving, fixed, guide = begin(parts, its, own[0])(following, of_torque, torque_constants)
    control, integrate = control_of(parts, its), integration(parts, its, adaptive)
    turn = turn_of(its, control, integrate)
    for _ in range(parts.spec.substeps):
        moving = turn(moving, fixed, torque_constants)
    ended = end_of(parts, its, totals, signals)
    torque_following, stop, shown = ended(of_torque, torque_constants, moving, guide, stop)
    names = ["state", "constants", "history"]
    outputs = {
        "state_next": joined("state", own)(following, torque_following),
        "samples": samples,
        "stop": stop,
        "signals": shown,
    }
    return ca.Function("closed_loop_step", [state, constants, history], list(outputs.values()), names, list(outputs))


def _finish(its: TorqueVectors, loop: ClosedLoop, totals: Accumulators, metrics: list[Metric]) -> ca.Function:
    """(state, constants) -> metrics of the torque level, then those of the run."""
    names = [metric.name for metric in metrics]
    worst, most = (totals.results[names.index(name)] for name in ("energy_error_max", "kinetic_energy_max"))
    own = ca.vertcat(totals.results, worst / ca.fmax(most, 1e-300))
    of_torque = sx_function("torque_metrics", [its.state.symbol, its.constants.symbol], [own])
    sizes = (loop.step.size1_in("state"), its.state.size), (loop.step.size1_in("constants"), its.constants.size)
    state, constants = ca.MX.sym("state", sum(sizes[0])), ca.MX.sym("constants", sum(sizes[1]))
    (run_state, torque_state), (run_constants, torque_constants) = (
        parted("state", sizes[0])(state),
        parted("constants", sizes[1])(constants),
    )
    found = [of_torque(torque_state, torque_constants), loop.finish(run_state, run_constants)]
    outputs = [joined("metrics", (found[0].shape[0], found[1].shape[0]))(*found)]
    return ca.Function("finish", [state, constants], outputs, ["state", "constants"], ["metrics"])


def _lifted(search: SearchLoop | None, step: ca.Function) -> SearchLoop | None:
    """The law's search with the torque level behind the run's state and constants."""
    if search is None:
        return None
    sizes = search.request.size1_in(0), search.request.size1_in(1)
    state, constants = ca.SX.sym("state", step.size1_in("state")), ca.SX.sym("constants", step.size1_in("constants"))
    posture, found = ca.SX.sym("posture", search.accept.size1_in(1)), ca.SX.sym("found")
    request = search.request(state[: sizes[0]], constants[: sizes[1]])
    accepted = ca.vertcat(search.accept(state[: sizes[0]], posture, found), state[sizes[0] :])
    return replace(
        search,
        request=ca.Function("request", [state, constants], list(request)),
        accept=ca.Function("accept", [state, posture, found], [accepted]),
    )


