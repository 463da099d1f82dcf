"""What a closed loop is composed of."""

from dataclasses import dataclass

from fzcli.control.law import Law
from fzcli.loop.plant import Plant
from fzcli.loop.run_spec import StopSpec
from fzcli.model import RobotModel
from fzcli.plan.reference import BaseReference, TipReference
from fzcli.spec.condition import Condition


@dataclass(frozen=True)
class Parts:
    """The parts, each under its own contract; ``drifting``: the system starts with momentum.

    ``stop``: when a run with a target has arrived; None where that is not asked. ``wanted``: what the run's metrics
    must meet; a run that is seen to miss it is given up.
    """

    model: RobotModel
    law: Law
    plant: Plant
    reference: TipReference
    base_reference: BaseReference
    tip: str | None
    dt: float
    method: str
    drifting: bool
    stop: StopSpec | None = None
    wanted: tuple[Condition, ...] = ()
