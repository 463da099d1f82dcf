"""Inverse kinematics: exact where the arm's geometry allows it, by search for any other; one method a file."""

from fzcli.model.inverse.solve import InverseKinematics, Solution, build_inverse, inverse_kinematics

__all__ = ["InverseKinematics", "Solution", "build_inverse", "inverse_kinematics"]
