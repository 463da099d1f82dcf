"""Reference + law + plant + memory composed into one step, with the metrics reduced inside it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from fzcli.control.law import Law, LawInputs
from fzcli.errors import UsageError
from fzcli.loop.adaptive import AdaptiveStep
from fzcli.loop.arrival import Arrival, Motion, Target, arrival
from fzcli.loop.certificate import Certifier
from fzcli.loop.parts import Parts
from fzcli.loop.reductions import Accumulators
from fzcli.loop.search_loop import SearchLoop, search_loop
from fzcli.loop.signals import state_signals
from fzcli.loop.stops import given_up, stop_code
from fzcli.model.algebra import rotate
from fzcli.model.attitude import multiply, quaternion_from_matrix, rotation_matrix, starting_angles
from fzcli.model.gauss_magnus import path_piece
from fzcli.spec.quantity import Metric, Parameter, Signal


@dataclass(frozen=True)
class ClosedLoop:
    """One closed loop as three Functions, for any engine to run.

    ``initial``: parameters -> state, constants. ``step``: (state, constants, history) -> state_next,
    samples, stop, signals. ``finish``: (state, constants) -> metrics. ``history`` is the sum of the
    last ``history_length`` samples, zeros before the first. A run of N steps evaluates ``step`` at
    samples 0..N; ``stop`` other than 0 ends it at that sample, but -1 pauses it before the step, until the
    ``search`` has put its result into the state. ``signals`` is empty in a loop built for metrics only. ``path_piece``:
    see `fzcli.model.gauss_magnus.path_piece`; only of a recorded loop that floats with zero momentum.
    ``adaptive``: the host's integrator inside the step, which the virtual machine alone can call.
    """

    initial: ca.Function
    step: ca.Function
    finish: ca.Function
    duration: ca.Function
    parameters: tuple[Parameter, ...]
    signals: tuple[Signal, ...]
    metrics: tuple[Metric, ...]
    certificate_names: tuple[str, ...]
    history_length: int
    dt: float
    joint_units: tuple[str, ...]
    search: SearchLoop | None = None
    path_piece: ca.Function | None = None
    adaptive: AdaptiveStep | None = None


@dataclass(frozen=True)
class _Layout:
    """Symbols of the loop's parameters and constants, by part."""

    parameters: tuple[Parameter, ...]
    values: dict[str, ca.SX]

    @staticmethod
    def of(parts: Parts) -> "_Layout":
        start = [
            Parameter("start.q", parts.model.n),
            Parameter("start.base_quat", 4),
            Parameter("start.base_position", 3),
        ]
        if parts.drifting:
            start += [Parameter("start.momentum.linear", 3), Parameter("start.momentum.angular", 3)]
        every = [*start, *parts.reference.parameters, *parts.base_reference.parameters, *parts.law.parameters]
        return _Layout(tuple(every), {p.path: ca.SX.sym(p.path.replace(".", "_"), p.size) for p in every})

    def of_part(self, parameters: tuple[Parameter, ...]) -> ca.SX:
        return ca.vertcat(*(self.values[p.path] for p in parameters)) if parameters else ca.SX(0, 1)

    @property
    def vector(self) -> ca.SX:
        return ca.vertcat(*self.values.values())


@dataclass(frozen=True)
class _Sample:
    """The loop's expressions at one sample; ``arguments``: the law's inputs there."""

    command: ca.SX
    memory: ca.SX
    samples: ca.SX
    asks: ca.SX
    signals: dict[str, ca.SX]
    arguments: list[ca.SX]


Evaluator = Callable[[ca.SX, float], _Sample]


