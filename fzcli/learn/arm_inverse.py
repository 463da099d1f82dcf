"""The inverse map of a serial arm, tip pose -> joints, on single branches of its closed-form inverse."""

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from fzcli.errors import Problem, SpecError
from fzcli.learn.kinematic_map import Array, ErrorMap, Errors, Mask, Samples, collect, on_columns
from fzcli.learn.network import Coding
from fzcli.learn.train_spec import ArmInverseSpec
from fzcli.model.algebra import dot, gram
from fzcli.model.inverse.arm import arm_pose
from fzcli.model.inverse.numeric import solved
from fzcli.model.inverse.pose_error import pose_error
from fzcli.model.inverse.solve import InverseKinematics, build_inverse
from fzcli.model.inverse.windings import excess, nearest_windings
from fzcli.model.robot_model import build_model
from fzcli.spec.nearest import hint
from fzcli.spec.robot import Robot

_CELLS = 14  # of an error map a side
_DAMPING, _LEAST, _STRIDE = 1e-4, 1e-14, 1.0  # of the squared error; at least; longest step of a joint [rad]
_SLACK = 1e-9  # rad, m past a limit that counts as rounding


@dataclass(frozen=True)
class ArmInverse:
    """Poses come from postures drawn evenly within the ranges, those on other branches left out.

    A pose is nine numbers: position (3) [m] in the base frame, then the rotation's second and third column.
    Two columns have no jumps (Zhou et al. 2019); with the third, the hand's axis, the centre of the wrist is
    linear in the numbers.
    """

    inverse: InverseKinematics
    spec: ArmInverseSpec
    ranges: Array  # (n, 2) joint values that are drawn
    input_names: tuple[str, ...] = ("x [m]", "y [m]", "z [m]", "r12", "r22", "r32", "r13", "r23", "r33")
    input_coding: Coding = field(default="numbers")
    output_coding: Coding = field(default="sin_cos")

    @property
    def labels(self) -> tuple[str, ...]:
        """The branches that the run names."""
        return self.spec.branches

    @property
    def output_names(self) -> tuple[str, ...]:
        """The joints' names."""
        return tuple(f"{body.joint} [rad]" for body in self.inverse.arm.bodies)

    @cached_property
    def pose(self) -> ca.Function:
        """q (n) -> pose (9)."""
        q = ca.SX.sym("q", len(self.inverse.arm.joints))
        position, rotation, _ = arm_pose(self.inverse.arm, q)
        return ca.Function("pose", [q], [ca.vertcat(position, rotation[:, 1], rotation[:, 2])], ["q"], ["pose"])

    @cached_property
    def improve(self) -> ca.Function:
        """(q, pose) -> q after one damped Newton step; the limits are for the gate, a step held by one would stall.

        The damping is a share of the squared error, as in ``model.inverse.numeric``, but far less: the
        network's start is near, and the first steps must not be held back.
        """
        arm = self.inverse.arm
        q, pose = ca.SX.sym("q", len(arm.joints)), ca.SX.sym("pose", 9)
        position, rotation, jacobian = arm_pose(arm, q)
        error = pose_error(position, rotation, pose[:3], rotation_of(pose))
        square = gram(jacobian) + (_DAMPING * dot(error, error) + _LEAST) * ca.SX.eye(6)
        way = ca.mtimes(jacobian.T, solved(square, error))
        way *= ca.fmin(1.0, _STRIDE / ca.fmax(ca.mmax(ca.fabs(way)), _LEAST))
        return ca.Function("improve", [q, pose], [ca.cse(q + way)], ["q", "pose"], ["q_next"])

    @cached_property
    def residual(self) -> ca.Function:
        """(q, pose) -> distance [m] and angle [rad] of the tip from the pose."""
        q, pose = ca.SX.sym("q", len(self.inverse.arm.joints)), ca.SX.sym("pose", 9)
        position, rotation, _ = arm_pose(self.inverse.arm, q)
        error = pose_error(position, rotation, pose[:3], rotation_of(pose))
        sizes = ca.vertcat(ca.norm_2(error[:3]), ca.norm_2(error[3:]))
        return ca.Function("residual", [q, pose], [sizes], ["q", "pose"], ["residual"])

    def draw(self, rng: np.random.Generator, count: int, label: str) -> Samples | None:
        """Poses and joint values of a branch."""

        def some(n: int) -> tuple[Array, Array]:
            q = rng.uniform(self.ranges[:, 0], self.ranges[:, 1], (n, len(self.ranges)))
            away = self.spec.off_singular
            q = q[self._on_branch(q, label, np.array([away.shoulder, away.elbow, away.wrist]))]
            return on_columns(self.pose, q), q

        return collect(some, count)

    def _on_branch(self, q: Array, label: str, margins: Array) -> Mask:
        """(N,) whether postures lie on a branch, its measures not below the margins (3)."""
        form = self.inverse.form
        if form is None:
            raise SpecError("an arm without a closed form has no branches")
        number = form.labels.index(label)
        signs = np.array([-1.0 if number >> place & 1 else 1.0 for place in (2, 1, 0)])
        return np.asarray((signs * on_columns(form.signs, q) > margins).all(axis=1))

    def miss(self, outputs: Array, truth: Array, inputs: Array) -> Array:
        """(N, 2): distance [m] and angle [rad] of the tip at the outputs from the pose that was asked for."""
        return on_columns(self.residual, outputs, inputs)

    def belongs(self, outputs: Array, inputs: Array, label: str) -> Mask:
        """(N,) whether postures lie on a branch and within the joint limits."""
        found: Mask = np.asarray(np.isfinite(outputs).all(axis=1))
        q = np.where(found[:, None], outputs, 0.0)
        arm = self.inverse.arm
        inside = excess(arm, nearest_windings(arm, q, arm.middle)) <= _SLACK
        return np.asarray(found & inside & self._on_branch(q, label, np.zeros(3)))

    def error_map(self, label: str, samples: Samples, errors: Errors) -> ErrorMap:
        """Mean distance errors of the test's poses, by the tip's distance from the base's z axis and its height."""
        radius, height = np.hypot(samples.inputs[:, 0], samples.inputs[:, 1]), samples.inputs[:, 2]
        edges = [np.linspace(one.min(), one.max(), _CELLS + 1) for one in (radius, height)]
        count = np.histogram2d(radius, height, edges)[0].T
        maps = []
        for error in errors(samples.inputs, samples.outputs):
            finite = np.where(np.isfinite(error[:, 0]), error[:, 0], np.inf)
            total = np.histogram2d(radius, height, edges, weights=finite)[0].T
            maps.append(np.where(count > 0, total / np.maximum(count, 1), np.nan)[None])
        middles = [(edge[1:] + edge[:-1]) / 2 for edge in edges]
        axes = ("tip from z axis [m]", "tip height [m]")
        return ErrorMap(axes, ("mean over the cell's test poses",), middles[0], middles[1], maps[0], maps[1])


