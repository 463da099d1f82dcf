"""The forward map of a planar 3-RRR, joint angles -> pose, one branch for each working mode and sign of det A."""

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from fzcli.learn.kinematic_map import Array, ErrorMap, Errors, Mask, Samples, collect
from fzcli.learn.network import Coding
from fzcli.learn.train_spec import PlanarForwardSpec
from fzcli.model.planar_3rrr import Planar3RRRModel, build_planar_model, mode_signs
from fzcli.spec.planar import Planar3RRR

_GRID = 41  # cells of an error map a side
_EDGE = 1e-6  # m, rad: how far outside the region a pose still counts as in it


@dataclass(frozen=True)
class PlanarForward:
    """Poses are drawn evenly over the region's disc and angles; those that a leg cannot reach are left out."""

    model: Planar3RRRModel
    spec: PlanarForwardSpec
    input_names: tuple[str, ...] = ("theta1 [rad]", "theta2 [rad]", "theta3 [rad]")
    output_names: tuple[str, ...] = ("x [m]", "y [m]", "phi [rad]")
    input_coding: Coding = field(default="angles")
    output_coding: Coding = field(default="numbers")

    @property
    def labels(self) -> tuple[str, ...]:
        """Such as "++- det+" or, not split by the sign of det A, "++-"."""
        signs = (" det+", " det-") if self.spec.split else ("",)
        return tuple(mode + sign for mode in self.spec.modes for sign in signs)

    @property
    def improve(self) -> ca.Function:
        """(pose, theta) -> pose after one Newton step."""
        return self.model.function("newton")

    @cached_property
    def residual(self) -> ca.Function:
        """(pose, theta) -> the worst distal link's excess length [m], and 0."""
        pose, theta = ca.SX.sym("pose", 3), ca.SX.sym("theta", 3)
        worst = ca.mmax(ca.fabs(self.model.function("closure")(pose, theta)))
        return ca.Function("residual", [pose, theta], [ca.vertcat(worst, ca.SX.zeros(1))])

    def draw(self, rng: np.random.Generator, count: int, label: str) -> Samples | None:
        """Joint angles and poses of a branch."""

        def some(n: int) -> tuple[Array, Array]:
            distance, around = self.spec.radius * np.sqrt(rng.random(n)), rng.uniform(0, 2 * np.pi, n)
            turn = rng.uniform(-self.spec.turn, self.spec.turn, n)
            poses = np.column_stack([distance * np.cos(around), distance * np.sin(around), turn])
            kept, theta = self._on_branch(poses, label)
            return theta[kept], poses[kept]

        return collect(some, count)

    def _on_branch(self, poses: Array, label: str) -> tuple[Mask, Array]:
        """(N,) whether a branch has poses (N, 3), and the joint angles (N, 3) there."""
        mode, _, sign = label.partition(" det")
        theta = self.model.inverse_many(poses, mode)
        kept = self.model.reachable(poses)
        determinant = self.model.measures(poses, theta)[:, 3]
        kept &= np.abs(determinant) >= self.spec.off_singular
        if sign:
            kept &= (determinant >= 0) == (sign == "+")
        return kept, theta

    def miss(self, outputs: Array, truth: Array, inputs: Array) -> Array:
        """(N, 2): distance of the platform's centre [m] and angle [rad] from the true pose."""
        turn = np.remainder(outputs[:, 2] - truth[:, 2] + np.pi, 2 * np.pi) - np.pi
        return np.column_stack([np.hypot(*(outputs[:, :2] - truth[:, :2]).T), np.abs(turn)])

    def belongs(self, outputs: Array, inputs: Array, label: str) -> Mask:
        """(N,) whether poses lie in the region and have the label's working mode and sign."""
        mode, _, sign = label.partition(" det")
        found: Mask = np.asarray(np.isfinite(outputs).all(axis=1))
        at = np.where(found[:, None], outputs, 0.0)
        measures = self.model.measures(at, inputs)
        found &= ((measures[:, :3] < 0) == (mode_signs(mode) > 0)).all(axis=1)
        if sign:
            found &= (measures[:, 3] >= 0) == (sign == "+")
        within = np.hypot(at[:, 0], at[:, 1]) <= self.spec.radius + _EDGE
        return np.asarray(found & within & (np.abs(at[:, 2]) <= self.spec.turn + _EDGE))

    def error_map(self, label: str, samples: Samples, errors: Errors) -> ErrorMap:
        """Distance errors over x and y at the region's least, middle and greatest angle."""
        edge = np.linspace(-self.spec.radius, self.spec.radius, _GRID)
        x, y = np.meshgrid(edge, edge)
        turns = self.spec.turn * np.array([-1.0, 0.0, 1.0])
        maps = np.full((2, len(turns), _GRID, _GRID), np.nan)
        for k, turn in enumerate(turns):
            poses = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, turn)])
            kept, theta = self._on_branch(poses, label)
            kept &= np.hypot(poses[:, 0], poses[:, 1]) <= self.spec.radius
            if kept.any():
                for values, error in zip(maps, errors(theta[kept], poses[kept]), strict=True):
                    values[k][kept.reshape(x.shape)] = error[:, 0]
        panels = tuple(f"phi = {np.degrees(turn):.4g} deg" for turn in turns)
        return ErrorMap(("x [m]", "y [m]"), panels, edge, edge, maps[0], maps[1])


def planar_forward(robot: Planar3RRR, spec: PlanarForwardSpec) -> PlanarForward:
    """The forward map of a robot over the region that a run says."""
    return PlanarForward(build_planar_model(robot), spec)
