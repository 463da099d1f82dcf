"""The control laws that a run spec can name; other packages join by the entry point group below."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from fzcli.control import clik, fuzzy_clik, unconstrained
from fzcli.control.law import Law
from fzcli.spec.base import SpecModel

ENTRY_POINTS = "fzcli.controllers"


@dataclass(frozen=True)
class Controller:
    """A law's spec model (with a literal ``kind``) and its builder (model, spec) -> Law."""

    spec: type[SpecModel]
    build: Callable[[Any, Any], Law]


_OWN = (
    Controller(unconstrained.UnconstrainedSpec, unconstrained.build),
    Controller(clik.ClikSpec, clik.build),
    Controller(fuzzy_clik.FuzzyClikSpec, fuzzy_clik.build),
)


@cache
def controllers() -> dict[str, Controller]:
    """Kind -> controller: our own, then those of installed packages.

    An entry point of group ``fzcli.controllers`` names a `Controller`; it may not take one of our kinds.
    """
    found = {str(entry.spec.model_fields["kind"].default): entry for entry in _OWN}
    for point in entry_points(group=ENTRY_POINTS):
        found.setdefault(point.name, point.load())
    return found
