"""Explicit Euler, the attitude by the exponential map: order 1."""

import casadi as ca

from fzcli.model.integrators.group import Rate, moved, step_function


def euler(rate: ca.Function, attitude: int | None) -> ca.Function:
    """(state, input, dt) -> state_next of one explicit Euler step."""

    def advance(state: ca.SX, at: Rate, dt: ca.SX) -> ca.SX:
        return moved(state, dt * at(state), attitude)

    return step_function("euler", rate, advance)
