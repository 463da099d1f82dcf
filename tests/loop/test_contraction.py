"""Products and sums are rounded one by one, whatever pairs of them a compiler finds."""

import casadi as ca
import numpy as np
import pytest

from fzcli.loop.compiler import find_compiler
from tests.loop.test_lanes import evaluate_all


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
@pytest.mark.parametrize("lanes", [1, 2, 8])
def test_pairs_of_a_difference_and_a_sum_are_not_fused(lanes: int) -> None:
    """gcc 12 makes one fmaddsub of them, which -ffp-contract=off does not forbid it."""
    a, b, c, d, e, f = np.random.default_rng(1).normal(size=(6, 500))
    functions = [lambda a, b, c, *_: a * b - c, lambda *v: v[3] * v[4] + v[5]]
    found = evaluate_all(functions * 2, [a, b, c, d, e, f], lanes)
    np.testing.assert_array_equal(found, [a * b - c, d * e + f] * 2)


def test_the_machine_does_not_fuse_either() -> None:
    a, b, c = np.random.default_rng(2).normal(size=(3, 100))
    x, y, z = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("z")
    function = ca.Function("f", [x, y, z], [x * y - z])
    np.testing.assert_array_equal(np.array(function(a, b, c)).ravel(), a * b - c)
