"""Graphs of calls, which are printed as calls alone: parting and joining vectors are calls, too."""

import casadi as ca


def parted(name: str, sizes: tuple[int, int]) -> ca.Function:
    """A vector of these sizes -> its two parts."""
    vector = ca.SX.sym(name, sum(sizes))
    return ca.Function(f"parted_{name}", [vector], [vector[: sizes[0]], vector[sizes[0] :]])


def joined(name: str, sizes: tuple[int, int]) -> ca.Function:
    """Two vectors of these sizes -> one."""
    first, second = ca.SX.sym("first", sizes[0]), ca.SX.sym("second", sizes[1])
    return ca.Function(f"joined_{name}", [first, second], [ca.vertcat(first, second)])


def cut(function: ca.Function, size: int) -> ca.Function:
    """A Function of the first of ``size`` parameters, of all of them."""
    given = ca.SX.sym("parameters", size)
    return sx_function(function.name(), [given], [function(given[: function.size1_in(0)])])


def outputs_of(results: ca.SX | tuple[ca.SX, ...]) -> list[ca.SX]:
    """What a call gives: one thing, or several."""
    return list(results) if isinstance(results, tuple) else [results]


def sx_function(name: str, given: list[ca.SX], results: list[ca.SX]) -> ca.Function:
    """A Function of dense results, what they share computed once."""
    return ca.Function(name, given, ca.cse([ca.densify(ca.SX(value)) for value in results]))
