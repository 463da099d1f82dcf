"""What an engine needs of a loop."""

from typing import Protocol

import casadi as ca


class Rollable(Protocol):
    """Functions of a loop: ``initial``: parameters -> state, constants. ``step``: (state, constants, history)
    -> state_next, samples, stop, signals. ``finish``: (state, constants) -> metrics.
    """

    @property
    def initial(self) -> ca.Function: ...
    @property
    def step(self) -> ca.Function: ...
    @property
    def finish(self) -> ca.Function: ...
    @property
    def history_length(self) -> int: ...
