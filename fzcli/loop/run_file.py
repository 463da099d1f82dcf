"""A simulation from its file to its spec, with its variants; nothing is built."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from fzcli.errors import Problem, SpecError
from fzcli.loop.reach import out_of_reach
from fzcli.loop.run_spec import SimulateRun, misfits, never_reached, simulate_model
from fzcli.spec.base import SpecModel
from fzcli.spec.document import Document
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.overlay import overlaid, without
from fzcli.spec.parse import parse
from fzcli.spec.reader import read
from fzcli.spec.references import BESIDE
from fzcli.spec.sets import apply_sets
from fzcli.spec.units import quantity


def load_run(run: str | Path | Document, sets: Sequence[str] = ()) -> tuple[SimulateRun, dict[str, SimulateRun]]:
    """A run and its variants, by path or name, or as read. Raises SpecError with every problem found."""
    return runs_of(run if isinstance(run, Document) else read_run(run), sets)


def read_run(run: str | Path) -> Document:
    """A run file, by path or name. Raises SpecError where there is none."""
    return read(run if isinstance(run, Path) or run == "-" else find("runs", run))


def runs_of(document: Document, sets: Sequence[str] = ()) -> tuple[SimulateRun, dict[str, SimulateRun]]:
    """The run that a document says, and its variants. Raises SpecError with every problem found."""
    if sets:
        document = apply_sets(document, sets)
        if any(one.partition("=")[0].strip() == "controller.kind" for one in sets):
            document = fitted(document)  # the file's fields of the kind before go with it
    spec = timely(document, run_of(document))
    missing = out_of_reach(spec)
    if missing:
        raise SpecError(document.problem(missing, ("reference", "position")))
    return spec, variants_of(document, spec)


def run_of(document: Document, sets: Sequence[str] = ()) -> SimulateRun:
    """Validate a document as a simulation. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "simulate")
    spec = parse(document, simulate_model(), context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in misfits(spec)] or _wrong_units(document, spec)
    if problems:
        raise SpecError(problems)
    return spec


def timely(document: Document, spec: SimulateRun) -> SimulateRun:
    """The run of a document. Raises SpecError where it waits for a time that it never comes to."""
    problems = [document.problem(text, path) for path, text in never_reached(spec)]
    if problems:
        raise SpecError(problems)
    return spec


def _wrong_units(document: Document, spec: SimulateRun) -> list[Problem]:
    """Joint positions whose written unit is not their joint's: a length for a revolute one, or an angle."""
    types = [link.joint.type for link in spec.robot.links if link.joint.type != "fixed"]
    problems = []
    for i, (written, kind) in enumerate(zip(document.value["start"]["q"], types, strict=True)):
        try:
            quantity(written, "length" if kind == "prismatic" else "angle")
        except ValueError as error:
            problems.append(document.problem(str(error), ("start", "q", i)))
    return problems


def variants_of(document: Document, spec: SimulateRun, sets: Sequence[str] = ()) -> dict[str, SimulateRun]:
    """The runs that ``compare`` names, each the file's run with some fields changed."""
    document = apply_sets(document, sets) if sets else document
    found: dict[str, SimulateRun] = {}
    problems: list[Problem] = []
    for name, changes in spec.compare.items():
        try:
            changed = variant(document, changes)
            found[name] = timely(changed, run_of(changed))
        except SpecError as error:
            problems += [_in_variant(document, name, changes, problem) for problem in error.problems]
    if problems:
        raise SpecError(problems)
    return found


def _in_variant(document: Document, name: str, changes: dict[str, Any], problem: Problem) -> Problem:
    """The problem placed in ``compare``, at the change that made it where one did."""
    change = next((path for path in changes if f"{problem.field}.".startswith(f"{path}.")), None)
    if change is None:
        return replace(problem, field=f"compare.{name}: {problem.field}")
    placed = document.problem(problem.message, ("compare", name, change), at_key=True)
    return replace(placed, field=f"compare.{name}.{problem.field}")


def variant(document: Document, changes: dict[str, Any]) -> Document:
    """The document with fields changed; where the controller's kind changes, fields it lacks are dropped."""
    changed = overlaid(without(document, ["compare"]), changes)
    fit = fitted(changed)
    kept = fit.value.get("controller")
    lost = [path for path in changes if path.startswith("controller.") and path.split(".")[1] not in (kept or {})]
    if isinstance(kept, dict) and lost:
        known = ", ".join(f"controller.{key}" for key in kept)
        text = f"{kept.get('kind')!r} has no such field; it has {known}"
        raise SpecError([Problem(text, path, document.file) for path in lost])
    return fit


def fitted(document: Document) -> Document:
    """Without the fields of a controller, of the run or its replay, that its kind lacks but another kind knows."""
    from fzcli.control.registry import controllers
    from fzcli.control.torque.registry import TORQUE_CONTROLLERS

    own = {kind: entry.spec for kind, entry in controllers().items()}
    torque = {kind: entry.spec for kind, entry in TORQUE_CONTROLLERS.items()}
    return _fitted(_fitted(document, ("controller",), own), ("replay", "controller"), torque)


def _fitted(document: Document, place: tuple[str, ...], kinds: Mapping[str, type[SpecModel]]) -> Document:
    found: Any = document.value
    for key in place:
        found = found.get(key) if isinstance(found, dict) else None
    if not isinstance(found, dict) or found.get("kind") not in kinds:
        return document
    own = kinds[found["kind"]].model_fields
    elsewhere = {name for spec in kinds.values() for name in spec.model_fields}
    return without(document, [key for key in found if key in elsewhere and key not in own], *place)
