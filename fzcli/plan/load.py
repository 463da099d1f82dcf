"""Plan files to plans."""

import platform
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from fzcli.errors import Problem, SpecError
from fzcli.plan.plan import Plan
from fzcli.plan.plan_spec import PlanRun, plan_misfits
from fzcli.plan.planning import Task, prepare, solve
from fzcli.plan.result import as_plan
from fzcli.spec.document import Document
from fzcli.spec.hashing import spec_hash
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.parse import parse
from fzcli.spec.reader import dump, read
from fzcli.spec.references import BESIDE
from fzcli.spec.result import Provenance
from fzcli.spec.sets import apply_sets
from fzcli.spec.units import quantity


def load_plan(run: str | Path, sets: Sequence[str] = ()) -> Task:
    """A plan to be made, by path or name. Raises SpecError with every problem found."""
    document = read(run if isinstance(run, Path) or run == "-" else find("runs", run))
    return task_of(document, sets)


def task_of(document: Document, sets: Sequence[str] = ()) -> Task:
    """Validate a document as a plan, start and goal included. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    return prepared(document, plan_of(document))


def prepared(document: Document, spec: PlanRun) -> Task:
    """Check start and goal of a plan that a document says. Raises SpecError, placed in the document."""
    try:
        return prepare(spec)
    except SpecError as error:
        raise SpecError([_placed(document, problem) for problem in error.problems]) from None


def plan_of(document: Document) -> PlanRun:
    """Validate a document as a plan, but for what only its robot's geometry can tell.

    Raises SpecError with every problem found.
    """
    check_kind(document, "plan")
    spec = parse(document, PlanRun, context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in plan_misfits(spec)] or _wrong_units(document, spec)
    if problems:
        raise SpecError(problems)
    return spec


def _wrong_units(document: Document, spec: PlanRun) -> list[Problem]:
    """Joint positions whose written unit is not their joint's: a length for a revolute one, or an angle."""
    types = [link.joint.type for link in spec.robot.links if link.joint.type != "fixed"]
    problems = []
    for part in ("start", "goal"):
        for i, (written, kind) in enumerate(zip(document.value[part].get("q") or (), types, strict=False)):
            try:
                quantity(written, "length" if kind == "prismatic" else "angle")
            except ValueError as error:
                problems.append(document.problem(str(error), (part, "q", i)))
    return problems


def _placed(document: Document, problem: Problem) -> Problem:
    """At the field that it speaks of, where the document has that field."""
    steps = tuple(problem.field.split("."))
    return document.problem(problem.message, steps)


def make_plan(task: Task, argv: Sequence[str] = ()) -> Plan:
    """Plan. Raises NoPlanError where no path is found."""
    return as_plan(task, solve(task), origin_of(task.spec, argv))


def origin_of(spec: PlanRun, argv: Sequence[str] = ()) -> Provenance:
    """Where a plan comes from: resolved spec, hash and versions."""
    resolved = spec.model_dump(mode="json")
    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in ("fzcli", "casadi", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree"
    return Provenance(dump(resolved), spec_hash(resolved), "vm", None, found, tuple(argv))
