"""The classical Runge-Kutta method on quaternion components: order 4, the quaternion brought back to unit length."""

import casadi as ca

from fzcli.model.attitude import multiply, normalised
from fzcli.model.integrators.group import Rate, step_function


def rk4(rate: ca.Function, attitude: int | None) -> ca.Function:
    """(state, input, dt) -> state_next of one classical step on q' = q w / 2."""

    def advance(state: ca.SX, at: Rate, dt: ca.SX) -> ca.SX:
        def slope(place: ca.SX) -> ca.SX:
            return _with_quaternion(place, at(place), attitude)

        first = slope(state)
        second = slope(state + 0.5 * dt * first)
        third = slope(state + 0.5 * dt * second)
        fourth = slope(state + dt * third)
        following = state + dt / 6 * (first + 2 * (second + third) + fourth)
        if attitude is None:
            return following
        a = attitude
        return ca.vertcat(following[:a], normalised(following[a : a + 4]), following[a + 4 :])

    return step_function("rk4", rate, advance)


def _with_quaternion(place: ca.SX, found: ca.SX, attitude: int | None) -> ca.SX:
    """The rate with q w / 2 in place of the angular velocity."""
    if attitude is None:
        return found
    a = attitude
    turning = 0.5 * multiply(place[a : a + 4], ca.vertcat(0, found[a : a + 3]))
    return ca.vertcat(found[:a], turning, found[a + 3 :])
