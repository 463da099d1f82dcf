"""Modified FABRIK after Dong et al. 2022 in plain NumPy, one state at a time, on numpy_reference.

Written from the equations, for reading rather than speed; it shares no code with the controllers of
fzcli. Symbols: m hinges turn m links; points p_1..p_{m+1} (rows 0..m), the last one the tip; the axis of
hinge i is z_{i-1}; primes are the forward stage's points. Metres, radians, world axes.

One period, from the inputs (q, base attitude, anchor, target, direction) to dq:

1. Points and axes from q, the base attitude and the fixed anchor (``placed``).
2. literal and N1: one sweep = ``forward_stage`` then ``backward_stage``, each angle within the joint's
   speed x period and what its limits leave; the root of the backward stage is p'_1 on a floating base
   (it is not held) and p_1 on a fixed one. N10: ten sweeps on a copy whose base stands still, root p_1,
   .2 rad a sweep, and the total clamped to speed x period.
3. The joints move at constant speed; the base turns by angular momentum (``advance``) and is placed
   so that the centre of mass stands still.

A free last joint (its axis carries the tip) is not commanded. A stall interrupts between two periods:
``search`` proposes a posture, the arm drives there on the straight joint line, then the law resumes.
"""

from dataclasses import dataclass, replace

import numpy as np

from tests.oracle.fabrik_points import UPRIGHT, Array, Chain, forward_stage, unit, without
from tests.oracle.numpy_reference import NumpyReference, quat_exp, quat_multiply, rotation_about, rotation_from_quat

Followed = tuple[tuple[int, ...], ...]  # K_i as rows of the points, one set a hinge
GAUSS = (0.5 - np.sqrt(3.0) / 6.0, 0.5 + np.sqrt(3.0) / 6.0)


@dataclass(frozen=True)
class Task:
    """Where the tip shall be: target (3,) [m], world; direction (3,) of its z, a unit vector, or None."""

    target: Array
    direction: Array | None = None


@dataclass(frozen=True)
class State:
    """Joint angles (n,), base attitude (w, x, y, z) and the anchor (3,), which never moves.

    The anchor is the system's centre of mass, on a fixed base the base's origin; world axes.
    """

    q: Array
    quat: Array
    anchor: Array


@dataclass(frozen=True)
class Settings:
    """The law's settings; the defaults are those of the reference runs.

    variant: "literal", "N1", "N10" or "dls". base: "translation_only", "euler", "midpoint" or
    "gauss_magnus" (a robot with a fixed base ignores it). period [s]; tolerance [m]; angle [rad];
    virtual_tip [m] beyond p_m; sweeps of N10 and their sweep_cap [rad]; clamped False lifts the speed
    limits; followed overrides the sets K_i. stall_*: periods without that relative gain of
    |e_p| + weight x e_d [m/rad]. seeds, rounds, round_sweeps, segments: of ``search``, which
    keeps solutions within keep [m] and keep_angle [rad]. gain [1/s], damping: of "dls".
    """

    variant: str = "N10"
    base: str = "gauss_magnus"
    period: float = 0.01
    tolerance: float = 0.01
    angle: float = np.deg2rad(2.0)
    virtual_tip: float = 0.2
    sweeps: int = 10
    sweep_cap: float = 0.2
    clamped: bool = True
    followed: Followed | None = None
    restart: bool = False
    stall_periods: int = 15
    stall_gain: float = 0.05
    stall_weight: float = 0.2
    seeds: int = 16
    rounds: int = 15
    round_sweeps: int = 8
    segments: int = 8
    keep: float = 0.005
    keep_angle: float = np.deg2rad(1.7)
    gain: float = 20.0
    damping: float = 0.05


def start_state(chain: Chain, q: Array, quat: Array = UPRIGHT) -> State:
    """At rest in q with the base frame's origin at the world's."""
    return State(np.array(q, float), quat, rotation_from_quat(quat) @ chain.body.reference_point(q, UPRIGHT))


def base_position(chain: Chain, state: State) -> Array:
    """The base frame's origin (3,) [m], which follows from q and the attitude: no drift."""
    return state.anchor - rotation_from_quat(state.quat) @ chain.body.reference_point(state.q, UPRIGHT)


