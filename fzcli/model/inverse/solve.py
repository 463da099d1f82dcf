"""Postures that put a robot's tip at a pose: the arm's own closed form where it has one, else a search."""

import weakref
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fzcli.errors import Problem, SpecError
from fzcli.model.inverse import numeric, spherical_wrist, ur
from fzcli.model.inverse.arm import Arm, build_arm
from fzcli.model.inverse.branches import ClosedForm
from fzcli.model.inverse.numeric import Aim, Found, NumericInverse
from fzcli.model.inverse.windings import SLACK, all_windings, excess, nearest_windings
from fzcli.model.robot_model import RobotModel
from fzcli.spec.robot import Frame

Array = NDArray[np.float64]
TOLERANCE = 1e-9  # m and rad
EXACT = 1e-12  # m and rad: closed forms that miss by more are finished by Newton steps
NEARBY = 1e-4  # m and rad: and those that miss by more than this do not reach the pose
SAME = 1e-7  # rad or m: postures closer than this are one
LOCKED = 1e-6  # sine of the wrist's bend below which the closed form chooses one joint by itself
ROUGH = 1e-4  # how far a matrix may be from a rotation


@dataclass(frozen=True)
class Solution:
    """A posture q (n) [rad, m], its branch's name ("" where the arm has none), and how it misses the pose.

    ``distance`` [m] and ``angle`` [rad] (0 where no rotation was asked for). ``excess``: how far [rad, m] the
    worst joint is past its limits, negative inside them.
    """

    q: Array
    branch: str
    distance: float
    angle: float
    excess: float

    @property
    def error(self) -> float:
        """The larger of distance [m] and angle [rad]."""
        return max(self.distance, self.angle)


@dataclass(frozen=True)
class _End:
    """A posture q (m) of the arm alone, before it is wound; ``locked``: near a singularity of the wrist."""

    q: Array
    branch: str
    distance: float
    angle: float
    locked: bool

    @property
    def error(self) -> float:
        return max(self.distance, self.angle)