def build_closed_loop(parts: Parts, record: bool) -> ClosedLoop:
    """Compose the parts; with ``record`` the step also gives every signal of the run."""
    law = parts.law
    if law.search is not None and law.history_length:
        raise UsageError("a law that searches keeps its past in its memory, not in a history")
    layout = _Layout.of(parts)
    start, constants, cut = _initial_expressions(parts, layout)
    symbols = {name: ca.SX.sym(name, value.shape[0]) for name, value in cut.items()}
    memory = ca.SX.sym("memory", law.memory0.size1_out(0))
    history = ca.SX.sym("history", law.function.size1_in("history"))
    turned = ca.SX.sym("turned", law.function.size1_in("turned"))
    plant_state = ca.SX.sym("plant_state", parts.plant.state_size)
    previous, count = ca.SX.sym("previous", parts.plant.derivative_size), ca.SX.sym("count")
    at = _evaluator(parts, symbols, memory, history, count, turned)
    sample = at(plant_state, 0.0)
    L = symbols["angular_momentum"] if parts.drifting else ca.SX.zeros(3)
    derivative = parts.plant.rate(plant_state, sample.command, L)
    moving = _held_over_the_step(parts, plant_state, derivative, sample.command, at, L)
    certifier = Certifier.of(parts, plant_state, derivative, moving, previous, L, sample.signals)
    goal = _arrival(parts, symbols, plant_state, previous, sample, count)
    metrics = (*goal.metrics, *law.metrics)
    totals = Accumulators.of(metrics, {**sample.signals, **goal.reduced}, count)
    state = ca.vertcat(plant_state, memory, previous, certifier.memory, totals.symbols, count)
    following = ca.vertcat(
        parts.plant.advance(plant_state, moving, parts.dt),
        sample.memory,
        certifier.previous_next,
        certifier.memory_next,
        totals.updated,
        count + 1,
    )
    signals: dict[Signal, ca.SX] = {}
    if record:
        signals = state_signals(parts, plant_state, derivative, *_com(parts, symbols, count))
        signals |= goal.signals | {signal: sample.signals[signal.name] for signal in law.signals}
    stop = stop_code(parts, plant_state, moving, goal.arrived, sample.asks)
    stop = given_up(stop, parts.wanted, metrics, totals.updated)
    held = {"state": state, "constants": ca.vertcat(*symbols.values())}
    given = {"parameters": layout.vector}
    first = ca.vertcat(start, certifier.memory0, totals.first, 0)
    seconds = parts.reference.duration(layout.of_part(parts.reference.parameters))
    inputs = {**held, "history": history, **({"turned": turned} if law.inner else {})}
    outputs = {"state_next": following, "samples": sample.samples, "stop": stop}
    step = _function("closed_loop_step", inputs, {**outputs, "signals": ca.vertcat(*signals.values())})
    if law.inner is not None:
        step = _with_inner_loop(step, _function("before", held, list(law.inner.before(*sample.arguments))), law)
    return ClosedLoop(
        initial=_function("initial", given, {"state": first, "constants": constants}),
        step=step,
        finish=_function("finish", held, {"metrics": ca.vertcat(totals.results, certifier.results)}),
        duration=_function("duration", given, {"duration": seconds}),
        parameters=layout.parameters,
        signals=tuple(signals),
        metrics=(*metrics, *certifier.metrics),
        certificate_names=tuple(metric.name for metric in certifier.metrics),
        history_length=law.history_length,
        dt=parts.dt,
        joint_units=tuple("m" if body.prismatic else "rad" for body in parts.model.tree.bodies),
        search=search_loop(law.search, held, sample.arguments, memory) if law.search else None,
        path_piece=path_piece(parts.model) if record and parts.model.floating and not parts.drifting else None,
    )


def _with_inner_loop(step: ca.Function, before: ca.Function, law: Law) -> ca.Function:
    """The step as calls: what comes before the law's inner loop, the loop, and the rest."""
    if law.inner is None:
        return step
    names = ["state", "constants", "history"]
    given = [ca.MX.sym(name, step.size1_in(name)) for name in names]
    moving, fixed = before(*given[:2])
    for _ in range(law.inner.count):
        moving = law.inner.turn(moving, fixed)
    outputs: list[ca.MX] = list(step(*given, moving))
    return ca.Function(step.name(), given, outputs, names, step.name_out())


def _arrival(
    parts: Parts,
    symbols: dict[str, ca.SX],
    plant_state: ca.SX,
    previous: ca.SX,
    sample: _Sample,
    count: ca.SX,
) -> Arrival:
    """What is left to the target, where the reference is one; nothing elsewhere."""
    if not parts.reference.aim:
        return Arrival(ca.SX(0), {}, {}, ())
    named = dict(zip(LawInputs.__dataclass_fields__, sample.arguments, strict=True))
    target = Target(
        named["tip_position"], named["tip_velocity"], named["tip_quat"], _com(parts, symbols, count)[0]
    )
    q, quat = parts.plant.observe(plant_state)
    truth = parts.plant.truth(plant_state) if parts.plant.truth else None
    motion = Motion(parts.plant.motion(plant_state, previous)[0], symbols["first_quat"])
    time = count * parts.dt
    return arrival(parts.model, parts.tip, parts.reference.aim, parts.stop, target, (q, quat), truth, time, motion)


