"""The frozen model of a robot: every quantity a named CasADi Function of joints and base attitude."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import cross, rotate, symmetric_inverse
from fzcli.model.attitude import rotation_matrix
from fzcli.model.chain import Chain, build_chain
from fzcli.model.composite import (
    BaseFrame,
    base_rate_columns,
    build_base_frame,
    centroidal_columns,
    joint_mass_matrix,
)
from fzcli.model.dynamics import DYNAMICS
from fzcli.model.forward_dynamics import FORWARD
from fzcli.model.tree import Tree, build_tree
from fzcli.spec.robot import Robot


@dataclass(frozen=True)
class RobotModel:
    """Kinematics and momentum of a tree of links on a floating or fixed base.

    Methods take numbers (they give DM) or SX (they give SX): q (n) [rad, m], base_quat (4) w x y z
    body to world, qd (n), base_twist (6) velocity of the base frame's origin [m/s] then angular
    velocity [rad/s], world axes. ``tip`` names a tip; the first is the default. On a fixed base the
    base's inertia is infinite (W = 0) and "relative to the CoM" reads "relative to the base frame".
    Source: Umetani and Yoshida 1989, in the 3x3 form about the system's CoM.
    """

    robot: Robot
    tree: Tree
    joint_names: tuple[str, ...]
    tips: tuple[str, ...]
    _functions: dict[tuple[str, str], ca.Function] = field(default_factory=dict, repr=False, compare=False)
    _frames: list[tuple[ca.SX, BaseFrame]] = field(default_factory=list, repr=False, compare=False)

    @property
    def n(self) -> int:
        """Number of active joints."""
        return len(self.joint_names)

    @property
    def floating(self) -> bool:
        """Whether the base is free to move."""
        return self.tree.floating

    @property
    def mass(self) -> float:
        """Mass of the whole system [kg]."""
        return self.tree.mass

    def forward_kinematics(self, q: Any, base_quat: Any, tip: str | None = None) -> Any:
        """Tip pose relative to the system's CoM, world axes: position (3) [m], rotation (3, 3)."""
        return self.function("forward_kinematics", tip)(q, base_quat)

    def generalized_jacobian(self, q: Any, base_quat: Any, tip: str | None = None) -> Any:
        """J_g (6, n), world axes, linear first: tip twist relative to the CoM at zero momentum."""
        return self.function("generalized_jacobian", tip)(q, base_quat)

    def base_rate_map(self, q: Any, base_quat: Any) -> Any:
        """W (3, n), world axes: base angular velocity = W qd at zero momentum."""
        return self.function("base_rate_map")(q, base_quat)

    def momentum(self, q: Any, base_quat: Any, qd: Any, base_twist: Any) -> Any:
        """Momentum (6), world axes: linear [N s], then angular about the CoM [N m s]."""
        return self.function("momentum")(q, base_quat, qd, base_twist)

    def momentum_map(self, q: Any, base_quat: Any) -> Any:
        """H_b (6, 6) and H_bm (6, n), world axes: momentum = H_b base_twist + H_bm qd."""
        return self.function("momentum_map")(q, base_quat)

    def generalized_inertia(self, q: Any) -> Any:
        """M_q - H_bm^T H_b^-1 H_bm (n, n): the joints' inertia on the free base; M_q on a fixed one."""
        return self.function("generalized_inertia")(q)

    def com(self, q: Any, base_quat: Any) -> Any:
        """The system's CoM relative to the base frame's origin, world axes, (3) [m]."""
        return self.function("com")(q, base_quat)

    def chain(self, tip: str | None = None) -> Chain:
        """The chain points of a tip's serial arm. Raises SpecError where the arm has none."""
        return build_chain(self.tree, self.tips[0] if tip is None else tip)

    def carriers(self, tip: str | None = None) -> list[int]:
        """The joints that carry a tip, from the base on."""
        return self.tree.ancestors(self.tree.tips[self.tips[0] if tip is None else tip].body)

    def function(self, name: str, tip: str | None = None) -> ca.Function:
        """The named Function behind a method of this class, for use inside other expressions.

        Also "body": all that depends on q alone, in base axes (see `_body`); "tip": the tip pose and
        generalized Jacobian in base axes; "chain": points and axes of `chain`; "arm": origins
        of base frame, carrying joints, and tip, from the base frame's; and the tables `DYNAMICS` and `FORWARD`.
        Raises SpecError for an unknown tip.
        """
        tip = self.tips[0] if tip is None else tip
        if tip not in self.tips:
            raise SpecError(Problem(f"no tip {tip!r}; the robot has {', '.join(self.tips)}", field="tip"))
        key = (name, tip)
        if key not in self._functions:
            self._functions[key] = _BUILDERS[name](self, tip)
        return self._functions[key]


