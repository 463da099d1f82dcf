"""Reference + law + plant + memory composed into one step, with the metrics reduced inside it."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from fzcli.loop.certificate import Certifier
from fzcli.loop.parts import Parts
from fzcli.loop.reductions import Accumulators
from fzcli.loop.stops import stop_code
from fzcli.model.algebra import rotate
from fzcli.model.attitude import multiply, quaternion_from_matrix, rotation_matrix, starting_angles
from fzcli.spec.quantity import Metric, Parameter, Signal

XYZ, WXYZ = ("x", "y", "z"), ("w", "x", "y", "z")


@dataclass(frozen=True)
class ClosedLoop:
    """One closed loop as three Functions, for any engine to run.

    ``initial``: parameters -> state, constants. ``step``: (state, constants, history) -> state_next,
    samples, stop, signals. ``finish``: (state, constants) -> metrics. ``history`` is the sum of the
    last ``history_length`` samples, zeros before the first. A run of N steps evaluates ``step`` at
    samples 0..N; ``stop`` other than 0 ends it at that sample. ``signals`` is empty in a loop built
    for metrics only.
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
    """The loop's expressions at one sample."""

    command: ca.SX
    memory: ca.SX
    samples: ca.SX
    signals: dict[str, ca.SX]


Evaluator = Callable[[ca.SX, float], _Sample]


def build_closed_loop(parts: Parts, record: bool) -> ClosedLoop:
    """Compose the parts; with ``record`` the step also gives every signal of the run."""
    layout = _Layout.of(parts)
    start, constants, cut = _initial_expressions(parts, layout)
    symbols = {name: ca.SX.sym(name, value.shape[0]) for name, value in cut.items()}
    memory = ca.SX.sym("memory", parts.law.memory0.size1_out(0))
    history = ca.SX.sym("history", parts.law.function.size1_in("history"))
    plant_state = ca.SX.sym("plant_state", parts.plant.state_size)
    previous, count = ca.SX.sym("previous", parts.plant.derivative_size), ca.SX.sym("count")
    at = _evaluator(parts, symbols, memory, history, count)
    sample = at(plant_state, 0.0)
    L = symbols["angular_momentum"] if parts.drifting else ca.SX.zeros(3)
    derivative = parts.plant.rate(plant_state, sample.command, L)
    moving = _held_over_the_step(parts, plant_state, derivative, at, L)
    certifier = Certifier.of(parts, plant_state, derivative, moving, previous, L, sample.signals)
    totals = Accumulators.of(parts.law.metrics, sample.signals, count)
    state = ca.vertcat(plant_state, memory, previous, certifier.memory, totals.symbols, count)
    following = ca.vertcat(
        parts.plant.advance(plant_state, moving, parts.dt),
        sample.memory,
        certifier.previous_next,
        certifier.memory_next,
        totals.updated,
        count + 1,
    )
    signals = _record_signals(parts, plant_state, derivative, symbols, count, sample) if record else {}
    stop = stop_code(parts, plant_state, moving)
    held = {"state": state, "constants": ca.vertcat(*symbols.values())}
    given = {"parameters": layout.vector}
    first = ca.vertcat(start, certifier.memory0, totals.first, 0)
    seconds = parts.reference.duration(layout.of_part(parts.reference.parameters))
    outputs = {"state_next": following, "samples": sample.samples, "stop": stop}
    return ClosedLoop(
        initial=_function("initial", given, {"state": first, "constants": constants}),
        step=_function(
            "closed_loop_step",
            {**held, "history": history},
            {**outputs, "signals": ca.vertcat(*signals.values())},
        ),
        finish=_function("finish", held, {"metrics": ca.vertcat(totals.results, certifier.results)}),
        duration=_function("duration", given, {"duration": seconds}),
        parameters=layout.parameters,
        signals=tuple(signals),
        metrics=(*parts.law.metrics, *certifier.metrics),
        certificate_names=tuple(metric.name for metric in certifier.metrics),
        history_length=parts.law.history_length,
        dt=parts.dt,
        joint_units=tuple("m" if body.prismatic else "rad" for body in parts.model.tree.bodies),
    )


def _held_over_the_step(
    parts: Parts, plant_state: ca.SX, derivative: ca.SX, at: Evaluator, L: ca.SX
) -> ca.SX:
    """The derivative that carries the step: at its begin (euler), or at its middle (midpoint)."""
    if parts.method == "euler":
        return derivative
    middle = parts.plant.advance(plant_state, derivative, 0.5 * parts.dt)
    return parts.plant.rate(middle, at(middle, 0.5 * parts.dt).command, L)


