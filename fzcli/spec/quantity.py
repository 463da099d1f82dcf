"""Descriptions of named quantities, shared by every room that makes or keeps numbers."""

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Signal:
    """A named quantity: unit, one line of meaning, and the names of its components (empty: a scalar).

    ``truth``: its values are 1 (true) and 0 (false), so that over many runs it has a share, not a spread.
    """

    name: str
    unit: str
    long_name: str
    components: tuple[str, ...] = ()
    truth: bool = False

    @property
    def size(self) -> int:
        """Number of components, 1 for a scalar."""
        return max(1, len(self.components))


@dataclass(frozen=True)
class Parameter:
    """Numbers of the spec that a compiled step takes at run time: dotted path and how many there are.

    Fields that are not parameters are built into the step; a change of one means another build.
    """

    path: str
    size: int = 1


Reduction = Literal["mean", "max", "min", "last"]


@dataclass(frozen=True)
class Metric:
    """One number a run, reduced from a scalar signal over all samples; ``truth`` as of a Signal."""

    name: str
    signal: str
    reduction: Reduction
    unit: str
    long_name: str
    truth: bool = False