def placed(chain: Chain, state: State) -> tuple[Array, Array]:
    """Points (m+1, 3) and hinge axes (m, 3) in the world."""
    points, axes = chain.at(state.q)
    turn = rotation_from_quat(state.quat)
    return base_position(chain, state) + points @ turn.T, axes @ turn.T


def errors(chain: Chain, state: State, task: Task) -> tuple[float, float]:
    """|p_{m+1} - X| [m] and the angle between last link and direction [rad], 0 without one."""
    points, _ = placed(chain, state)
    error = float(np.linalg.norm(points[-1] - task.target))
    if task.direction is None:
        return error, 0.0
    along = unit(points[-1] - points[-2])
    sine = float(np.linalg.norm(np.cross(along, task.direction)))
    return error, float(np.arctan2(sine, along @ task.direction))


def followed_points(variant: str, m: int, directed: bool) -> Followed:
    """K_i for hinges 1..m as rows of the points (row k-1 is p_k).

    literal: {i+1}. N1, N10: {i+1, m, m+1}, without a direction {i+1, m+1}; only k > i, each once.
    """
    extra = () if variant == "literal" else (m - 1, m) if directed else (m,)
    return tuple(tuple(sorted({i, *(k for k in extra if k >= i)})) for i in range(1, m + 1))


