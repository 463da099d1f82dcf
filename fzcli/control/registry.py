"""The control laws that a run spec can name; other packages join by the entry point group below."""

from functools import cache
from importlib.metadata import EntryPoint, entry_points

from fzcli.control import (
    clik,
    dls,
    fabrik,
    fuzzy_clik,
    fuzzy_task_priority,
    reaction_null_space,
    task_priority,
    unconstrained,
)
from fzcli.control.law import Controller
from fzcli.errors import UsageError

ENTRY_POINTS = "fzcli.controllers"

_OWN = (
    Controller(unconstrained.UnconstrainedSpec, unconstrained.build),
    Controller(clik.ClikSpec, clik.build),
    Controller(fuzzy_clik.FuzzyClikSpec, fuzzy_clik.build),
    Controller(task_priority.TaskPrioritySpec, task_priority.build),
    Controller(fuzzy_task_priority.FuzzyTaskPrioritySpec, fuzzy_task_priority.build),
    Controller(fabrik.FabrikSpec, fabrik.build, fabrik.misfits),
    Controller(dls.DlsSpec, dls.build, dls.misfits),
    Controller(reaction_null_space.ReactionNullSpaceSpec, reaction_null_space.build, reaction_null_space.misfits),
)


@cache
def controllers() -> dict[str, Controller]:
    """Kind -> controller: our own, then those of installed packages.

    An entry point of group ``fzcli.controllers`` names a `Controller`; it may not take one of our kinds.
    """
    found = {str(entry.spec.model_fields["kind"].default): entry for entry in _OWN}
    for point in entry_points(group=ENTRY_POINTS):
        found.setdefault(point.name, _loaded(point))
    return found


def _loaded(point: EntryPoint) -> Controller:
    """The controller an entry point names. Raises UsageError, naming it, when there is none."""
    name = f"entry point {point.name} = {point.value} of group {ENTRY_POINTS}"
    try:
        entry = point.load()
    except Exception as error:  # a package of somebody else's: anything may go wrong in it
        raise UsageError(f"{name}: cannot be loaded: {type(error).__name__}: {error}") from error
    if not isinstance(entry, Controller):
        raise UsageError(f"{name}: is no Controller but {type(entry).__name__}")
    return entry
