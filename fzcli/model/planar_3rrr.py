"""The planar 3-RRR: inverse and forward kinematics, Jacobians and singularities, also as CasADi Functions."""

from dataclasses import dataclass, field
from itertools import product
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.planar_forward import platform_poses
from fzcli.spec.planar import Planar3RRR

Array = NDArray[np.float64]
MODES: tuple[str, ...] = tuple("".join(signs) for signs in product("+-", repeat=3))
JOINTS = ("joint1", "joint2", "joint3")


@dataclass(frozen=True)
class Planar3RRRModel:
    """Kinematics of a planar 3-RRR robot; make one with ``build_planar_model``.

    A pose is x, y [m] of the platform's centre and its angle [rad], in the base's frame; ``theta`` (3)
    [rad] are the driven joints' angles from the base's x axis; a working mode is three signs b_i, such
    as "+-+": with d from base corner i to platform corner i, theta_i = angle(d) + b_i acos(...), so b_i
    says to which side elbow i bends. Two working modes meet where B_i = 0 (type I), two assemblies of
    one set of joint angles where det A = 0 (type II; Gosselin and Angeles 1990).
    """

    robot: Planar3RRR
    _functions: dict[str, ca.Function] = field(default_factory=dict, repr=False, compare=False)

    joint_names = JOINTS
    n = 3

    @property
    def limits(self) -> Array:
        """(3, 2) [rad] of the driven joints, infinite where the file states none."""
        low, high = self.robot.drives.position or (-np.inf, np.inf)
        return np.tile([low, high], (3, 1))

    @property
    def speeds(self) -> Array:
        """(3,) [rad/s] of the driven joints, infinite where the file states none."""
        return np.full(3, self.robot.drives.speed or np.inf)

    def spans(self, poses: Array) -> Array:
        """(N, 3) [m]: what each leg must span at poses (N, 3)."""
        return np.asarray(np.linalg.norm(self._reaches(poses), axis=-1))

    def reachable(self, poses: Array) -> NDArray[np.bool_]:
        """(N,) whether every leg can span what it must at poses (N, 3)."""
        legs, spans = self.robot.legs, self.spans(poses)
        return np.asarray(
            ((spans <= legs.proximal + legs.distal) & (spans >= abs(legs.proximal - legs.distal)) & (spans > 0)).all(-1)
        )

    def inverse(self, pose: Any) -> Array:
        """The joint angles [rad] of all eight working modes, (8, 3), rows in the order of MODES.

        Raises:
            SpecError: a leg does not reach: which, what it would have to span and what it can.
        """
        at = np.asarray(pose, dtype=float).reshape(1, 3)
        if not self.reachable(at)[0]:
            raise SpecError(Problem(self._out_of_reach(self.spans(at)[0]), field="pose"))
        return np.vstack([self.inverse_many(at, mode) for mode in MODES])

    def inverse_many(self, poses: Array, mode: str) -> Array:
        """The joint angles [rad] (N, 3) of one working mode at poses (N, 3), which must be ``reachable``."""
        legs, d = self.robot.legs, self._reaches(poses)
        span = np.linalg.norm(d, axis=-1)
        cosine = (legs.proximal**2 + span**2 - legs.distal**2) / (2 * legs.proximal * span)
        return np.asarray(np.arctan2(d[..., 1], d[..., 0]) + mode_signs(mode) * np.arccos(np.clip(cosine, -1, 1)))

    def forward(self, theta: Any) -> Array:
        """All real poses at joint angles (3) [rad], (k, 3), k = 0..6; see ``platform_poses``."""
        at, legs = np.asarray(theta, dtype=float).reshape(3), self.robot.legs
        elbows = np.array(self.robot.base.corners) + legs.proximal * np.column_stack([np.cos(at), np.sin(at)])
        return platform_poses(elbows, np.array(self.robot.platform.corners), legs.distal)

    def jacobians(self, pose: Any, theta: Any) -> Any:
        """A (3, 3) and the diagonal of B (3), with A pose' = B theta'; numbers or SX."""
        return self.function("jacobians")(pose, theta)

    def measures(self, poses: Array, theta: Array) -> Array:
        """(N, 4) the singularity measures (see ``function``) at N poses (N, 3) and joint angles (N, 3)."""
        found = self.function("singularity")(ca.DM(np.transpose(poses)), ca.DM(np.transpose(theta)))
        rows: Array = np.array(found, dtype=float)
        return np.asarray(rows.T)

    def labels(self, poses: Array, theta: Array) -> list[tuple[str, int]]:
        """The working mode and the sign of det A at each of N poses (N, 3) and joint angles (N, 3)."""
        found = self.measures(poses, theta)
        return [("".join("-+"[int(bend < 0)] for bend in row[:3]), -1 if row[3] < 0 else 1) for row in found]

    def function(self, name: str) -> ca.Function:
        """A named Function of pose (3) and theta (3), for use inside other expressions.

        "inverse": (pose, mode signs) -> theta, NaN where a leg does not reach. "jacobians": A and b.
        "closure": (3) [m], each distal link's excess length, to first order. "singularity": (4), free of
        units: type I, the sine of each leg's elbow angle, of the sign of B_i, then type II, det A of unit
        directions with the platform's radius as unit of length. "points": elbows and platform corners,
        each (2, 3) [m]. "newton": the pose after one step of Newton's method on the closure.
        """
        if name not in self._functions:
            self._functions[name] = _build(self, name)
        return self._functions[name]

    def _reaches(self, poses: Array) -> Array:
        """(N, 3, 2) [m]: from each base corner to its platform corner."""
        at = np.asarray(poses, dtype=float)
        corners, feet = np.array(self.robot.platform.corners), np.array(self.robot.base.corners)
        c, s = np.cos(at[:, 2, None]), np.sin(at[:, 2, None])
        x = at[:, 0, None] + c * corners[:, 0] - s * corners[:, 1]
        y = at[:, 1, None] + s * corners[:, 0] + c * corners[:, 1]
        return np.asarray(np.stack([x, y], axis=-1) - feet)

    def _out_of_reach(self, spans: Array) -> str:
        legs = self.robot.legs
        low, high = abs(legs.proximal - legs.distal), legs.proximal + legs.distal
        leg = int(np.argmax(np.maximum(spans - high, low - spans)))
        return f"leg {leg + 1} would have to span {spans[leg]:.6g} m; it spans {low:g} to {high:g} m"


