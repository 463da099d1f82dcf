"""What the torque level of a run is composed of, and the vectors that its step works on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fzcli.control.torque.law import TorqueLaw
from fzcli.loop.guide import Guided
from fzcli.loop.replay_spec import ReplaySpec
from fzcli.loop.torque_plant import TorquePlant
from fzcli.loop.vectors import Vector
from fzcli.model import RobotModel
from fzcli.plan.reference import TipReference
from fzcli.spec.quantity import Signal


class Motion(Protocol):
    """What is known of the run whose motion is followed; ``reference`` None: there is nothing but the motion."""

    @property
    def model(self) -> RobotModel: ...
    @property
    def tip(self) -> str | None: ...
    @property
    def dt(self) -> float: ...
    @property
    def drifting(self) -> bool: ...
    @property
    def reference(self) -> TipReference | None: ...


@dataclass(frozen=True)
class TorqueParts:
    """What the torque level is composed of, beside the ``run``'s own parts."""

    run: Motion
    spec: ReplaySpec
    law: TorqueLaw
    plant: TorquePlant
    guided: Guided

    @property
    def h(self) -> float:
        """A step of torque control and integration [s]."""
        return self.run.dt / self.spec.substeps


@dataclass(frozen=True)
class TorqueVectors:
    """Symbols of the torque level: ``state``, ``constants`` of a run; in a step ``moving`` and ``fixed``."""

    state: Vector
    constants: Vector
    moving: Vector
    fixed: Vector

    @staticmethod
    def of(parts: TorqueParts, totals: int) -> "TorqueVectors":
        """Fresh symbols; ``totals``: how many running totals the state holds."""
        plant, m = parts.plant, parts.guided.size
        latched = {"first": plant.place.size, "given": plant.rate.size1_in(1), "shown": size_of(parts.law.signals)}
        peaks = {"torque_peak": 1, "power_peak": 1, "moved": 1, "saturated": 1}
        parameters, reference = (*parts.law.parameters, *plant.parameters), parts.run.reference
        return TorqueVectors(
            Vector.of(
                "state",
                {"plant": plant.place.size, "sample": m, "slope": m, "rate": m, "bend": m}
                | {"held": 1, "moved": 1, "totals": totals, "count": 1},
            ),
            Vector.of(
                "constants",
                {"com": 3, "com_velocity": 3, "reference": reference.prepare.size1_out(0) if reference else 0}
                | {"first_quat": 4, "energy0": 1}
                | {parameter.path: parameter.size for parameter in parameters},
            ),
            Vector.of("moving", {"plant": plant.place.size, "held": 1, "number": 1, **latched, **peaks}),
            Vector.of("fixed", {"coefficients": 6 * m, "time": 1}),
        )


def size_of(signals: Sequence[Signal]) -> int:
    """Numbers in these signals."""
    return sum(signal.size for signal in signals)


