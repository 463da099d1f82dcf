"""The fields of a sweep file that are the sweep's own, taken apart from those of its runs."""

from dataclasses import dataclass

from fzcli.errors import SpecError
from fzcli.loop.run_spec import SimulateRun
from fzcli.spec.base import SpecModel
from fzcli.spec.document import Document, Node
from fzcli.spec.nearest import hint
from fzcli.spec.overlay import without
from fzcli.spec.parse import parse
from fzcli.sweep.sweep_spec import OWN_KEYS, SweepFile


@dataclass(frozen=True)
class OwnSection:
    """The sweep's own model, and the changes its filter makes (None without a filter)."""

    file: SweepFile
    keep_if_changes: dict[str, Node] | None


def own_section(document: Document, run: type[SpecModel] = SimulateRun) -> OwnSection:
    """The sweep's own fields; those of ``run`` are checked configuration by configuration."""
    value = document.value
    run_keys = set(run.model_fields) - {"kind", "about", "compare"}
    known = run_keys | set(OWN_KEYS) | {"kind", "about"}
    problems = [
        document.problem(f"unknown key{hint(key, known)}", (key,), at_key=True) for key in value if key not in known
    ]
    try:
        file = parse(without(document, run_keys | (set(value) - known)), SweepFile)
    except SpecError as error:
        raise SpecError([*problems, *error.problems]) from None
    if file.scenes is not None and file.run != "plan":
        problems.append(document.problem("are for plans; write run: plan", ("scenes",), at_key=True))
    if problems:
        raise SpecError(problems)
    keep_if = file.trajectories.keep_if
    changes = None
    if keep_if is not None:
        changes = entries(document.node(("trajectories", "keep_if", "with"))) if keep_if.with_ else {}
    return OwnSection(file, changes)


def entries(node: Node) -> dict[str, Node]:
    """A mapping's entries as nodes; none for anything else."""
    return dict(node.content) if isinstance(node.content, dict) else {}
