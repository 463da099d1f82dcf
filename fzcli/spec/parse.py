"""Document -> model: pydantic's checks, reported all at once with places and in this tool's words."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from fzcli.errors import Problem, SpecError
from fzcli.spec.document import Document, Steps
from fzcli.spec.explain import MISSING, Fault, explain
from fzcli.spec.nearest import shown
from fzcli.spec.sets import apply_sets

T = TypeVar("T")
MAX_PROBLEMS = 100  # told at once


def parse(
    document: Document, model: type[T], *, sets: Sequence[str] = (), context: Mapping[str, Any] | None = None
) -> T:
    """Validate a document, ``--set`` options applied, as a model (or any type that pydantic knows).

    ``context`` reaches validators as ``info.context``. A validator's plain ValueError becomes a problem
    at its field; a SpecError raised in one (from a file named there) adds its own problems.

    Raises:
        SpecError: every problem found, in the order of the text.
    """
    if sets:
        document = apply_sets(document, sets)
    try:
        result = TypeAdapter(model).validate_python(document.value, context=dict(context or {}))
    except ValidationError as error:
        raise SpecError(_problems(error, document, model)) from None
    if false_numbers := list(_false_numbers(document.value, result, ())):
        raise SpecError([document.problem(text, path) for text, path in false_numbers])
    return result


def _false_numbers(given: Any, taken: Any, path: Steps) -> Iterator[tuple[str, Steps]]:
    """Where pydantic took true or false for 1 or 0."""
    if isinstance(given, bool) and type(taken) in (int, float):
        yield f"must be a number, got {shown(given)}", path
    elif isinstance(given, list) and isinstance(taken, list | tuple) and len(given) == len(taken):
        for index, (one, other) in enumerate(zip(given, taken, strict=True)):
            yield from _false_numbers(one, other, (*path, index))
    elif isinstance(given, dict):
        for key, one in given.items():
            other = taken.get(key) if isinstance(taken, dict) else getattr(taken, key, None)
            yield from _false_numbers(one, other, (*path, key))


def _problems(error: ValidationError, document: Document, model: Any) -> list[Problem]:
    found: dict[tuple[Steps, bool], list[Problem]] = {}
    all_details = [details for details in error.errors(include_url=False) if not _is_echo(details)]
    more = len(all_details) - MAX_PROBLEMS
    all_details = all_details[:MAX_PROBLEMS]
    lengths: dict[tuple[int | str, ...], int] = {}  # what a tuple that is too short needs
    for details in all_details:
        if details["type"] == "missing" and isinstance(last := details["loc"][-1], int):
            lengths[details["loc"][:-1]] = last + 1
    for details in all_details:
        context = {"needed": lengths.get(details["loc"][:-1]), **details.get("ctx", {})}
        cause = context.get("error")
        path = _path(document, details["loc"], details["type"])
        if isinstance(cause, SpecError):
            found.setdefault((path, False), []).extend(_inner(cause, document, path))
            continue
        fault = Fault(details["type"], details["loc"], details["msg"], details["input"], context)
        text, below, at_key = explain(fault, model)
        problem = document.problem(text, path + below, at_key=at_key)
        alike = found.setdefault((path + below, at_key), [])
        if problem not in alike:
            alike.append(problem)
    meant = {
        (*path[:-1], match[1])
        for (path, at_key), alike in found.items()
        if at_key and (match := re.search(r"did you mean '(.*)'", alike[0].message))
    }
    ordered = sorted(found.items(), key=lambda item: _order(document, *item[0]))
    problems = [
        problem
        for (path, _), alike in ordered
        if not (path in meant and alike[0].message == MISSING)  # the mistyped key says it
        for problem in _one_of(alike)
    ]
    return problems + ([Problem(f"and {more} more problems", file=document.file)] if more > 0 else [])


def _is_echo(details: ErrorDetails) -> bool:
    """pydantic calls a list too short when its items are wrong; only their own errors count."""
    return details["type"] == "too_short" and len(details["input"]) >= details["ctx"]["min_length"]


def _inner(cause: SpecError, document: Document, path: Steps) -> list[Problem]:
    """A nested file's problems as they are; those without a file get the field's place."""
    placed = []
    for problem in cause.problems:
        text = f"{problem.field}: {problem.message}" if problem.field else problem.message
        placed.append(problem if problem.file else document.problem(text, path))
    return placed


def _path(document: Document, loc: tuple[int | str, ...], kind: str) -> Steps:
    """pydantic's location without the tags of unions and names of functions that it holds."""
    node = document.root
    path: list[int | str] = []
    for index, step in enumerate(loc):
        below = node.child(step)
        if below is not None:
            node = below
            path.append(step)
        elif kind == "missing" and index == len(loc) - 1 and isinstance(step, str):
            path.append(step)
    return tuple(path)


def _one_of(alike: list[Problem]) -> list[Problem]:
    """The alternatives of a union that failed at the same place, as one problem."""
    if len(alike) < 2 or not all(problem.message.startswith("must be ") for problem in alike):
        return alike
    wanted = [problem.message.partition(", got ")[0].removeprefix("must be ") for problem in alike]
    got = alike[0].message.partition(", got ")[2]
    text = "must be " + " or ".join(dict.fromkeys(wanted)) + (f", got {got}" if got else "")
    first = alike[0]
    return [Problem(text, first.field, first.file, first.line, first.column, first.snippet)]


def _order(document: Document, path: Steps, at_key: bool) -> tuple[bool, int, int]:
    place = document.problem("", path, at_key=at_key)
    return place.line is None, place.line or 0, place.column or 0
