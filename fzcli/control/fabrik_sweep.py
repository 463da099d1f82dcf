"""One forward and one backward stage of the modified FABRIK of Dong et al. 2022, as expressions.

The paper's equations are missing from its text; this reading is reconstructed from its figures and words.
Links, axes and targets are in the base's axes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from fzcli.model.algebra import cross, dot
from fzcli.model.chain import Chain

Followed = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Links:
    """An arm as vectors: root p_1 (3), links p_{i+1} - p_i and hinge axes z_{i-1}, m each (3)."""

    root: ca.SX
    links: list[ca.SX]
    axes: list[ca.SX]

    @staticmethod
    def of(points: ca.SX, axes: ca.SX) -> "Links":
        """From points (3, m+1) and axes (3, m)."""
        m = axes.shape[1]
        return Links(
            points[:, 0], [points[:, i + 1] - points[:, i] for i in range(m)], [axes[:, i] for i in range(m)]
        )

    @property
    def vector(self) -> ca.SX:
        """As one column, (3 + 6m)."""
        return ca.vertcat(self.root, *self.links, *self.axes)

    @staticmethod
    def from_vector(vector: ca.SX, m: int) -> "Links":
        """Inverse of ``vector``."""
        parts = [vector[3 * i : 3 * i + 3] for i in range(1 + 2 * m)]
        return Links(parts[0], parts[1 : 1 + m], parts[1 + m :])

    @property
    def points(self) -> list[ca.SX]:
        """p_1..p_{m+1}."""
        found = [self.root]
        for link in self.links:
            found.append(found[-1] + link)
        return found


@dataclass(frozen=True)
class SweepRule:
    """How a sweep is made. ``followed`` (m): the points, as rows 0..m, that each hinge turns towards, K_i.

    ``virtual_tip`` [m]: the last link is given this length where a direction is wanted, so that the
    direction weighs more; 0 leaves it. ``square``: the link before the last is laid square to the direction.
    """

    chain: Chain
    directed: bool
    followed: Followed
    virtual_tip: float
    square: bool


def followed_points(literal: bool, m: int, directed: bool) -> Followed:
    """K_i as rows of the points: {i+1} in the paper; {i+1, m, m+1}, without a direction {i+1, m+1}, here."""
    extra = () if literal else (m - 1, m) if directed else (m,)
    return tuple(tuple(sorted({i, *(k for k in extra if k >= i)})) for i in range(1, m + 1))


def unit(v: ca.SX) -> ca.SX:
    """v over its length; a zero vector stays zero, so that a link without direction has no say."""
    return v * (1 / ca.sqrt(ca.fmax(dot(v, v), 1e-300)))


def forward_stage(rule: SweepRule, points: list[ca.SX], target: ca.SX, direction: ca.SX) -> list[ca.SX]:
    """p' from the tip down: p'_i = p'_{i+1} + l_i unit(p_i - p'_{i+1}); with a direction p'_m = X - l_m d."""
    m = len(points) - 1
    reached = [target]
    for i in range(m - 1, -1, -1):
        length = float(rule.chain.lengths[i])
        if rule.directed and i == m - 1:
            reached.insert(0, target - length * direction)
            continue
        away = points[i] - reached[0]
        if rule.directed and rule.square and i == m - 2:
            away = away - direction * dot(away, direction)
        reached.insert(0, reached[0] + length * unit(away) if length else reached[0])
    return reached


def turned(vector: ca.SX, axis: ca.SX, cosine: ca.SX, sine: ca.SX, square: bool = False) -> ca.SX:
    """A vector turned about an axis (Rodrigues); ``square``: it stands at right angles to the axis."""
    result = vector * cosine + cross(axis, vector) * sine
    return result if square else result + axis * (dot(axis, vector) * (1 - cosine))


def sweep(
    rule: SweepRule,
    arm: Links,
    target: ca.SX,
    direction: ca.SX,
    bounds: tuple[Sequence[ca.SX], Sequence[ca.SX]],
    held: bool,
) -> tuple[list[ca.SX], Links]:
    """Both stages once: the turn of each hinge (m) [rad] within ``bounds``, and the arm after it.

    Backward, each hinge from the root up turns by atan2(sum z.(u x v), sum u.v) over the points it follows,
    u from the hinge to the point where it is, v to where the forward stage has it, both square to z.
    ``held``: p_1 stays; else the root goes to p'_1.
    """
    m = rule.chain.hinges
    reached = forward_stage(rule, arm.points, target, direction)
    root = arm.root if held else reached[0]
    links, axes = list(arm.links), list(arm.axes)
    last = float(rule.chain.lengths[-1])
    stretch = rule.virtual_tip / last if rule.directed and rule.virtual_tip else 1.0
    if stretch != 1.0:
        reached[m] = reached[m - 1] + rule.virtual_tip * direction
    here, angles = root, []
    for i in range(m):
        z = axes[i]
        sine, cosine = ca.SX(0), ca.SX(0)
        for k in rule.followed[i]:
            u = _sum([*links[i : k - 1], links[k - 1] * stretch if k == m else links[k - 1]])
            v = reached[k] - here
            sine = sine + dot(z, cross(u, v))
            cosine = cosine + dot(u, v)
            if k > i + 1:  # a link is square to its own hinge, what lies beyond is not
                cosine = cosine - dot(z, u) * dot(z, v)
        angle = ca.fmin(bounds[1][i], ca.fmax(bounds[0][i], ca.atan2(sine, cosine)))
        c, s = ca.cos(angle), ca.sin(angle)
        links[i] = turned(links[i], z, c, s, square=True)
        for j in range(i + 1, m):
            links[j], axes[j] = turned(links[j], z, c, s), turned(axes[j], z, c, s)
        here = here + links[i]
        angles.append(angle)
    return angles, Links(root, links, axes)


def _sum(vectors: list[ca.SX]) -> ca.SX:
    total = vectors[0]
    for vector in vectors[1:]:
        total = total + vector
    return total


def virtual_sweep(
    rule: SweepRule, joint_limits: np.ndarray, cap: float
) -> ca.Function:
    """(moving, fixed) -> moving: a sweep on a copy of the arm whose base stands still.

    ``moving``: joint angles of the hinges (m), then `Links.vector`; ``fixed``: target (3), direction (3).
    ``joint_limits`` (m, 2) [rad]; ``cap`` [rad] a hinge and sweep.
    """
    m = rule.chain.hinges
    moving, fixed = ca.SX.sym("moving", m + 3 + 6 * m), ca.SX.sym("fixed", 6)
    q = moving[:m]
    low, high = [], []
    for i, (lower, upper) in enumerate(joint_limits):
        low.append(ca.fmax(-cap, ca.fmin(float(lower) - q[i], 0)) if np.isfinite(lower) else ca.SX(-cap))
        high.append(ca.fmin(cap, ca.fmax(float(upper) - q[i], 0)) if np.isfinite(upper) else ca.SX(cap))
    angles, arm = sweep(rule, Links.from_vector(moving[m:], m), fixed[:3], fixed[3:], (low, high), held=True)
    following = ca.vertcat(q + ca.vertcat(*angles), arm.vector)
    return ca.Function("fabrik_sweep", [moving, fixed], ca.cse([following]), ["moving", "fixed"], ["moving_next"])
