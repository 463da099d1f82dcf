"""The references that a run spec can name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fzcli.plan import base_reference, hold, line, waypoints
from fzcli.plan.reference import BaseReference, TipReference
from fzcli.spec.base import SpecModel


@dataclass(frozen=True)
class TipReferenceKind:
    """A tip reference's spec model and its builder."""

    spec: type[SpecModel]
    build: Callable[[Any], TipReference]


@dataclass(frozen=True)
class BaseReferenceKind:
    """A base reference's spec model and its builder."""

    spec: type[SpecModel]
    build: Callable[[Any], BaseReference]


TIP_REFERENCES = {
    "line": TipReferenceKind(line.LineSpec, line.build),
    "waypoints": TipReferenceKind(waypoints.WaypointsSpec, waypoints.build),
    "hold": TipReferenceKind(hold.HoldSpec, hold.build),
}
BASE_REFERENCES = {
    "hold": BaseReferenceKind(base_reference.BaseHoldSpec, base_reference.build_hold),
    "turn": BaseReferenceKind(base_reference.BaseTurnSpec, base_reference.build_turn),
}