@dataclass(frozen=True)
class InverseKinematics:
    """Inverse kinematics of one tip, relative to the base frame, the base standing still.

    ``kind``: "spherical_wrist", "ur" (exact, by ``form``) or "numeric". ``why`` tells why the closed forms do not
    serve, where they do not.
    """

    model: RobotModel
    arm: Arm
    kind: str
    form: ClosedForm | None
    why: str
    _searches: dict[tuple[Aim, bool], NumericInverse] = field(default_factory=dict, repr=False, compare=False)

    def solve(
        self,
        position: ArrayLike,
        rotation: ArrayLike | None = None,
        *,
        near: ArrayLike | None = None,
        windings: bool = False,
        limits: bool = True,
        tolerance: float = TOLERANCE,
        starts: int = 60,
        seed: int = 0,
    ) -> list[Solution]:
        """Postures that meet a pose within ``tolerance`` [m and rad], nearest to ``near`` (n) first; [] without any.

        ``position`` (3) [m] and ``rotation`` (3, 3) of the tip with its tool, in the base frame; without a rotation
        any will do. Closed forms give each branch that reaches the pose, a search gives one posture, found from
        ``near`` or one of ``starts`` random ones drawn by ``seed``. Hinges are wound next to ``near`` (default:
        the middle of the limits), or, with ``windings``, every way that the limits allow. ``limits`` False keeps
        postures outside the limits too. Joints that do not carry the tip stay as in ``near``.
        Raises SpecError for a position, rotation or posture of the wrong shape or that is none.
        """
        goal, turn, start = self._checked(position, rotation, near)
        aim: Aim = "position" if rotation is None else "pose"
        own = start[list(self.arm.joints)]
        ends: list[_End] = []
        locked = False
        if self.form is not None and aim == "pose":
            branches = self._branches(self.form, goal, turn, own)
            ends = [self._finished(end, goal, turn) for end in branches if end.error < NEARBY]
            locked = any(end.locked for end in branches)
        found = self._wound(ends, start, windings, limits, tolerance)
        if self.form is None or aim == "position" or (locked and not found):
            search = self._search(aim, limits)
            best = search.search(goal, turn, own, tolerance=0.1 * tolerance, starts=starts, seed=seed)
            found = self._wound([self._end(best)], start, windings, limits, tolerance)
        return sorted(found, key=lambda one: float(((one.q - start) ** 2).sum()))

    def branches(
        self, position: ArrayLike, rotation: ArrayLike | None = None, *, near: ArrayLike | None = None
    ) -> list[Solution]:
        """What becomes of a pose on every branch, reached or not, inside the limits or not: least error first.

        With a spherical wrist the rotation is met, and ``distance`` is how far the wrist is out of reach. Where a
        search does the work it is the one posture that came nearest.
        """
        goal, turn, start = self._checked(position, rotation, near)
        own = start[list(self.arm.joints)]
        if self.form is not None and rotation is not None:
            ends = [self._finished(end, goal, turn) for end in self._branches(self.form, goal, turn, own)]
        else:
            aim: Aim = "position" if rotation is None else "pose"
            ends = [self._end(self._search(aim, False).search(goal, turn, own))]
        wound = nearest_windings(self.arm, np.array([end.q for end in ends]), own)
        return sorted(self._solutions(ends, wound, start, False), key=lambda one: one.distance + one.angle)

    def branch(self, q: ArrayLike) -> str:
        """The name of the branch of a posture q (n); "" where the arm has no closed form."""
        own = np.asarray(q, float)[list(self.arm.joints)]
        return "" if self.form is None else self.form.label(own)

    def _branches(self, form: ClosedForm, goal: Array, turn: Array, own: Array) -> list["_End"]:
        postures, errors, bends = (np.array(values).T for values in form.function(goal, turn, own))
        return [
            _End(q, name, float(distance), float(angle), abs(float(bend)) < LOCKED)
            for q, (distance, angle), (bend,), name in zip(postures, errors, bends, form.labels, strict=True)
        ]

    def _end(self, found: Found) -> "_End":
        name = "" if self.form is None else self.form.label(found.q)
        return _End(found.q, name, found.distance, found.angle, False)

    def _finished(self, end: "_End", goal: Array, turn: Array) -> "_End":
        """After Newton steps where rounding, or a geometry that is special only almost, leaves an error."""
        if end.error <= EXACT or end.error > NEARBY:
            return end
        found = self._search("pose", False).search(goal, turn, end.q, tolerance=EXACT, starts=1, steps=8)
        return replace(end, q=found.q, distance=found.distance, angle=found.angle)

    def _search(self, aim: Aim, limited: bool) -> NumericInverse:
        key: tuple[Aim, bool] = (aim, limited)
        if key not in self._searches:
            self._searches[key] = numeric.build(self.arm, aim, limited)
        return self._searches[key]

    def _wound(
        self, ends: list["_End"], start: Array, windings: bool, limits: bool, tolerance: float
    ) -> list[Solution]:
        good = [end for end in ends if end.error <= tolerance]
        if not good:
            return []
        own = start[list(self.arm.joints)]
        postures = nearest_windings(self.arm, np.array([end.q for end in good]), own)
        apart = np.abs(postures[:, None] - postures).max(axis=2) > SAME
        kept = [k for k in range(len(good)) if apart[k, :k].all()]
        owners, postures = [good[k] for k in kept], postures[kept]
        if windings:
            wound = [all_windings(self.arm, end.q, own) for end in owners]
            owners = [end for end, some in zip(owners, wound, strict=True) for _ in some]
            postures = np.concatenate(wound)
        return self._solutions(owners, postures, start, limits)

    def _solutions(self, ends: list["_End"], postures: Array, start: Array, limits: bool) -> list[Solution]:
        """Postures (k, m) of the arm as solutions; if ``limits``, of those inside the limits."""
        past = excess(self.arm, postures)
        rounding = (past > 0.0) & (past <= SLACK)
        if rounding.any():
            within = np.clip(postures, self.arm.limits[:, 0], self.arm.limits[:, 1])
            postures, past = np.where(rounding[:, None], within, postures), np.where(rounding, 0.0, past)
        q = np.repeat(start[None], len(postures), axis=0)
        q[:, list(self.arm.joints)] = postures
        return [
            Solution(one, end.branch, end.distance, end.angle, by)
            for one, end, by in zip(q, ends, past.tolist(), strict=True)
            if not limits or by <= 0.0
        ]

    def _checked(
        self, position: ArrayLike, rotation: ArrayLike | None, near: ArrayLike | None
    ) -> tuple[Array, Array, Array]:
        goal = _vector("position", position, 3)
        turn = np.eye(3) if rotation is None else _rotation(rotation)
        if near is not None:
            return goal, turn, _vector("near", near, self.model.n)
        start = np.zeros(self.model.n)
        start[list(self.arm.joints)] = self.arm.middle
        return goal, turn, start