def build_planar_model(robot: Planar3RRR) -> Planar3RRRModel:
    """The model of a planar 3-RRR; its Functions are made when first asked for."""
    return Planar3RRRModel(robot)


def mode_signs(mode: str) -> Array:
    """(3) signs b_i of a working mode. Raises SpecError for a name that is none."""
    if mode not in MODES:
        raise SpecError(Problem(f"no working mode {mode!r}; there are {', '.join(MODES)}", field="mode"))
    return np.array([1.0 if sign == "+" else -1.0 for sign in mode])


def _build(model: Planar3RRRModel, name: str) -> ca.Function:
    """Every Function of the class, from one set of expressions."""
    robot, legs = model.robot, model.robot.legs
    pose, theta, mode = ca.SX.sym("pose", 3), ca.SX.sym("theta", 3), ca.SX.sym("mode", 3)
    c, s = ca.cos(pose[2]), ca.sin(pose[2])
    arms, elbows, angles = [], [], []
    for i, (foot, corner) in enumerate(zip(robot.base.corners, robot.platform.corners, strict=True)):
        arms.append(ca.vertcat(c * corner[0] - s * corner[1], s * corner[0] + c * corner[1]))
        elbows.append(
            ca.vertcat(foot[0] + legs.proximal * ca.cos(theta[i]), foot[1] + legs.proximal * ca.sin(theta[i]))
        )
        d = pose[:2] + arms[i] - ca.vertcat(*foot)
        span = ca.sqrt(d[0] ** 2 + d[1] ** 2)
        cosine = (legs.proximal**2 + span**2 - legs.distal**2) / (2 * legs.proximal * span)
        angles.append(ca.atan2(d[1], d[0]) + mode[i] * ca.acos(cosine))
    if name == "inverse":
        return ca.Function(name, [pose, mode], [ca.vertcat(*angles)], ["pose", "mode"], ["theta"])
    rods = [pose[:2] + arm - elbow for arm, elbow in zip(arms, elbows, strict=True)]
    A = ca.vertcat(*(ca.horzcat(u.T, u[1] * r[0] - u[0] * r[1]) for u, r in zip(rods, arms, strict=True)))
    bends = ca.vertcat(*(u[1] * ca.cos(theta[i]) - u[0] * ca.sin(theta[i]) for i, u in enumerate(rods)))
    squares = ca.vertcat(*(u[0] ** 2 + u[1] ** 2 for u in rods))
    closure = (squares - legs.distal**2) / (2 * legs.distal)
    unit = legs.distal**3 * robot.platform.radius
    outputs: dict[str, dict[str, ca.SX]] = {
        "jacobians": {"A": A, "b": legs.proximal * bends},
        "closure": {"closure": closure},
        "singularity": {"measures": ca.vertcat(bends / legs.distal, _det3(A) / unit)},
        "points": {"elbows": ca.horzcat(*elbows), "corners": ca.horzcat(*(pose[:2] + arm for arm in arms))},
        "newton": {"improved": pose - _solve3(A, legs.distal * closure)},
    }
    if name not in outputs:
        raise SpecError(Problem(f"no function {name!r}; there are inverse, {', '.join(outputs)}"))
    found = outputs[name]
    return ca.Function(name, [pose, theta], ca.cse(list(found.values())), ["pose", "theta"], list(found))


def _det3(A: ca.SX) -> ca.SX:
    return ca.dot(A[0, :].T, ca.cross(A[1, :].T, A[2, :].T))


def _solve3(A: ca.SX, b: ca.SX) -> ca.SX:
    """A^-1 b of a 3 x 3 matrix, by the adjugate: no pivoting, so it stays one expression."""
    rows = [A[i, :].T for i in range(3)]
    columns = [ca.cross(rows[1], rows[2]), ca.cross(rows[2], rows[0]), ca.cross(rows[0], rows[1])]
    total = columns[0] * b[0] + columns[1] * b[1] + columns[2] * b[2]
    return total / _det3(A)