def backward_stage(
    points: Array, axes: Array, reached: Array, root: Array, followed: Followed, bounds: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """Turn each hinge, from the root up, so that the points it follows approach the forward stage's.

    The angle is the best one for all followed points in the hinge's plane: atan2(sum z.(u x v),
    sum u.v), within ``bounds`` (m,), (m,) [rad]. Returns dq (m,), points (m+1, 3), axes (m, 3) after.
    """
    turn, placed_points, turned_axes, dq = np.eye(3), [root], [], []
    for i, axis in enumerate(axes):
        z, here = turn @ axis, placed_points[i]
        pairs = [(without(turn @ (points[k] - points[i]), z), without(reached[k] - here, z)) for k in followed[i]]
        sine = sum(float(z @ np.cross(u, v)) for u, v in pairs)
        cosine = sum(float(u @ v) for u, v in pairs)
        angle = float(np.clip(np.arctan2(sine, cosine), bounds[0][i], bounds[1][i]))
        turn = rotation_about(z, angle) @ turn
        placed_points.append(here + turn @ (points[i + 1] - points[i]))
        turned_axes.append(z)
        dq.append(angle)
    return np.array(dq), np.array(placed_points), np.array(turned_axes)


def sweep(
    chain: Chain, points: Array, axes: Array, task: Task, settings: Settings, bounds: tuple[Array, Array], held: bool
) -> tuple[Array, Array, Array]:
    """Both stages once: dq (m,), and the points and axes after it; ``held`` keeps p_1 as the root.

    N1 and N10 put a virtual tip on the last link, so that its direction weighs more; literal also
    leaves out the squaring, as the paper does.
    """
    literal = settings.variant == "literal"
    directed = task.direction is not None
    square = chain.square and not literal
    reached = forward_stage(points, chain.lengths, task.target, task.direction, square)
    moved = points.copy()
    if task.direction is not None and not literal:
        moved[-1] = points[-2] + settings.virtual_tip * unit(points[-1] - points[-2])
        reached[-1] = reached[-2] + settings.virtual_tip * task.direction
    followed = settings.followed or followed_points(settings.variant, chain.hinges, directed)
    dq, moved, axes = backward_stage(moved, axes, reached, points[0] if held else reached[0], followed, bounds)
    moved[-1] = moved[-2] + chain.lengths[-1] * unit(moved[-1] - moved[-2])
    return dq, moved, axes


def bounds_at(chain: Chain, q: Array, cap: Array | float) -> tuple[Array, Array]:
    """Smallest and largest step (n,), (n,) [rad] by a cap and by the joint limits at q."""
    return np.maximum(-cap, np.minimum(chain.lower - q, 0.0)), np.minimum(cap, np.maximum(chain.upper - q, 0.0))


def period_cap(chain: Chain, settings: Settings) -> Array:
    """The largest step (n,) [rad] of a period."""
    return chain.speed * settings.period if settings.clamped else np.full(chain.body.n, np.inf)


def virtual_sweeps(chain: Chain, state: State, task: Task, settings: Settings, count: int) -> Array:
    """q (n,) after sweeps on a copy whose base stands still; points follow from the sweeps themselves."""
    points, axes = placed(chain, state)
    q, m = state.q.copy(), chain.hinges
    for _ in range(count):
        bounds = bounds_at(chain, q, settings.sweep_cap)
        dq, points, axes = sweep(chain, points, axes, task, settings, bounds, held=True)
        q[:m] += dq
    return q


def command(chain: Chain, state: State, task: Task, settings: Settings) -> Array:
    """dq (n,) [rad] of one period, within speeds and joint limits."""
    if task.direction is not None and not chain.approach:
        raise ValueError("a direction needs the tip's z along the last link")
    bounds = bounds_at(chain, state.q, period_cap(chain, settings))
    if settings.variant == "dls":
        return np.clip(damped_least_squares(chain, state, task, settings), *bounds)
    if settings.variant == "N10":
        return np.clip(virtual_sweeps(chain, state, task, settings, settings.sweeps) - state.q, *bounds)
    held = not chain.body.floating
    points, axes = placed(chain, state)
    dq, _, _ = sweep(chain, points, axes, task, settings, bounds, held)
    return np.concatenate([dq, np.zeros(chain.body.n - chain.hinges)])


def damped_least_squares(chain: Chain, state: State, task: Task, settings: Settings) -> Array:
    """dq = J^T (J J^T + damping^2 E)^-1 gain e period, all joints scaled alike to the speeds: (n,).

    J has the position rows of J_g and, with a direction, its rotation rows less their part about the
    last link: the roll is free. The rotation error turns the last link onto the direction.
    """
    points, _ = placed(chain, state)
    jacobian = chain.body.generalized_jacobian(state.q, state.quat)
    error = task.target - points[-1]
    if task.direction is None:
        jacobian = jacobian[:3]
    else:
        z = unit(points[-1] - points[-2])
        across = np.cross(z, task.direction)
        angle = np.arctan2(np.linalg.norm(across), z @ task.direction)
        error = np.concatenate([error, unit(across) * angle])
        jacobian[3:] -= np.outer(z, z @ jacobian[3:])
    square = jacobian @ jacobian.T + settings.damping**2 * np.eye(len(error))
    dq = settings.period * jacobian.T @ np.linalg.solve(square, settings.gain * error)
    return dq / max(1.0, float(np.max(np.abs(dq) / period_cap(chain, settings))))


def base_turn(body: NumpyReference, q: Array, dq: Array, method: str) -> Array:
    """The base's rotation vector (3,) [rad], base axes, while q moves by dq at constant speed.

    Two-node Gauss-Magnus: a, b = W(q + (1/2 -+ sqrt3/6) dq) dq; (a + b)/2 + sqrt3/12 (a x b).
    """
    if method == "translation_only" or not body.floating:
        return np.zeros(3)
    offsets = {"euler": (0.0, 0.0), "midpoint": (0.5, 0.5), "gauss_magnus": GAUSS}
    if method not in offsets:
        raise ValueError(f"base: {method!r} is not translation_only, {', '.join(offsets)}")
    a, b = (body.base_rate_map(q + offset * dq, UPRIGHT) @ dq for offset in offsets[method])
    turn: Array = 0.5 * (a + b) + np.sqrt(3.0) / 12.0 * np.cross(a, b)  # the product vanishes for a = b
    return turn


def advance(chain: Chain, state: State, dq: Array, method: str, pieces: int = 1) -> State:
    """The state after q has moved by dq (n,) along the straight line, in equal pieces."""
    q, quat, step = state.q, state.quat, dq / pieces
    for _ in range(pieces):
        quat = quat_multiply(quat, quat_exp(base_turn(chain.body, q, step, method)))
        q = q + step
    return replace(state, q=q, quat=quat / np.linalg.norm(quat))
