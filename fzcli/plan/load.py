"""Plan files to plans."""

import platform
import sys
from collections.abc import Collection, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from fzcli.errors import Problem, SpecError
from fzcli.plan.neural_goal import neural_misfits
from fzcli.plan.plan import Plan
from fzcli.plan.plan_spec import PLANNER_SPECS, PlanRun, plan_misfits
from fzcli.plan.planar_load import names_planar, planar_plan_of
from fzcli.plan.planar_result import as_any_plan
from fzcli.plan.planar_spec import AnyRun, PlanarRun
from fzcli.plan.planar_task import prepare_planar
from fzcli.plan.planning import prepare, solve
from fzcli.plan.task import AnyTask
from fzcli.spec.document import Document
from fzcli.spec.hashing import spec_hash
from fzcli.spec.library import find
from fzcli.spec.load import check_kind
from fzcli.spec.overlay import without
from fzcli.spec.parse import parse
from fzcli.spec.reader import dump, read
from fzcli.spec.references import BESIDE
from fzcli.spec.result import Provenance
from fzcli.spec.sets import apply_sets
from fzcli.spec.units import quantity


def load_plan(run: str | Path, sets: Sequence[str] = ()) -> AnyTask:
    """A plan to be made, by path or name. Raises SpecError with every problem found."""
    document = read(run if isinstance(run, Path) or run == "-" else find("runs", run))
    return task_of(document, sets)


def task_of(document: Document, sets: Sequence[str] = ()) -> AnyTask:
    """Validate a document as a plan, start and goal included. Raises SpecError with every problem found."""
    document = with_sets(document, sets)
    return prepared(document, any_plan_of(document))


def with_sets(document: Document, sets: Sequence[str]) -> Document:
    """The document of a plan with every ``KEY=VALUE`` applied; the fields of another kind of planner go with it."""
    if not sets:
        return document
    document = apply_sets(document, sets)
    of_kind = any(one.partition("=")[0].strip() == "planner.kind" for one in sets)
    return fitted(document, PLANNER_SPECS) if of_kind else document


def fitted(document: Document, kinds: Collection[str]) -> Document:
    """Without the planner's fields that its kind lacks but another of ``kinds`` knows."""
    planner = document.value.get("planner") if isinstance(document.value, dict) else None
    if not isinstance(planner, dict) or planner.get("kind", "detour") not in PLANNER_SPECS:
        return document
    own = PLANNER_SPECS[planner.get("kind", "detour")].model_fields
    elsewhere = {name for kind in kinds for name in PLANNER_SPECS[kind].model_fields}
    return without(document, [key for key in planner if key in elsewhere and key not in own], "planner")


def any_plan_of(document: Document) -> AnyRun:
    """`plan_of`, or the plan of a planar 3-RRR. Raises SpecError with every problem found."""
    return planar_plan_of(document) if names_planar(document) else plan_of(document)


def prepared(document: Document, spec: AnyRun) -> AnyTask:
    """Check start and goal of a plan that a document says. Raises SpecError, placed in the document."""
    try:
        return prepare_any(spec)
    except SpecError as error:
        raise SpecError([_placed(document, problem) for problem in error.problems]) from None


def prepare_any(spec: AnyRun) -> AnyTask:
    """Check start and goal, whatever the robot. Raises SpecError as `prepare` and `prepare_planar`."""
    return prepare_planar(spec) if isinstance(spec, PlanarRun) else prepare(spec)


def plan_of(document: Document) -> PlanRun:
    """Validate a document as a plan, but for what only its robot's geometry can tell.

    Raises SpecError with every problem found.
    """
    check_kind(document, "plan")
    spec = parse(document, PlanRun, context={BESIDE: document.path})
    misfits = (*plan_misfits(spec), *neural_misfits(spec))
    problems = [document.problem(text, path) for path, text in misfits] or _wrong_units(document, spec)
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


def make_plan(task: AnyTask, argv: Sequence[str] = ()) -> Plan:
    """Plan. Raises NoPlanError where no path is found."""
    return as_any_plan(task, solve(task), origin_of(task.spec, argv))


def origin_of(spec: AnyRun, argv: Sequence[str] = ()) -> Provenance:
    """Where a plan comes from: resolved spec, hash and versions."""
    resolved = spec.model_dump(mode="json")
    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in ("fzcli", "casadi", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree"
    return Provenance(dump(resolved), spec_hash(resolved), "vm", None, found, tuple(argv))
