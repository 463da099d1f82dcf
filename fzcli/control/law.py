"""The one contract of all control laws: what a law is given, and what it gives back."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from fzcli.spec.base import SpecModel
from fzcli.spec.quantity import Metric, Parameter, Signal
from fzcli.spec.robot import Robot


@dataclass(frozen=True)
class LawInputs:
    """Symbols a law may use; the loop binds them. World axes; positions relative to the system's CoM.

    q (n); base_quat (4) body to world; angular_momentum (3) [N m s] about the CoM, constant;
    tip_position, tip_velocity (3) wanted, relative to the CoM and its velocity; tip_quat (4),
    tip_rate (3) wanted; base_angles, base_rates (3) wanted roll, pitch, yaw and their rates;
    step, the number of the control step (from 0); period [s], the time between two steps.
    """

    q: ca.SX
    base_quat: ca.SX
    angular_momentum: ca.SX
    tip_position: ca.SX
    tip_velocity: ca.SX
    tip_quat: ca.SX
    tip_rate: ca.SX
    base_angles: ca.SX
    base_rates: ca.SX
    step: ca.SX
    period: ca.SX

    @staticmethod
    def symbols(n: int) -> "LawInputs":
        """Fresh symbols for a robot of n joints."""
        sizes = {"q": n, "base_quat": 4, "tip_quat": 4, "step": 1, "period": 1}
        names = LawInputs.__dataclass_fields__
        return LawInputs(**{name: ca.SX.sym(name, sizes.get(name, 3)) for name in names})

    def as_dict(self) -> dict[str, ca.SX]:
        """Name -> symbol, in the order of the fields."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


@dataclass(frozen=True)
class InnerLoop:
    """The same expressions several times within one step, so that they are compiled once.

    ``before``: the fields of `LawInputs` -> ``moving``, ``fixed``. ``turn``: (moving, fixed) -> moving,
    ``count`` times.
    """

    before: ca.Function
    turn: ca.Function
    count: int


@dataclass(frozen=True)
class Search:
    """A search from many seeds that a law may ask for between two steps; it is counted, and takes no time.

    ``request``: (the fields of `LawInputs`, memory) -> constants of the search, number of the searches before.
    ``first``: (constants, offsets) -> state, with ``offsets`` numbers drawn from U(-1, 1) for each of
    ``seeds`` seeds: SeedSequence((seed, number)). ``turn``: (state, constants) -> state, ``turns`` times.
    ``result``: (state, constants) -> posture, cost, which is `NOT_FOUND` where it will not do; the one of
    least cost, the first of equals, is taken. ``accept``: (memory, posture, found) -> the law's memory.
    """

    request: ca.Function
    first: ca.Function
    turn: ca.Function
    result: ca.Function
    accept: ca.Function
    turns: int
    seeds: int
    offsets: int
    seed: int


NOT_FOUND = 1.0e300


@dataclass(frozen=True)
class Law:
    """A control law ready to be composed into a closed loop.

    ``function``: inputs are those of `LawInputs`, then ``memory``, ``history``, ``parameters`` and ``turned``,
    what the ``inner`` loop ends with (empty without one); outputs are ``command`` (n), ``memory`` (its next
    value), ``samples`` (pushed into the history) and one output a signal. ``memory0``: parameters -> first
    memory. ``history_length`` samples of ``samples`` are kept by the loop, which hands their sum back as
    ``history`` (zeros at the start). ``command``: what the command is. ``angles``: whether roll, pitch, yaw
    are used, so that the loop stops the run by name before they turn singular at |pitch| = 90 deg.
    ``conditioning`` names the signal trace((J J^T + damping E)^-1) of the task, and ``singular_value`` maps q
    to the smallest singular value of its Jacobian, for the certificate; a law without a Jacobian gives
    neither. ``held``: the command is an increment over the whole period, which no integrator evaluates again
    within it. A law with a ``search`` has one more output, ``asks``: 1 at a sample before which to search.
    """

    function: ca.Function
    memory0: ca.Function
    parameters: tuple[Parameter, ...]
    signals: tuple[Signal, ...]
    metrics: tuple[Metric, ...]
    history_length: int = 0
    command: str = "joint rates"
    angles: bool = True
    conditioning: str = ""
    singular_value: ca.Function | None = None
    held: bool = False
    inner: InnerLoop | None = None
    search: Search | None = None


def make_law(
    inputs: LawInputs,
    *,
    command: ca.SX,
    signals: dict[Signal, ca.SX],
    metrics: tuple[Metric, ...],
    parameters: dict[Parameter, ca.SX],
    memory: tuple[ca.SX, ca.SX, ca.SX] | None = None,
    history: tuple[ca.SX, ca.SX] | None = None,
    history_length: int = 0,
    angles: bool = True,
    conditioning: str = "",
    singular_value: ca.Function | None = None,
    held: bool = False,
    inner: tuple[InnerLoop, ca.SX] | None = None,
    search: tuple[Search, ca.SX] | None = None,
) -> Law:
    """Assemble a Law from its expressions.

    ``memory``: symbol, next value, first value (of the parameters); ``history``: symbol of the
    handed-over sums, and the samples to push; ``inner``: the loop, and the symbol of what it ends with;
    ``search``: the search, and what tells that it is asked for.
    """
    empty = ca.SX.sym("none", 0)
    old, new, first = memory or (empty, empty, empty)
    sums, samples = history or (empty, empty)
    values = ca.vertcat(*parameters.values()) if parameters else empty
    bound = {**inputs.as_dict(), "memory": old, "history": sums, "parameters": values}
    bound["turned"] = inner[1] if inner else empty
    outputs = {"command": command, "memory": new, "samples": samples}
    if search:
        outputs["asks"] = search[1]
    outputs.update({signal.name: value for signal, value in signals.items()})
    function = ca.Function(
        "law",
        list(bound.values()),
        [ca.densify(value) for value in outputs.values()],
        list(bound),
        [f"{name}_next" if name == "memory" else name for name in outputs],
    )
    return Law(
        function,
        ca.Function("memory0", [values], [ca.densify(first)], ["parameters"], ["memory"]),
        tuple(parameters),
        tuple(signals),
        metrics,
        history_length,
        angles=angles,
        conditioning=conditioning,
        singular_value=singular_value,
        held=held,
        inner=inner[0] if inner else None,
        search=search[0] if search else None,
    )


Misfit = tuple[tuple[str, ...], str]


@dataclass(frozen=True)
class Controller:
    """A law's spec model (with a literal ``kind``) and its builder (model, spec) -> Law.

    ``misfits``: (robot, spec) -> where the law does not suit the robot: the field's path in the run, and why.
    """

    spec: type[SpecModel]
    build: Callable[[Any, Any], Law]
    misfits: Callable[[Robot, Any], Iterable[Misfit]] | None = None
