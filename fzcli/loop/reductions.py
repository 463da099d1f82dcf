"""Signals reduced to one number a run inside the step: mean, max, min, last."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import UsageError
from fzcli.spec.quantity import Metric

FAR = 1.0e300  # beyond any signal: what a total starts from, and the time of what never came


def seen(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Metrics as they are, but NaN for totals that saw no sample and times that never came."""
    return np.where(np.abs(values) == FAR, np.nan, values)


@dataclass(frozen=True)
class Accumulators:
    """Running totals: ``symbols`` (k), ``first`` and ``updated`` values, ``results`` from the totals.

    ``results`` speak of the state after the last sample, whose ``count`` is the number of samples.
    """

    symbols: ca.SX
    first: ca.SX
    updated: ca.SX
    results: ca.SX

    @staticmethod
    def of(metrics: tuple[Metric, ...], signals: dict[str, ca.SX], count: ca.SX) -> "Accumulators":
        """One total for every (signal, reduction) pair of ``metrics``."""
        symbols, first, updated, results = [], [], [], []
        for metric in metrics:
            if metric.signal not in signals:
                raise UsageError(f"metric {metric.name} reduces {metric.signal}, which no part of the loop gives")
            total, value = ca.SX.sym(metric.name), signals[metric.signal]
            symbols.append(total)
            results.append(total / count if metric.reduction == "mean" else total)
            first.append({"mean": 0.0, "max": -FAR, "min": FAR, "last": 0.0}[metric.reduction])
            updated.append(
                {
                    "mean": total + value,
                    "max": ca.fmax(total, value),
                    "min": ca.fmin(total, value),
                    "last": value,
                }[metric.reduction]
            )
        return Accumulators(
            ca.vertcat(*symbols), ca.vertcat(*map(ca.SX, first)), ca.vertcat(*updated), ca.vertcat(*results)
        )
