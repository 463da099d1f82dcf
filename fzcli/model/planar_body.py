"""The bodies of a planar 3-RRR as an open tree of links, so that distances and bounds of trees serve it too.

Three legs of two hinges each and a platform that slides and turns: nine joints, of which the closed chain allows
three. Which nine belong together, `PlanarBody.state` says.
"""

from dataclasses import dataclass

import casadi as ca

from fzcli.errors import Problem, SpecError
from fzcli.model.algebra import gram, symmetric_inverse
from fzcli.model.planar_3rrr import Planar3RRRModel
from fzcli.model.robot_model import RobotModel, build_model
from fzcli.spec.planar import Planar3RRR
from fzcli.spec.robot import Base, Frame, Joint, JointType, Link, Robot, Tip, Vector3
from fzcli.spec.shapes import CapsuleShape, Shape

PIECES = 24  # of a straight way in the joints, a Newton step after each
ENDING = 4  # Newton steps at its end
DAMPING = 1e-9  # of A A^T, rows and columns free of units: keeps steps finite where det A vanishes
STRIDE = 0.5  # longest Newton step, in platform radii and rad
NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class PlanarBody:
    """A planar 3-RRR with its bodies.

    ``tree``: the open tree, joints theta_i and elbow_i leg by leg, then x, y and phi of the platform.
    ``state``: (pose (3), theta (3)) -> its nine joints. ``assembled``: (pose (3), theta (3), goal (3)) -> the pose
    that the platform is led to while the driven joints go straight from theta to goal: on its branch where that
    has no singularity, else some pose near one. ``by_joints``: (pose, theta) -> the pose's derivative by theta
    (3, 3), damped where det A vanishes.
    """

    model: Planar3RRRModel
    tree: RobotModel
    state: ca.Function
    assembled: ca.Function
    by_joints: ca.Function


def build_body(model: Planar3RRRModel) -> PlanarBody:
    """The bodies of a planar 3-RRR. Raises SpecError where its links have no width to judge collisions by."""
    if model.robot.legs.radius <= 0:
        text = f"robot '{model.robot.name}' has no solids to judge collisions by; give its legs a radius"
        raise SpecError(Problem(text, field="robot"))
    state, assembled, by_joints = _state(model), _assembled(model), _by_joints(model)
    return PlanarBody(model, build_model(open_tree(model.robot)), state, assembled, by_joints)


def open_tree(robot: Planar3RRR) -> Robot:
    """The links of a planar 3-RRR as a tree in the plane z = 0, without mass; legs and platform sides are capsules.

    Tips: where each leg ends, "leg1" to "leg3", and the platform's centre, "platform".
    """
    legs, links = robot.legs, []
    for i, foot in enumerate(robot.base.corners, start=1):
        upper, lower = f"leg{i}_proximal", f"leg{i}_distal"
        links.append(_link(upper, "base", (*foot, 0.0), f"theta{i}", (_side((0, 0), (legs.proximal, 0), legs.radius),)))
        solid = _side((0, 0), (legs.distal, 0), legs.radius)
        links.append(_link(lower, upper, (legs.proximal, 0.0, 0.0), f"elbow{i}", (solid,)))
    corners = robot.platform.corners
    sides = tuple(_side(corners[i], corners[(i + 1) % 3], legs.radius) for i in range(3))
    links.append(_link("platform_x", "base", (0.0, 0.0, 0.0), "x", axis=(1.0, 0.0, 0.0), type="prismatic"))
    links.append(_link("platform_y", "platform_x", (0.0, 0.0, 0.0), "y", axis=(0.0, 1.0, 0.0), type="prismatic"))
    links.append(_link("platform", "platform_y", (0.0, 0.0, 0.0), "phi", sides))
    tips = {f"leg{i}": Tip(link=f"leg{i}_distal", xyz=(legs.distal, 0.0, 0.0)) for i in (1, 2, 3)}
    base = Base(floating=False, mass=1.0, inertia=NOTHING)  # a mass, so that there is a centre of mass
    return Robot(name=str(robot.name), base=base, links=tuple(links), tips={**tips, "platform": Tip(link="platform")})


def _link(
    name: str,
    parent: str,
    at: Vector3,
    joint: str,
    collision: tuple[Shape, ...] = (),
    axis: Vector3 = (0.0, 0.0, 1.0),
    type: JointType = "revolute",
) -> Link:
    own = Joint(name=joint, type=type, axis=axis)
    return Link(name=name, parent=parent, at=Frame(xyz=at), joint=own, mass=0.0, inertia=NOTHING, collision=collision)


def _side(start: tuple[float, float], end: tuple[float, float], radius: float) -> Shape:
    return Shape(capsule=CapsuleShape(start=(*start, 0.0), end=(*end, 0.0), radius=radius))


def _state(model: Planar3RRRModel) -> ca.Function:
    pose, theta = ca.SX.sym("pose", 3), ca.SX.sym("theta", 3)
    elbows, corners = model.function("points")(pose, theta)
    joints = []
    for i in range(3):
        rod = corners[:, i] - elbows[:, i]
        joints += [theta[i], ca.atan2(rod[1], rod[0]) - theta[i]]
    return ca.Function("state", [pose, theta], [ca.vertcat(*joints, pose)], ["pose", "theta"], ["joints"])


def _assembled(model: Planar3RRRModel) -> ca.Function:
    pose, theta = ca.SX.sym("pose", 3), ca.SX.sym("theta", 3)
    step = ca.Function("step", [pose, theta], [_damped_step(model, pose, theta)])
    start, begin, end = (ca.MX.sym(name, 3) for name in ("pose", "theta", "goal"))
    now = start
    for k in range(PIECES):
        now = step(now, begin + (k + 1) / PIECES * (end - begin))
    for _ in range(ENDING):
        now = step(now, end)
    return ca.Function("assembled", [start, begin, end], [now], ["pose", "theta", "goal"], ["assembled"])


def _damped_step(model: Planar3RRRModel, pose: ca.SX, theta: ca.SX) -> ca.SX:
    """The pose after a damped Newton step on the closure, no longer than STRIDE."""
    unit = model.robot.platform.radius
    way = ca.mtimes(_inverse(model, pose, theta), model.function("closure")(pose, theta) / unit)
    size = ca.sqrt(ca.sumsqr(way))
    way = way * ca.fmin(1.0, STRIDE / ca.fmax(size, 1e-12))
    return pose - ca.vertcat(unit * way[0], unit * way[1], way[2])


def _inverse(model: Planar3RRRModel, pose: ca.SX, theta: ca.SX) -> ca.SX:
    """The damped inverse of A for unit directions and the platform's radius as unit of length, (3, 3)."""
    A, _ = model.function("jacobians")(pose, theta)
    unit = ca.diag(ca.SX([1.0, 1.0, 1.0 / model.robot.platform.radius]))
    A = ca.mtimes(A / model.robot.legs.distal, unit)
    square = gram(A) + DAMPING * ca.SX.eye(3)
    return ca.mtimes(A.T, symmetric_inverse(square))


def _by_joints(model: Planar3RRRModel) -> ca.Function:
    pose, theta = ca.SX.sym("pose", 3), ca.SX.sym("theta", 3)
    _, b = model.function("jacobians")(pose, theta)
    unit = model.robot.platform.radius
    way = ca.mtimes(_inverse(model, pose, theta), ca.diag(b / (model.robot.legs.distal * unit)))
    found = ca.mtimes(ca.diag(ca.SX([unit, unit, 1.0])), way)
    return ca.Function("by_joints", [pose, theta], [ca.densify(found)], ["pose", "theta"], ["by_joints"])

