"""From a robot spec to a frozen RobotModel: kinematics, momentum, generalized Jacobian, attitude."""

from fzcli.model.robot_model import RobotModel, build_model

__all__ = ["RobotModel", "build_model"]
