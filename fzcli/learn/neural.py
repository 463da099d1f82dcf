"""Networks in use: their answer, Newton's refinement of it, and the gate that it must pass."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.errors import Problem, SpecError
from fzcli.learn.kinematic_map import Array, KinematicMap, Mask, on_columns
from fzcli.learn.network import Network
from fzcli.learn.train_spec import RefineSpec
from fzcli.spec.nearest import hint


@dataclass(frozen=True)
class Estimate:
    """What a network says for one input, before and after the Newton steps.

    ``value`` and ``raw`` (o): outputs after and before. ``residual`` and ``raw_residual`` (2): distance [m]
    and angle [rad] by which the exact kinematics are not met. ``accepted``: the residual passes the gate and
    the value lies on the branch ``label``; one that is not accepted must not be used.
    """

    label: str
    value: Array
    raw: Array
    residual: Array
    raw_residual: Array
    accepted: bool


@dataclass(frozen=True)
class NeuralKinematics:
    """The networks of a robot's map, a label each, with the exact kinematics that check them."""

    map: KinematicMap
    networks: Mapping[str, Network]
    refine: RefineSpec

    @property
    def labels(self) -> tuple[str, ...]:
        """The branches there are networks for."""
        return tuple(self.networks)

    def solve(self, value: ArrayLike, label: str | None = None, steps: int | None = None) -> list[Estimate]:
        """Estimates for one input (i), of one branch or of all; accepted ones first, then by residual.

        ``steps`` Newton steps follow the network (default: the last of the run's own).

        Raises:
            SpecError: there is no network of that label, or the input has another size or is not finite.
        """
        given = np.asarray(value, dtype=float).reshape(1, -1)
        size = len(self.map.input_names)
        if given.shape[1] != size or not np.isfinite(given).all():
            raise SpecError(Problem(f"must be {size} finite numbers: {', '.join(self.map.input_names)}", field="input"))
        found = [self._estimate(given, one, steps) for one in ([label] if label else self.labels)]
        return sorted(found, key=lambda one: (not one.accepted, float(np.max(one.residual))))

    def _estimate(self, given: Array, label: str, steps: int | None) -> Estimate:
        raw = self.network(label).predict(given)
        value = refined(self.map, raw, given, self.refine.steps[-1] if steps is None else steps)
        residual, accepted = gate(self.map, value, given, label, self.refine.gate)
        before = on_columns(self.map.residual, raw, given)
        return Estimate(label, value[0], raw[0], residual[0], before[0], bool(accepted[0]))

    def network(self, label: str) -> Network:
        """The network of a branch. Raises SpecError where there is none."""
        if label not in self.networks:
            raise SpecError(Problem(f"no network {label!r}{hint(label, self.labels, 'there are')}", field="label"))
        return self.networks[label]

    def function(self, label: str, steps: int = 0) -> ca.Function:
        """input (i) -> output (o) after ``steps`` Newton steps, residual (2) [m, rad]; raises as ``network``."""
        network = self.network(label).function()
        x = ca.MX.sym("input", len(self.map.input_names))
        y = network(x)
        for _ in range(steps):
            y = self.map.improve(y, x)
        outputs = [y, self.map.residual(y, x)]
        return ca.Function("neural_kinematics", [x], outputs, ["input"], ["output", "residual"])


def refined(map: KinematicMap, outputs: Array, inputs: Array, steps: int) -> Array:
    """Outputs (N, o) after Newton steps on the exact kinematics at inputs (N, i)."""
    for _ in range(steps):
        outputs = on_columns(map.improve, outputs, inputs)
    return outputs


def gate(map: KinematicMap, outputs: Array, inputs: Array, label: str, most: float) -> tuple[Array, Mask]:
    """Residuals (N, 2) [m, rad], and (N,) whether they are small enough on the right branch."""
    residual: NDArray[np.float64] = on_columns(map.residual, outputs, inputs)
    with np.errstate(invalid="ignore"):
        small = (residual <= most).all(axis=1)  # false for what is not a number
    return residual, np.asarray(small & map.belongs(outputs, inputs, label))
