"""The symbolic linear algebra against numpy.linalg on random matrices."""

import casadi as ca
import numpy as np
import pytest

from fzcli.model import algebra

SIZES = range(1, 7)


def _matrices(rows: int, columns: int, count: int) -> list[np.ndarray]:
    rng = np.random.default_rng((rows, columns))
    return [rng.standard_normal((rows, columns)) for _ in range(count)]


@pytest.mark.parametrize("m", SIZES)
def test_symmetric_inverse(m: int) -> None:
    A = ca.SX.sym("A", m, m)
    inverse = ca.Function("f", [A], [algebra.symmetric_inverse(A)])
    for B in _matrices(m, m, 50):
        S = B @ B.T + 0.1 * np.eye(m)
        seen = np.array(inverse(S))
        np.testing.assert_allclose(seen @ S, np.eye(m), atol=1e-13 * np.linalg.cond(S))
        np.testing.assert_array_equal(seen, seen.T)


@pytest.mark.parametrize("m", SIZES)
@pytest.mark.parametrize("n", [4, 7])
def test_damped_pseudo_inverse_and_projector(m: int, n: int) -> None:
    J = ca.SX.sym("J", m, n)
    function = ca.Function(
        "f", [J], [algebra.damped_pseudo_inverse(J, 1e-2), algebra.null_space_projector(J, 1e-2)]
    )
    for value in _matrices(m, n, 20):
        plus, projector = (np.array(part) for part in function(value))
        expected = value.T @ np.linalg.inv(value @ value.T + 1e-2 * np.eye(m))
        np.testing.assert_allclose(plus, expected, atol=1e-11)
        np.testing.assert_allclose(projector, np.eye(n) - expected @ value, atol=1e-11)


@pytest.mark.parametrize(("m", "n"), [(1, 4), (2, 4), (3, 4), (3, 7), (6, 4), (6, 6), (6, 7)])
def test_smallest_singular_value(m: int, n: int) -> None:
    J = ca.SX.sym("J", m, n)
    function = ca.Function("f", [J], [algebra.smallest_singular_value(J)])
    for value in _matrices(m, n, 50):
        expected = np.linalg.svd(value, compute_uv=False)[-1]
        scale = np.linalg.norm(value)
        assert float(function(value)) == pytest.approx(expected, abs=1e-6 * scale), value.tolist()


def test_smallest_singular_value_of_equal_ones_and_of_a_singular_matrix() -> None:
    J = ca.SX.sym("J", 3, 4)
    function = ca.Function("f", [J], [algebra.smallest_singular_value(J)])
    equal = 2.5 * np.eye(3, 4)
    assert float(function(equal)) == pytest.approx(2.5, abs=1e-5)
    singular = np.vstack([equal[:2], equal[0] + equal[1]])
    assert float(function(singular)) == pytest.approx(0.0, abs=1e-6)
