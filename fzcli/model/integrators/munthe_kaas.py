"""Munthe-Kaas's Runge-Kutta method of order 4: the classical tableau in the chart of the exponential map.

Source: Munthe-Kaas 1999, High order Runge-Kutta methods on manifolds.
"""

import casadi as ca

from fzcli.model.integrators.group import Rate, in_chart, moved, step_function


def munthe_kaas(rate: ca.Function, attitude: int | None) -> ca.Function:
    """(state, input, dt) -> state_next of one step of order 4, the quaternion of unit length throughout."""

    def advance(state: ca.SX, at: Rate, dt: ca.SX) -> ca.SX:
        first = at(state)
        second = in_chart(state, 0.5 * dt * first, at, attitude)
        third = in_chart(state, 0.5 * dt * second, at, attitude)
        fourth = in_chart(state, dt * third, at, attitude)
        return moved(state, dt / 6 * (first + 2 * (second + third) + fourth), attitude)

    return step_function("munthe_kaas", rate, advance)
