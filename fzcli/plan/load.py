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


def load_plan(run: str | Path, sets: Sequence[str] = ()) -> Task:
    """A plan to be made, by path or name. Raises SpecError with every problem found."""
    document = read(run if isinstance(run, Path) or run == "-" else find("runs", run))
    return task_of(document, sets)


def task_of(document: Document, sets: Sequence[str] = ()) -> Task:
    """Validate a document as a plan, start and goal included. Raises SpecError with every problem found."""
    document = apply_sets(document, sets) if sets else document
    check_kind(document, "plan")
    spec = parse(document, PlanRun, context={BESIDE: document.path})
    problems = [document.problem(text, path) for path, text in plan_misfits(spec)]
    if problems:
        raise SpecError(problems)
    try:
        return prepare(spec)
    except SpecError as error:
        raise SpecError([_placed(document, problem) for problem in error.problems]) from None


def _placed(document: Document, problem: Problem) -> Problem:
    """At the field that it speaks of, where the document has that field."""
    steps = tuple(problem.field.split("."))
    return document.problem(problem.message, steps)


def make_plan(task: Task, argv: Sequence[str] = ()) -> Plan:
    """Plan. Raises NoPlanError where no path is found."""
    attempt = solve(task)
    resolved = task.spec.model_dump(mode="json")
    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in ("fzcli", "casadi", "numpy", "scipy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree"
    origin = Provenance(dump(resolved), spec_hash(resolved), "vm", None, found, tuple(argv))
    return as_plan(task, attempt, origin)
