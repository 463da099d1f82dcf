"""The base's turn over a straight piece of joint path, to fourth order: two Gauss nodes, Magnus expansion."""

import math

import casadi as ca

from fzcli.model.algebra import cross
from fzcli.model.attitude import attitude_step
from fzcli.model.robot_model import RobotModel

NODES = (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0)
COMMUTATOR = math.sqrt(3.0) / 12.0


def magnus(a: ca.SX, b: ca.SX) -> ca.SX:
    """The rotation vector (3) [rad], body axes, of body rates a and b at the two nodes, each times the period.

    (a + b)/2 + sqrt(3)/12 a x b (Iserles and Norsett 1999, for a rate in body axes).
    """
    return 0.5 * (a + b) + COMMUTATOR * cross(a, b)


def base_turn(model: RobotModel, q: ca.SX, way: ca.SX) -> ca.SX:
    """The base's turn (3) [rad], base axes, while the joints go from q (n) by ``way`` (n) at zero momentum."""
    body = model.function("body")
    a, b = (ca.mtimes(body(q + node * way)[4], way) for node in NODES)
    return magnus(a, b)


def path_piece(model: RobotModel) -> ca.Function:
    """(base_quat (4), q (n), way (n)) -> base_quat, q after a straight piece at zero momentum."""
    quat, q, way = ca.SX.sym("base_quat", 4), ca.SX.sym("q", model.n), ca.SX.sym("way", model.n)
    after = attitude_step(quat, base_turn(model, q, way)) if model.floating else quat
    outputs = ca.cse([after, q + way])
    return ca.Function("path_piece", [quat, q, way], outputs, ["base_quat", "q", "way"], ["quat_next", "q_next"])
