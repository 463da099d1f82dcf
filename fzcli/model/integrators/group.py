"""What all methods share: going from a state along a tangent, and the step as a Function."""

from collections.abc import Callable

import casadi as ca

from fzcli.model.algebra import cross
from fzcli.model.attitude import attitude_step

Rate = Callable[[ca.SX], ca.SX]


def moved(state: ca.SX, tangent: ca.SX, attitude: int | None) -> ca.SX:
    """The state after a tangent: vectors add, the attitude turns by the tangent's rotation vector (body axes)."""
    if attitude is None:
        return state + tangent
    a = attitude
    turned = attitude_step(state[a : a + 4], tangent[a : a + 3])
    return ca.vertcat(state[:a] + tangent[:a], turned, state[a + 4 :] + tangent[a + 3 :])


def in_chart(state: ca.SX, tangent: ca.SX, rate: Rate, attitude: int | None) -> ca.SX:
    """The tangent's own rate on the way from ``state``: the rate at the moved state, its turn through dexp^-1.

    theta' = w + theta x w / 2 + theta x (theta x w) / 12 for R = R_0 exp(theta) and w in body axes; the next
    term is of fourth order in theta, enough for methods up to order five (Munthe-Kaas 1999).
    """
    found = rate(moved(state, tangent, attitude))
    if attitude is None:
        return found
    a = attitude
    theta, w = tangent[a : a + 3], found[a : a + 3]
    once = cross(theta, w)
    return ca.vertcat(found[:a], w + 0.5 * once + cross(theta, once) / 12, found[a + 3 :])


def step_function(
    name: str, rate: ca.Function, advance: Callable[[ca.SX, Rate, ca.SX], ca.SX]
) -> ca.Function:
    """(state, input, dt) -> state_next, by ``advance`` (state, rate, dt)."""
    state, given = ca.SX.sym("state", rate.size1_in(0)), ca.SX.sym("input", rate.size1_in(1))
    dt = ca.SX.sym("dt")
    following = advance(state, lambda place: rate(place, given), dt)
    outputs = ca.cse([ca.densify(following)])
    return ca.Function(name, [state, given, dt], outputs, ["state", "input", "dt"], ["state_next"])