def build_model(robot: Robot) -> RobotModel:
    """Build the model of a robot; its Functions are made when first asked for."""
    tree = build_tree(robot)
    if not tree.bodies:
        raise SpecError(Problem("the robot has no active joint", field="links"))
    return RobotModel(robot, tree, tuple(body.joint for body in tree.bodies), tuple(robot.tips))


def _frame(model: RobotModel) -> tuple[ca.SX, BaseFrame]:
    """The symbols of the joints and all base-frame quantities at them, made once a model."""
    if not model._frames:
        q = ca.SX.sym("q", model.n)
        model._frames.append((q, build_base_frame(model.tree, q)))
    return model._frames[0]


def _body(model: RobotModel, tip: str) -> ca.Function:
    """q -> com (3), inertia (3, 3) about it, com_jacobian, momentum and base_rate (3, n); base axes."""
    q, frame = _frame(model)
    com_jacobian = ca.horzcat(*(column.linear * (1 / model.mass) for column in frame.columns))
    rate = base_rate_columns(frame) if model.floating else ca.SX.zeros(3, model.n)
    outputs = [frame.com, frame.inertia, com_jacobian, centroidal_columns(frame), rate]
    names = ["com", "inertia", "com_jacobian", "momentum", "base_rate"]
    return ca.Function("body", [q], outputs, ["q"], names)


def _tip(model: RobotModel, tip: str) -> ca.Function:
    """q -> position (3) relative to the CoM, rotation (3, 3), generalized jacobian (6, n); base axes."""
    q, frame = _frame(model)
    place = model.tree.tips[tip]
    rotation = frame.rotations[place.body] if place.body >= 0 else ca.SX.eye(3)
    origin = frame.origins[place.body] if place.body >= 0 else ca.SX.zeros(3)
    point = origin + rotate(rotation, ca.SX(ca.DM(place.place.translation)))
    rate = base_rate_columns(frame) if model.floating else ca.SX.zeros(3, model.n)
    position = point - frame.com if model.floating else point
    carried = set(model.tree.ancestors(place.body))
    columns = []
    for i, column in enumerate(frame.columns):
        linear, angular = ca.SX.zeros(3), ca.SX.zeros(3)
        if i in carried and model.tree.bodies[i].prismatic:
            linear = column.axis
        elif i in carried:
            linear, angular = cross(column.axis, point - column.origin), column.axis
        if model.floating:
            linear = linear - column.linear * (1 / model.mass) + cross(rate[:, i], position)
            angular = angular + rate[:, i]
        columns.append(ca.vertcat(linear, angular))
    turned = ca.mtimes(rotation, ca.SX(ca.DM(place.place.rotation)))
    outputs = [position, turned, ca.horzcat(*columns)]
    return ca.Function("tip", [q], outputs, ["q"], ["position", "rotation", "jacobian"])


def _chain(model: RobotModel, tip: str) -> ca.Function:
    """q -> chain points (3, m+1) relative to the CoM and hinge axes (3, m); base axes."""
    q, frame = _frame(model)
    place = model.tree.tips[tip]
    end = frame.origins[place.body] + rotate(frame.rotations[place.body], ca.SX(ca.DM(place.place.translation)))
    points, axes = model.chain(tip).points(frame, end)
    if model.floating:
        points = points - ca.repmat(frame.com, 1, points.shape[1])
    outputs = [ca.densify(points), ca.densify(axes)]
    return ca.Function("chain", [q], outputs, ["q"], ["points", "axes"])