def rotation_of(pose: ca.SX) -> ca.SX:
    """The rotation (3, 3) of a pose (9)."""
    second, third = pose[3:6], pose[6:9]
    return ca.horzcat(ca.cross(second, third), second, third)


def pose_numbers(position: Array, rotation: Array) -> Array:
    """The nine numbers of a position (3) and rotation (3, 3)."""
    return np.concatenate([np.ravel(position), rotation[:, 1], rotation[:, 2]])


def arm_inverse(robot: Robot, spec: ArmInverseSpec) -> ArmInverse:
    """The inverse map of a robot's arm.

    Raises:
        SpecError: the arm has no closed form (and so no branches to tell apart), an unknown branch or joint,
            a joint without limits, or a range outside them.
    """
    inverse = build_inverse(build_model(robot), spec.tip)
    if inverse.form is None:
        text = f"the arm of {robot.name!r} has no closed-form inverse whose branches could be told apart: {inverse.why}"
        raise SpecError(Problem(text, field="robot"))
    for branch in spec.branches:
        if branch not in inverse.form.labels:
            near = hint(branch, inverse.form.labels, "there are")
            raise SpecError(Problem(f"no branch {branch!r}{near}", field="map.branches"))
    return ArmInverse(inverse, spec, _ranges(inverse, spec))


def _ranges(inverse: InverseKinematics, spec: ArmInverseSpec) -> Array:
    """(n, 2) the joints' limits, narrowed as the run says."""
    names = [body.joint for body in inverse.arm.bodies]
    ranges = inverse.arm.limits.copy()
    for name, (low, high) in spec.joints.items():
        if name not in names:
            raise SpecError(Problem(f"no joint {name!r}{hint(name, names, 'there are')}", field="map.joints"))
        least, most = ranges[names.index(name)]
        if not least - _SLACK <= low < high <= most + _SLACK:
            text = f"must rise within the joint's limits, {least:.6g} to {most:.6g}, got {low:.6g} to {high:.6g}"
            raise SpecError(Problem(text, field=f"map.joints.{name}"))
        ranges[names.index(name)] = low, high
    for name, limits in zip(names, ranges, strict=True):
        if not np.isfinite(limits).all():
            raise SpecError(Problem(f"joint {name!r} has no limits; give its range", field="map.joints"))
    return np.asarray(ranges)
