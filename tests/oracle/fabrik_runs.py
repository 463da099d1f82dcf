"""Runs of the modified FABRIK reference: period after period, with a restart where progress stalls.

Inputs of a period: q, base attitude, anchor, target, direction, and ``Memory``: the best measure
|e_p| + .2 e_d so far, the periods since, and the posture being driven to, if any. Outputs: dq and the
memory. All of it is plain arithmetic but for ``search``, which is asked for between two periods, when the
check at the start of a period finds a stall; its only result is that posture. The arm then drives
there on the straight joint line, all joints scaled alike (the base's final attitude hangs on the path),
with the stall check at rest; on arrival the check starts afresh and the law resumes. A search
without result changes nothing but starts the check afresh: the law goes on and may stall again.
Arrival at the target is checked first, at every sample, during a drive too.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from tests.oracle.fabrik_points import Array, Chain
from tests.oracle.fabrik_reference import Settings, State, Task, advance, command, errors, period_cap, virtual_sweeps
from tests.oracle.numpy_reference import quat_multiply


@dataclass
class Stall:
    """Memory of the stall check: the best measure so far and the periods since it was set."""

    best: float = np.inf
    count: int = 0

    def update(self, measure: float, settings: Settings) -> bool:
        """Take this period's measure; True once ``stall_periods`` passed without the gain."""
        if measure < (1.0 - settings.stall_gain) * self.best:
            self.best, self.count = measure, 0
        else:
            self.count += 1
        return self.count >= settings.stall_periods


def virtual_solution(chain: Chain, state: State, task: Task, settings: Settings, seed: Array) -> State:
    """Solve from a seed (n,): predict the base after the straight drive there, sweep, and again."""
    virtual = replace(settings, variant="N10", followed=None)
    q = seed
    for _ in range(settings.rounds):
        there = advance(chain, state, q - state.q, settings.base, settings.segments)
        q = virtual_sweeps(chain, there, task, virtual, settings.round_sweeps)
    return advance(chain, state, q - state.q, settings.base, settings.segments)


def search(chain: Chain, state: State, task: Task, settings: Settings, rng: np.random.Generator) -> Array | None:
    """The posture (n,) to drive to: of the good virtual solutions the soonest reached; None without one.

    Seeds: q + U(-pi, pi) on the m hinges, clipped to the limits. Good: within keep and keep_angle.
    Soonest: by the joint that needs longest at its speed.
    """
    found: list[tuple[float, Array]] = []
    for _ in range(settings.seeds):
        seed = state.q.copy()
        seed[: chain.hinges] += rng.uniform(-np.pi, np.pi, chain.hinges)
        there = virtual_solution(chain, state, task, settings, np.clip(seed, chain.lower, chain.upper))
        error, angle = errors(chain, there, task)
        if error < settings.keep and angle < settings.keep_angle:
            found.append((float(np.max(np.abs(there.q - state.q) / chain.speed)), there.q))
    return min(found, key=lambda item: item[0])[1] if found else None


def drive(chain: Chain, q: Array, goal: Array, settings: Settings) -> Array:
    """dq (n,) towards a posture, all joints scaled alike: the line that the search has predicted."""
    rest = goal - q
    return rest / max(1.0, float(np.max(np.abs(rest) / period_cap(chain, settings))))


@dataclass(frozen=True)
class Run:
    """Samples k = 0..N: states, position error (N+1,) [m], angle (N+1,) [rad]; done, restarts, empty searches."""

    states: list[State]
    error: Array
    angle: Array
    done: bool
    restarts: int = 0
    empty: int = 0

    @property
    def steps(self) -> int:
        """N, the periods moved."""
        return len(self.states) - 1


@dataclass
class Memory:
    """What a run carries from period to period besides its state."""

    stall: Stall = field(default_factory=Stall)
    goal: Array | None = None
    restarts: int = 0
    empty: int = 0


def next_dq(
    chain: Chain, state: State, task: Task, settings: Settings, memory: Memory, rng: np.random.Generator
) -> Array:
    """dq (n,) of a run's period: the drive while there is a goal, otherwise the law, after a stall check."""
    if memory.goal is not None and np.array_equal(state.q, memory.goal):
        memory.goal, memory.stall = None, Stall()
    if settings.restart and memory.goal is None:
        error, angle = errors(chain, state, task)
        if memory.stall.update(error + settings.stall_weight * angle, settings):
            memory.goal, memory.stall = search(chain, state, task, settings, rng), Stall()
            memory.restarts += 1
            memory.empty += memory.goal is None
    if memory.goal is None:
        return command(chain, state, task, settings)
    return drive(chain, state.q, memory.goal, settings)


def periods(chain: Chain, state: State, task: Task, settings: Settings, memory: Memory, seed: int) -> Iterator[State]:
    """The states at the samples, without end."""
    rng = np.random.default_rng(seed)
    while True:
        yield state
        dq = next_dq(chain, state, task, settings, memory, rng)
        state = advance(chain, state, dq, settings.base)
        if memory.goal is not None and np.allclose(state.q, memory.goal, rtol=0.0, atol=1e-12):
            state = replace(state, q=memory.goal)


def run(chain: Chain, state: State, task: Task, settings: Settings, limit: int = 1000, seed: int = 0) -> Run:
    """Period after period until error < tolerance and angle < angle, at most ``limit`` of them."""
    states: list[State] = []
    measured: list[tuple[float, float]] = []
    memory, done = Memory(), False
    for k, now in enumerate(periods(chain, state, task, settings, memory, seed)):
        states.append(now)
        measured.append(errors(chain, now, task))
        done = measured[-1][0] < settings.tolerance and measured[-1][1] < settings.angle
        if done or k == limit:
            break
    table = np.array(measured)
    return Run(states, table[:, 0], table[:, 1], done, memory.restarts, memory.empty)


def replay(chain: Chain, states: list[State], method: str = "midpoint", pieces: int = 32) -> list[State]:
    """The same joint motion on the true plant, each period in equal pieces; samples as given."""
    result = [states[0]]
    for before, after in pairwise(states):
        moved = advance(chain, result[-1], after.q - before.q, method, pieces)
        result.append(replace(moved, q=after.q))
    return result


def attitude_error(a: Array, b: Array) -> float:
    """The angle [rad] between two attitudes w x y z, accurate for small ones."""
    apart = quat_multiply(a * np.array([1.0, -1.0, -1.0, -1.0]), b)
    return 2.0 * float(np.arctan2(np.linalg.norm(apart[1:]), abs(apart[0])))
