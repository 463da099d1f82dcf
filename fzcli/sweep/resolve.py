"""From a sweep file to its configurations: every one a complete, validated run spec."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fzcli.control.registry import controllers
from fzcli.errors import Problem, SpecError
from fzcli.loop.run_file import fitted, run_of, timely
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.base import SpecModel
from fzcli.spec.document import Document, Node
from fzcli.spec.load import check_kind
from fzcli.spec.overlay import overlaid, without
from fzcli.spec.sets import apply_sets
from fzcli.sweep.checks import check_changed_keys, check_controller_keys, check_expected, check_one_source
from fzcli.sweep.own_section import OwnSection, entries, own_section
from fzcli.sweep.sweep_spec import OWN_KEYS, Draw, SweepFile

Array = NDArray[np.float64]
Run = TypeVar("Run", bound=SpecModel)
LASTING = {"step", "duration", "stop.after", "reference.duration", "reference.durations"}  # say how long a run is
NOT_DRAWN = ("kind", "about", "bounds", "record", "compare", "method")  # they belong to a configuration


@dataclass(frozen=True)
class Drawn:
    """A field to draw with its distribution's numbers in SI: ``low`` and ``high`` (k), or mean and deviation.

    ``choices`` (m, k) for a choice.
    """

    path: str
    distribution: str
    low: Array
    high: Array
    choices: Array | None = None

    @property
    def size(self) -> int:
        """Components of the field."""
        return int(self.low.size if self.choices is None else self.choices.shape[1])


@dataclass(frozen=True)
class Sweep:
    """A sweep, resolved. ``changes`` of each configuration as written; ``specs`` their full run specs.

    ``filter`` is the run that candidates are tried with, without a replay. ``document`` has the options applied.
    """

    file: SweepFile
    document: Document
    changes: list[dict[str, Any]]
    specs: list[SimulateRun]
    draws: tuple[Drawn, ...]
    filter: SimulateRun | None


def resolve(document: Document, sets: Sequence[str] = ()) -> Sweep:
    """Validate a sweep file and all its configurations. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "sweep")
    own = own_section(document)
    base = overlaid(without(document, set(OWN_KEYS) - set(SimulateRun.model_fields)), {"kind": "simulate"})
    check_one_source(document, own)
    configurations = configurations_of(document, own)
    kinds = _kinds(base, [*configurations, own.keep_if_changes])
    check_controller_keys(base, kinds)
    check_changed_keys(document, own, kinds)
    check_expected(document, own, configurations)
    specs, draws = resolved_runs(document, own, base, configurations, _run)
    if not LASTING & set(own.file.trajectories.draw):
        for spec in specs:
            timely(document, spec)
    keep = None
    if own.keep_if_changes is not None:
        tried = overlaid(base, {**_sample_of(document, own, 0), **own.keep_if_changes})
        keep = _run(without(tried, ["replay"]))
    return Sweep(own.file, document, plain(configurations), specs, draws, keep)


def resolved_runs(
    document: Document,
    own: OwnSection,
    base: Document,
    configurations: list[dict[str, Node]],
    make: Callable[[Document], Run],
) -> tuple[list[Run], tuple[Drawn, ...]]:
    """The run spec of each configuration, and what is drawn for it. Raises SpecError with every problem found."""
    low = _sample_of(document, own, 0)
    specs: list[Run] = []
    problems: list[Problem] = []
    for configuration in configurations:
        try:
            specs.append(make(overlaid(base, {**low, **configuration})))
        except SpecError as error:
            problems += [problem for problem in error.problems if problem not in problems]
    if problems:
        raise SpecError(problems)
    paths = sorted(own.file.trajectories.draw)
    return specs, tuple(
        _draw_of(document, own, base, path, *_first_with(path, configurations, specs), make) for path in paths
    )


def configurations_of(document: Document, own: OwnSection) -> list[dict[str, Node]]:
    """All combinations of the grid, each with every step of the zipped fields and every entry of the list."""
    axes = [[(path, node) for node in _values(document, "grid", path)] for path in own.file.grid]
    zipped = [_values(document, "zip", path) for path in own.file.zip_]
    steps = [dict(zip(own.file.zip_, step, strict=True)) for step in zip(*zipped, strict=True)] or [{}]
    listed = [entries(document.node(("list", i))) for i in range(len(own.file.list_))] or [{}]
    return [
        {**dict(combination), **step, **entry}
        for entry in listed
        for step in steps
        for combination in itertools.product(*axes)
    ]


def _values(document: Document, section: str, path: str) -> list[Node]:
    content = document.node((section, path)).content
    return content if isinstance(content, list) else []