def _arm(model: RobotModel, tip: str) -> ca.Function:
    """q -> the arm's polyline (3, k+2) from the base frame's origin through its k joints to the tip; base axes."""
    q, frame = _frame(model)
    place = model.tree.tips[tip]
    end = ca.SX(ca.DM(place.place.translation))
    if place.body >= 0:
        end = frame.origins[place.body] + rotate(frame.rotations[place.body], end)
    points = ca.horzcat(ca.SX.zeros(3), *(frame.origins[j] for j in model.carriers(tip)), end)
    return ca.Function("arm", [q], [ca.densify(points)], ["q"], ["points"])


def _forward_kinematics(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    position, rotation, _ = model.function("tip", tip)(q)
    R = rotation_matrix(quat)
    return _named(
        "forward_kinematics",
        {"q": q, "base_quat": quat},
        {"position": rotate(R, position), "rotation": ca.mtimes(R, rotation)},
    )


def _generalized_jacobian(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    _, _, jacobian = model.function("tip", tip)(q)
    R = rotation_matrix(quat)
    turned = ca.vertcat(ca.mtimes(R, jacobian[:3, :]), ca.mtimes(R, jacobian[3:, :]))
    return _named("generalized_jacobian", {"q": q, "base_quat": quat}, {"jacobian": turned})


def _base_rate_map(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    rate = model.function("body")(q)[4]
    return _named(
        "base_rate_map", {"q": q, "base_quat": quat}, {"W": ca.mtimes(rotation_matrix(quat), rate)}
    )


def _momentum_map(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    com, inertia, com_jacobian, momentum, _ = model.function("body")(q)
    R = rotation_matrix(quat)
    arm = ca.skew(ca.mtimes(R, com))
    linear = ca.horzcat(model.mass * ca.SX.eye(3), -model.mass * arm)
    angular = ca.horzcat(ca.SX.zeros(3, 3), ca.mtimes(ca.mtimes(R, inertia), R.T))
    joints = ca.vertcat(model.mass * ca.mtimes(R, com_jacobian), ca.mtimes(R, momentum))
    return _named(
        "momentum_map",
        {"q": q, "base_quat": quat},
        {"H_b": ca.densify(ca.vertcat(linear, angular)), "H_bm": joints},
    )


def _momentum(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    qd, twist = ca.SX.sym("qd", model.n), ca.SX.sym("base_twist", 6)
    base, joints = model.function("momentum_map")(q, quat)
    total = ca.mtimes(base, twist) + ca.mtimes(joints, qd)
    inputs = {"q": q, "base_quat": quat, "qd": qd, "base_twist": twist}
    return _named("momentum", inputs, {"momentum": total})


def _generalized_inertia(model: RobotModel, tip: str) -> ca.Function:
    q, frame = _frame(model)
    M = joint_mass_matrix(model.tree, frame)
    if model.floating:
        linear = ca.horzcat(*(column.linear for column in frame.columns))
        H = centroidal_columns(frame)
        M = M - ca.mtimes(linear.T, linear) / model.mass
        M = M - ca.mtimes(ca.mtimes(H.T, symmetric_inverse(frame.inertia)), H)
    return _named("generalized_inertia", {"q": q}, {"M": M})


def _com(model: RobotModel, tip: str) -> ca.Function:
    q, quat = ca.SX.sym("q", model.n), ca.SX.sym("base_quat", 4)
    com = model.function("body")(q)[0]
    return _named("com", {"q": q, "base_quat": quat}, {"com": rotate(rotation_matrix(quat), com)})


def _named(name: str, inputs: dict[str, ca.SX], outputs: dict[str, ca.SX]) -> ca.Function:
    results = ca.cse([ca.densify(value) for value in outputs.values()])
    return ca.Function(name, list(inputs.values()), results, list(inputs), list(outputs))


_BUILDERS = {
    "body": _body,
    "tip": _tip,
    "chain": _chain,
    "arm": _arm,
    "forward_kinematics": _forward_kinematics,
    "generalized_jacobian": _generalized_jacobian,
    "base_rate_map": _base_rate_map,
    "momentum_map": _momentum_map,
    "momentum": _momentum,
    "generalized_inertia": _generalized_inertia,
    "com": _com,
    **DYNAMICS,
    **FORWARD,
}
