"""Torque steps by the adaptive integrator: on the host, in CasADi's machine, each parted as its tolerance asks."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import IntegrationError
from fzcli.loop.engine import Batch, Resume, VirtualMachine
from fzcli.loop.rollable import Rollable
from fzcli.model.integrators import DormandPrince

Array = NDArray[np.float64]


class AdaptiveStep(ca.Callback):
    """(state, input) -> state_next over ``dt`` [s]; ``refusal`` keeps why the method gave up."""

    def __init__(self, method: DormandPrince, dt: float) -> None:
        super().__init__()
        self.method, self.dt = method, dt
        self.refusal: IntegrationError | None = None
        self.construct("adaptive_step", {})

    def get_n_in(self) -> int:
        """State and input."""
        return 2

    def get_n_out(self) -> int:
        """State."""
        return 1

    def get_sparsity_in(self, i: int) -> Any:
        """Dense columns."""
        return ca.Sparsity.dense(self.method.trial.size1_in(i), 1)

    def get_sparsity_out(self, i: int) -> Any:
        """A dense column."""
        return ca.Sparsity.dense(self.method.trial.size1_in(0), 1)

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        """One step; a state that is no longer a number stays so."""
        state, given = (np.array(part).ravel() for part in arguments)
        if self.refusal is not None or not np.isfinite(state).all():
            return [ca.DM.nan(len(state), 1)]
        try:
            return [ca.DM(self.method.advance(state, given, self.dt).state)]
        except IntegrationError as error:  # told by the engine: CasADi passes on no exception as it is
            self.refusal = error
            return [ca.DM.nan(len(state), 1)]


class AdaptiveMachine:
    """CasADi's machine for a loop with an `AdaptiveStep`; raises what made the method give up."""

    def __init__(self, loop: Rollable, step: AdaptiveStep) -> None:
        self.loop: Any = loop
        self.name = "vm"
        self._machine, self._step = VirtualMachine(loop), step

    def run(
        self,
        parameters: Array,
        n_steps: NDArray[np.int64],
        *,
        record: bool = False,
        jobs: int = 1,
        progress: Callable[[int], None] | None = None,
        resume: Resume | None = None,
        series: NDArray[np.int64] | None = None,
    ) -> Batch:
        """See `Engine.run`. Raises IntegrationError where the step is too large for the method."""
        self._step.refusal = None
        batch = self._machine.run(
            parameters, n_steps, record=record, jobs=jobs, progress=progress, resume=resume, series=series
        )
        if self._step.refusal is not None:
            raise self._step.refusal
        return batch
