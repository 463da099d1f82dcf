"""Conditions on metrics, such as ``tip_error_max < 1e-2``."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_TEXT = re.compile(r"\s*([A-Za-z_]\w*)\s*(<=|>=|<|>)\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*")
_COMPARE = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}


@dataclass(frozen=True)
class Condition:
    """A comparison of a metric with a number; NaN never meets one."""

    metric: str
    sign: str
    limit: float

    @staticmethod
    def of(text: str) -> "Condition":
        """From text such as ``tip_error_max < 1e-2``. Raises ValueError for anything else."""
        match = _TEXT.fullmatch(text)
        if match is None:
            raise ValueError(f"must be METRIC < NUMBER (or <=, >, >=), got {text!r}")
        return Condition(match[1], match[2], float(match[3]))

    def met_by(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Which values of the metric meet it."""
        return np.asarray(_COMPARE[self.sign](values, self.limit))
