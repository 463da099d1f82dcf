"""Contestants that take turns, so that a machine whose speed drifts slows all of them alike."""

import time
from collections.abc import Callable

ROUNDS = 9
Contestant = tuple[Callable[[], object], int]  # work, and how many steps it makes


def take_turns(contestants: dict[str, Contestant]) -> dict[str, list[float]]:
    """Nanoseconds a step of every contestant in every round."""
    found: dict[str, list[float]] = {name: [] for name in contestants}
    for round_number in range(ROUNDS + 1):
        for name, (work, count) in contestants.items():
            before = time.perf_counter()
            work()
            seconds = time.perf_counter() - before
            if round_number:  # the first warms up
                found[name].append(seconds / count * 1e9)
    return found
