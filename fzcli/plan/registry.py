"""The references that a run spec can name."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from fzcli.model import RobotModel
from fzcli.plan import base_reference, hold, line, reachable, target, waypoints
from fzcli.plan.reference import BaseReference, TipReference
from fzcli.spec.base import SpecModel


@dataclass(frozen=True)
class TipReferenceKind:
    """A tip reference's spec model and its builder (spec, model, tip) -> TipReference."""

    spec: type[SpecModel]
    build: Callable[[Any, RobotModel, str | None], TipReference]


@dataclass(frozen=True)
class BaseReferenceKind:
    """A base reference's spec model and its builder."""

    spec: type[SpecModel]
    build: Callable[[Any], BaseReference]


TIP_REFERENCES = {
    "line": TipReferenceKind(line.LineSpec, line.build),
    "waypoints": TipReferenceKind(waypoints.WaypointsSpec, waypoints.build),
    "hold": TipReferenceKind(hold.HoldSpec, hold.build),
    "target": TipReferenceKind(target.TargetSpec, target.build),
    "reachable": TipReferenceKind(reachable.ReachableSpec, reachable.build),
}
BASE_REFERENCES = {
    "hold": BaseReferenceKind(base_reference.BaseHoldSpec, base_reference.build_hold),
    "turn": BaseReferenceKind(base_reference.BaseTurnSpec, base_reference.build_turn),
}
