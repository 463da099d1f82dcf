"""A law's search as a closed loop of its own, so that the engines run it, and how its result goes back."""

from dataclasses import dataclass
from typing import Any

import casadi as ca

from fzcli.control.law import Search


@dataclass(frozen=True)
class SearchLoop:
    """The search of a paused run. ``request``: (state, constants) of the run -> row, number of the search.

    ``initial``: row and offsets -> state, constants; ``step``: (state, constants, history) -> state_next,
    samples, stop, signals, of which the last three are idle; ``finish``: (state, constants) -> posture and
    cost in one; of ``n_steps`` steps. ``accept``: (state, posture, found) of the run -> its state.
    """

    request: ca.Function
    initial: ca.Function
    step: ca.Function
    finish: ca.Function
    accept: ca.Function
    n_steps: int
    seeds: int
    offsets: int
    seed: int
    history_length: int = 0
    search: None = None


def search_loop(
    search: Search, held: dict[str, ca.SX], arguments: list[ca.SX], memory: ca.SX
) -> SearchLoop:
    """``held``: state and constants of the run, ``arguments``: the law's inputs in them, ``memory``: its part."""
    state, constants = held["state"], held["constants"]
    row, number = search.request(*arguments, memory)
    wide, size = row.shape[0], search.first.size1_out(0)
    given = ca.MX.sym("parameters", wide + search.offsets)
    fixed, offsets = _split(wide, search.offsets)(given)
    at, held_fixed, none = ca.MX.sym("state", size), ca.MX.sym("constants", wide), ca.MX.sym("history", 0)
    posture, found = ca.SX.sym("posture", search.accept.size1_in(1)), ca.SX.sym("found")
    following = ca.substitute([state], [memory], [search.accept(memory, posture, found)])[0]
    return SearchLoop(
        request=ca.Function("request", [state, constants], ca.cse([row, number])),
        initial=_named("initial", {"parameters": given}, {"state": search.first(fixed, offsets), "constants": fixed}),
        step=_named(
            "search_step",
            {"state": at, "constants": held_fixed, "history": none},
            dict(zip(_STEP, [*_outputs(search.turn(at, held_fixed)), *_outputs(_idle(size)(at))], strict=True)),
        ),
        finish=_named(
            "finish",
            {"state": at, "constants": held_fixed},
            {"metrics": _outputs(_join(size)(*_outputs(search.result(at, held_fixed))))[0]},
        ),
        accept=ca.Function("accept", [state, posture, found], [following]),
        n_steps=search.turns - 1,
        seeds=search.seeds,
        offsets=search.offsets,
        seed=search.seed,
    )


_STEP = ("state_next", "samples", "stop", "signals")


def _named(name: str, inputs: dict[str, ca.MX], outputs: dict[str, ca.MX]) -> ca.Function:
    return ca.Function(name, list(inputs.values()), list(outputs.values()), list(inputs), list(outputs))


# A graph of calls is printed as calls alone: parting and joining vectors are calls, too.


def _outputs(results: Any) -> list[ca.MX]:
    """What a call gives: one thing, or several."""
    return list(results) if isinstance(results, tuple) else [results]


def _split(first: int, second: int) -> ca.Function:
    vector = ca.SX.sym("vector", first + second)
    return ca.Function("parted", [vector], [vector[:first], vector[first:]])


def _join(size: int) -> ca.Function:
    posture, cost = ca.SX.sym("posture", size), ca.SX.sym("cost")
    return ca.Function("joined", [posture, cost], [ca.vertcat(posture, cost)])


def _idle(size: int) -> ca.Function:
    """No samples, never a stop, no signals."""
    return ca.Function("idle", [ca.SX.sym("state", size)], [ca.SX(0, 1), ca.SX.zeros(1), ca.SX(0, 1)])