def build_inverse(
    model: RobotModel, tip: str | None = None, tool: Frame | None = None, kind: str | None = None
) -> InverseKinematics:
    """The inverse kinematics of a tip (default: the first) with a tool, a frame in the tip's frame.

    The closed form that fits is taken; ``kind`` "spherical_wrist", "ur" or "numeric" asks for one.
    Raises SpecError for an unknown tip or kind, and for a closed form that the arm's geometry does not have.
    """
    arm = build_arm(model, tip, tool)
    forms = {"spherical_wrist": spherical_wrist, "ur": ur}
    if kind is not None and kind not in (*forms, "numeric"):
        raise SpecError(Problem(f"no inverse kinematics {kind!r}; known: {', '.join(forms)}, numeric", field="kind"))
    reasons = []
    for name, form in forms.items():
        if kind not in (None, name):
            continue
        reason = form.unfit(arm)
        if not reason:
            return InverseKinematics(model, arm, name, form.build(arm), "")
        reasons.append(f"{name}: {reason}")
    if kind in forms:
        raise SpecError(Problem(f"the arm has no such closed form: {'; '.join(reasons)}", field="kind"))
    return InverseKinematics(model, arm, "numeric", None, "; ".join(reasons))


_Key = tuple[int, str | None, str]
_BUILT: dict[_Key, InverseKinematics] = {}


def inverse_kinematics(
    model: RobotModel,
    position: ArrayLike,
    rotation: ArrayLike | None = None,
    *,
    tip: str | None = None,
    tool: Frame | None = None,
    near: ArrayLike | None = None,
    windings: bool = False,
    limits: bool = True,
) -> list[Solution]:
    """Postures that put a tip at a pose in the base frame, as `InverseKinematics.solve` has them.

    What it builds for a model, tip and tool is kept as long as the model lives.
    """
    key = (id(model), tip, "" if tool is None else tool.model_dump_json())
    if key not in _BUILT:
        _BUILT[key] = build_inverse(model, tip, tool)
        weakref.finalize(model, _BUILT.pop, key, None)
    return _BUILT[key].solve(position, rotation, near=near, windings=windings, limits=limits)


def _vector(name: str, values: ArrayLike, size: int) -> Array:
    result = np.array(values, dtype=float)
    if result.shape != (size,) or not np.isfinite(result).all():
        shown = np.array2string(result, threshold=9)
        raise SpecError(Problem(f"must be {size} finite numbers, not {shown}", field=name))
    return result


def _rotation(values: ArrayLike) -> Array:
    """The rotation nearest to a matrix (3, 3) that is almost one."""
    result = np.array(values, dtype=float)
    if result.shape != (3, 3) or not np.isfinite(result).all():
        raise SpecError(Problem(f"must be 3 x 3 finite numbers, not of shape {result.shape}", field="rotation"))
    off = float(np.abs(result @ result.T - np.eye(3)).max())
    if off > ROUGH or np.linalg.det(result) < 0:
        what = "it mirrors" if off <= ROUGH else f"its columns are off square or unit length by {off:.3g}"
        raise SpecError(Problem(f"is no rotation: {what}", field="rotation"))
    if off > 1e-14:
        left, _, right = np.linalg.svd(result)
        result = left @ right
    return result