def _kinds(base: Document, configurations: Sequence[Mapping[str, Node] | None]) -> set[str]:
    """Controller kinds that occur anywhere in the sweep."""
    written = base.value.get("controller")
    kinds = {written.get("kind")} if isinstance(written, dict) else set()
    for changes in configurations:
        if changes and "controller.kind" in changes:
            kinds.add(changes["controller.kind"].value)
    return {kind for kind in kinds if kind in controllers()}


def _sample_of(document: Document, own: OwnSection, which: int) -> dict[str, Node]:
    """A value for every drawn field, out of its distribution's own numbers: entry ``which``."""
    found: dict[str, Node] = {}
    for path, draw in own.file.trajectories.draw.items():
        node = document.node(("trajectories", "draw", path, draw.distribution))
        if draw.distribution == "sphere":
            axis = [Node(node.source, node.line, node.column, float(i == 0)) for i in range(draw.numbers)]
            found[path] = Node(node.source, node.line, node.column, axis)
        elif isinstance(node.content, list):
            found[path] = node.content[min(which, len(node.content) - 1)]
    return found


def _run(document: Document) -> SimulateRun:
    return run_of(fitted(document))


def _first_with(
    path: str, configurations: list[dict[str, Node]], specs: Sequence[Run]
) -> tuple[dict[str, Node], Run]:
    """The first configuration that has the field, else the first of all."""
    for changes, spec in zip(configurations, specs, strict=True):
        try:
            spec.value_at(path)
        except KeyError:
            continue
        return changes, spec
    return configurations[0], specs[0]


def _draw_of(
    document: Document,
    own: OwnSection,
    base: Document,
    path: str,
    first: dict[str, Node],
    low_spec: Run,
    make: Callable[[Document], Run],
) -> Drawn:
    """Numbers of a distribution in SI, taken from specs in which they stand as the field's value."""
    draws = own.file.trajectories.draw
    numbers = draws[path].numbers
    most = len(numbers) if isinstance(numbers, list) else 1
    specs = [low_spec]
    for which in range(1, most):
        specs.append(make(overlaid(base, {**_sample_of(document, own, which), **first})))
    return _drawn(document, path, draws[path], specs)


def _drawn(document: Document, path: str, draw: Draw, specs: Sequence[SpecModel]) -> Drawn:
    count = len(draw.numbers) if isinstance(draw.numbers, list) else 1
    if path.partition(".")[0] in NOT_DRAWN or any(part.isdecimal() for part in path.split(".")):
        text = "cannot be drawn; draw fields of start, reference, controller or step, lists as a whole"
        raise SpecError(document.problem(text, ("trajectories", "draw", path), at_key=True))
    try:
        values = [np.atleast_1d(np.asarray(spec.value_at(path), dtype=float)).ravel() for spec in specs[:count]]
    except (KeyError, TypeError, ValueError):
        text = "is not a field of numbers; only those can be drawn"
        raise SpecError(document.problem(text, ("trajectories", "draw", path), at_key=True)) from None
    if isinstance(specs[0].value_at(path), int) and draw.distribution != "choice":
        text = "is a whole number; draw it by choice"
        raise SpecError(document.problem(text, ("trajectories", "draw", path), at_key=True))
    if draw.distribution == "choice":
        return Drawn(path, "choice", values[0], values[0], np.array(values))
    if draw.distribution == "sphere":
        return Drawn(path, "sphere", values[0], values[0])
    low, high = values
    at = ("trajectories", "draw", path, draw.distribution)
    if draw.distribution != "normal" and not (low <= high).all():
        raise SpecError(document.problem(f"the lower end {_shown(low)} lies above the upper {_shown(high)}", at))
    if draw.distribution == "log_uniform" and not (low > 0).all():
        raise SpecError(document.problem("log_uniform needs ends above 0", at))
    return Drawn(path, draw.distribution, low, high)


def _shown(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values)


def plain(configurations: list[dict[str, Node]]) -> list[dict[str, Any]]:
    """The changes of each configuration as written."""
    return [{path: value.value for path, value in entry.items()} for entry in configurations]


def with_values(spec: Run, drawn: Mapping[str, Array]) -> Run:
    """A run spec with drawn numbers put in, for the record of a single run."""
    for path, values in drawn.items():
        spec = _put(spec, path.split("."), values)
    return spec


def _put(model: Any, steps: list[str], values: Array) -> Any:
    name = steps[0]
    old = getattr(model, name)
    if len(steps) > 1:
        return model.model_copy(update={name: _put(old, steps[1:], values)})
    kind = type(old) if isinstance(old, bool | int) else float
    new = tuple(float(v) for v in values) if isinstance(old, tuple) else kind(values[0])
    return model.model_copy(update={name: new})