def _com(parts: Parts, symbols: dict[str, ca.SX], count: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Where the CoM is at a sample (on a fixed base: the base frame's origin), and its velocity; world, (3)."""
    if not parts.drifting:
        return symbols["com"], ca.SX.zeros(3)
    return symbols["com"] + symbols["com_velocity"] * (count * parts.dt), symbols["com_velocity"]


def _held_over_the_step(
    parts: Parts, plant_state: ca.SX, derivative: ca.SX, command: ca.SX, at: Evaluator, L: ca.SX
) -> ca.SX:
    """The derivative that carries the step: at its begin (euler), at its middle (midpoint), or at two nodes."""
    if parts.method == "euler":
        return derivative
    if parts.plant.magnus is not None:
        return parts.plant.magnus(plant_state, command, L, parts.dt)
    middle = parts.plant.advance(plant_state, derivative, 0.5 * parts.dt)
    return parts.plant.rate(middle, command if parts.law.held else at(middle, 0.5 * parts.dt).command, L)


def _function(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX] | Sequence[ca.SX]) -> ca.Function:
    values = outputs.values() if isinstance(outputs, dict) else outputs
    shared = ca.cse([ca.densify(value) for value in values])
    names = list(outputs) if isinstance(outputs, dict) else [f"out{i}" for i in range(len(shared))]
    return ca.Function(name, list(inputs.values()), shared, list(inputs), names)


def _initial_expressions(parts: Parts, layout: _Layout) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
    """First plant state, law memory and previous derivative; the constants as one vector and by name."""
    model, values = parts.model, layout.values
    q, origin = values["start.q"], values["start.base_position"]
    given = values["start.base_quat"]
    quat = given / ca.norm_2(given)
    R = rotation_matrix(quat)
    position, rotation, _ = model.function("tip", parts.tip)(q)
    com = origin + rotate(R, model.function("body")(q)[0]) if model.floating else origin
    start = (q, quat, rotate(R, position), multiply(quat, quaternion_from_matrix(rotation)), com)
    law_values = layout.of_part(parts.law.parameters)
    zero = ca.SX.zeros(3) if parts.drifting else ca.SX(0, 1)
    cut = {
        "reference": parts.reference.prepare(layout.of_part(parts.reference.parameters), *start),
        "base_reference": parts.base_reference.prepare(
            layout.of_part(parts.base_reference.parameters), starting_angles(R)
        ),
        "law": law_values,
        "first_quat": quat if parts.reference.aim else ca.SX(0, 1),
        "com": com,
        "com_velocity": values["start.momentum.linear"] / model.mass if parts.drifting else zero,
        "angular_momentum": values["start.momentum.angular"] if parts.drifting else zero,
    }
    plant_state = ca.vertcat(q, quat, *([quat] if parts.plant.truth else []))
    resting = parts.plant.rate(
        plant_state, ca.SX.zeros(model.n), cut["angular_momentum"] if parts.drifting else ca.SX.zeros(3)
    )
    state = ca.vertcat(plant_state, parts.law.memory0(law_values), resting)
    return state, ca.vertcat(*cut.values()), cut


def _evaluator(
    parts: Parts, symbols: dict[str, ca.SX], memory: ca.SX, history: ca.SX, count: ca.SX, turned: ca.SX
) -> Evaluator:
    """A function (plant state, time after the sample) -> the law's expressions there."""
    names = [*(f"{name}_next" if name == "memory" else name for name in ("command", "memory", "samples"))]
    names += ["asks"] if parts.law.search else []
    names += [signal.name for signal in parts.law.signals]

    def at(plant_state: ca.SX, later: float) -> _Sample:
        q, quat = parts.plant.observe(plant_state)
        time = count * parts.dt + later
        position, velocity, tip_quat, tip_rate = parts.reference.evaluate(time, symbols["reference"])
        angles, rates = parts.base_reference.evaluate(time, symbols["base_reference"])
        if parts.drifting:
            position = position - symbols["com_velocity"] * time
            velocity = velocity - symbols["com_velocity"]
        arguments = [
            q,
            quat,
            symbols["angular_momentum"] if parts.drifting else ca.SX.zeros(3),
            position,
            velocity,
            tip_quat,
            tip_rate,
            angles,
            rates,
            count,
            ca.SX(parts.dt),
        ]
        results = parts.law.function(*arguments, memory, history, symbols["law"], turned)
        found = dict(zip(names, results, strict=True))
        asks = found.pop("asks", ca.SX(0))
        return _Sample(
            found.pop("command"), found.pop("memory_next"), found.pop("samples"), asks, found, arguments
        )

    return at