def _function(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
    shared = ca.cse([ca.densify(value) for value in outputs.values()])
    return ca.Function(name, list(inputs.values()), shared, list(inputs), list(outputs))


def _initial_expressions(parts: Parts, layout: _Layout) -> tuple[ca.SX, ca.SX, dict[str, ca.SX]]:
    """First plant state, law memory and previous derivative; the constants as one vector and by name."""
    model, values = parts.model, layout.values
    q, origin = values["start.q"], values["start.base_position"]
    given = values["start.base_quat"]
    quat = given / ca.norm_2(given)
    R = rotation_matrix(quat)
    position, rotation, _ = model.function("tip", parts.tip)(q)
    com = origin + rotate(R, model.function("body")(q)[0]) if model.floating else origin
    start = (rotate(R, position), multiply(quat, quaternion_from_matrix(rotation)), com)
    law_values = layout.of_part(parts.law.parameters)
    zero = ca.SX.zeros(3) if parts.drifting else ca.SX(0, 1)
    cut = {
        "reference": parts.reference.prepare(layout.of_part(parts.reference.parameters), *start),
        "base_reference": parts.base_reference.prepare(
            layout.of_part(parts.base_reference.parameters), starting_angles(R)
        ),
        "law": law_values,
        "com": com,
        "com_velocity": values["start.momentum.linear"] / model.mass if parts.drifting else zero,
        "angular_momentum": values["start.momentum.angular"] if parts.drifting else zero,
    }
    resting = parts.plant.rate(
        ca.vertcat(q, quat), ca.SX.zeros(model.n), cut["angular_momentum"] if parts.drifting else ca.SX.zeros(3)
    )
    state = ca.vertcat(q, quat, parts.law.memory0(law_values), resting)
    return state, ca.vertcat(*cut.values()), cut


def _evaluator(
    parts: Parts, symbols: dict[str, ca.SX], memory: ca.SX, history: ca.SX, count: ca.SX
) -> Evaluator:
    """A function (plant state, time after the sample) -> the law's expressions there."""
    names = [*(f"{name}_next" if name == "memory" else name for name in ("command", "memory", "samples"))]
    names += [signal.name for signal in parts.law.signals]

    def at(plant_state: ca.SX, later: float) -> _Sample:
        q, quat = parts.plant.observe(plant_state)
        time = count * parts.dt + later
        position, velocity, tip_quat, tip_rate = parts.reference.evaluate(time, symbols["reference"])
        angles, rates = parts.base_reference.evaluate(time, symbols["base_reference"])
        if parts.drifting:
            position = position - symbols["com_velocity"] * time
            velocity = velocity - symbols["com_velocity"]
        results = parts.law.function(
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
            memory,
            history,
            symbols["law"],
        )
        found = dict(zip(names, results, strict=True))
        return _Sample(found.pop("command"), found.pop("memory_next"), found.pop("samples"), found)

    return at


def _record_signals(
    parts: Parts,
    plant_state: ca.SX,
    derivative: ca.SX,
    symbols: dict[str, ca.SX],
    count: ca.SX,
    sample: _Sample,
) -> dict[Signal, ca.SX]:
    """Everything a rollout shows: joints, base, tip, then the law's own signals."""
    model = parts.model
    q, quat = parts.plant.observe(plant_state)
    R = rotation_matrix(quat)
    qd, velocity, rate = parts.plant.motion(plant_state, derivative)
    centre = symbols["com"]
    if parts.drifting:
        centre = centre + symbols["com_velocity"] * (count * parts.dt)
        velocity = velocity + symbols["com_velocity"]
    position, rotation, _ = model.function("tip", parts.tip)(q)
    origin = centre - rotate(R, model.function("body")(q)[0]) if model.floating else centre
    named = {
        Signal("q", "rad or m", "joint positions", model.joint_names): q,
        Signal("qd", "rad/s or m/s", "joint speeds", model.joint_names): qd,
        Signal("base_position", "m", "origin of the base link's frame, world", XYZ): origin,
        Signal("base_quat", "1", "base attitude, body to world", WXYZ): quat,
        Signal("base_twist", "m/s, rad/s", "base twist, world axes", ("vx", "vy", "vz", "wx", "wy", "wz")): (
            ca.vertcat(velocity, rate)
        ),
        Signal("tip_position", "m", "tip position, world", XYZ): centre + rotate(R, position),
        Signal("tip_quat", "1", "tip attitude, tip to world", WXYZ): multiply(
            quat, quaternion_from_matrix(rotation)
        ),
    }
    named.update({signal: sample.signals[signal.name] for signal in parts.law.signals})
    return named
