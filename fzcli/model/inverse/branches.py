"""What the closed forms of six-hinge arms share: eight branches, their labels, and the wrist and elbow parts."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from fzcli.model.algebra import cross, dot
from fzcli.model.inverse.arm import Arm, arm_pose
from fzcli.model.inverse.hinges import constant, cosine_angles
from fzcli.model.inverse.pose_error import turn_between

Array = NDArray[np.float64]
ALMOST = 1e-6  # m or sine: geometry this close to a special one counts as it; a Newton step removes the rest
SINGULAR = 1e-10  # sine of the wrist's bend below which its two outer axes are one
Signs = tuple[int, int, int]
SIGNS: tuple[Signs, ...] = tuple(
    product((1, -1), (1, -1), (1, -1))
)  # shoulder, elbow, wrist, in the order of the branches


@dataclass(frozen=True)
class ClosedForm:
    """The exact inverse of a six-hinge arm whose eight postures have names.

    ``function``: position (3) [m] and rotation (3, 3) of the tip, base axes, and ``near`` (6) [rad] -> q (6, 8)
    [rad] within (-pi, pi] a column a branch, and error (2, 8): the distance [m] and angle [rad] at which that
    posture misses the pose. An error that is not small means that the branch does not reach it: the posture is
    then that of a neighbouring wrist position. At a wrist singularity the joint that may be chosen is as in ``near``.
    Also bend (1, 8), of the wrist, 0 at its singularity.
    ``signs``: q (6) -> (3) whose signs tell shoulder, elbow and wrist. ``labels``: names of the branches.
    """

    kind: str
    function: ca.Function
    signs: ca.Function
    labels: tuple[str, ...]

    def label(self, q: Array) -> str:
        """The branch of a posture q (6) [rad]; on the border of two, either."""
        positive = np.array(self.signs(q)).ravel() > 0
        return self.labels[sum(int(not up) << place for up, place in zip(positive, (2, 1, 0), strict=True))]


def closed_form(
    kind: str,
    arm: Arm,
    branch: Callable[[ca.SX, ca.SX, ca.SX, Signs], ca.SX],
    signs: Callable[[ca.SX], ca.SX],
    words: Callable[[Signs], str],
) -> ClosedForm:
    """From one branch's formula (position, rotation, near, signs of shoulder, elbow, wrist) -> q (6) to all eight."""
    position, rotation = ca.SX.sym("position", 3), ca.SX.sym("rotation", 3, 3)
    near, q = ca.SX.sym("near", 6), ca.SX.sym("q", 6)
    given = [position, rotation, near]
    postures = ca.horzcat(*(wrapped(branch(position, rotation, near, choice)) for choice in SIGNS))
    reached, turned, _ = arm_pose(arm, q)
    away, (_, angle) = position - reached, turn_between(turned, rotation)
    sizes = ca.vertcat(ca.sqrt(dot(away, away)), angle)
    miss = ca.Function("miss", [q, position, rotation], [sizes])
    missed = ca.horzcat(*(miss(postures[:, k], position, rotation) for k in range(len(SIGNS))))
    bends = ca.horzcat(*(signs(postures[:, k])[2] for k in range(len(SIGNS))))
    outputs = ca.cse([ca.densify(postures), ca.densify(missed), ca.densify(bends)])
    names = ["q", "error", "bend"]
    function = ca.Function(f"{kind}_inverse", given, outputs, ["position", "rotation", "near"], names)
    return ClosedForm(
        kind=kind,
        function=function,
        signs=ca.Function("branch_signs", [q], [ca.densify(signs(q))], ["q"], ["signs"]),
        labels=tuple(words(choice) for choice in SIGNS),
    )


def wrapped(angles: ca.SX) -> ca.SX:
    """Angles [rad] within [-pi, pi]."""
    return angles - 2 * ca.pi * ca.floor(angles / (2 * ca.pi) + 0.5)


def wrist_angles(first: Array, middle: Array, last: ca.SX, rest: Array) -> tuple[ca.SX, ca.SX]:
    """Both angles [rad] of the middle hinge of three that bring the last axis to ``last`` (3).

    The three hinges' axes at rest are ``first``, ``middle`` and ``rest`` (3 each); ``last`` is seen from what
    carries the first. Where both outer axes are square to the middle one, the sine is that of
    the angle between them, which stays exact at the wrist's singularity.
    """
    u = constant(first)
    along = float(first @ middle) * float(middle @ rest)
    a, b = float(first @ rest) - along, float(first @ np.cross(middle, rest))
    square = max(abs(float(first @ middle)), abs(float(middle @ rest))) < 1e-12
    across = cross(u, last)
    return cosine_angles(ca.SX(a), ca.SX(b), dot(u, last) - along, ca.sqrt(dot(across, across)) if square else None)


def elbow_angles(upper: Array, lower: Array, normal: Array, span2: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Both elbow angles [rad] about ``normal`` (3) at which two links square to it span sqrt(span2) [m].

    ``upper`` and ``lower`` (3) [m]: shoulder to elbow and elbow to wrist at rest.
    """
    a, b = float(upper @ lower), float(upper @ np.cross(normal, lower))
    ends = float(upper @ upper) + float(lower @ lower)
    return cosine_angles(ca.SX(a), ca.SX(b), 0.5 * (span2 - ends))


def chosen(pair: tuple[ca.SX, ca.SX], sign: int) -> ca.SX:
    """The first of two for +1, the second for -1."""
    return pair[0] if sign > 0 else pair[1]


def flat(v: Array, normal: Array) -> Array:
    """The part of v (3) square to a unit normal (3)."""
    return np.asarray(v - normal * (normal @ v))
