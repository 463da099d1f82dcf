"""Small symbolic linear algebra, branch free: symmetric solves, pseudo-inverse, singular values."""

import casadi as ca


def cross(a: ca.SX, b: ca.SX) -> ca.SX:
    """a x b, (3)."""
    return ca.vertcat(
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def dot(a: ca.SX, b: ca.SX) -> ca.SX:
    """The sum of a_i b_i."""
    total = a[0] * b[0]
    for i in range(1, a.shape[0]):
        total = total + a[i] * b[i]
    return total


def angle_between(a: ca.SX, b: ca.SX) -> ca.SX:
    """The angle [rad] of two directions of any length, precise for small ones."""
    across = cross(a, b)
    return ca.atan2(ca.sqrt(dot(across, across)), dot(a, b))


def rotate(R: ca.SX, v: ca.SX) -> ca.SX:
    """R v with structural zeros and ones folded away, (3)."""
    return ca.vertcat(*(R[i, 0] * v[0] + R[i, 1] * v[1] + R[i, 2] * v[2] for i in range(3)))


def gram(J: ca.SX) -> ca.SX:
    """J J^T, (m, m), each entry of the symmetric pair computed once."""
    m = J.shape[0]
    A = ca.SX(m, m)
    for i in range(m):
        for j in range(i, m):
            A[i, j] = A[j, i] = dot(J[i, :].T, J[j, :].T)
    return A


def symmetric_inverse(A: ca.SX) -> ca.SX:
    """Inverse of a symmetric positive definite matrix, (m, m) for m = 1..6.

    By the adjugate for m <= 3 (one division); by L D L^T, unrolled, above.
    """
    m = A.shape[0]
    if m == 1:
        return 1 / A
    if m == 2:
        scale = 1 / (A[0, 0] * A[1, 1] - A[0, 1] * A[0, 1])
        off = -A[0, 1] * scale
        return ca.vertcat(ca.horzcat(A[1, 1] * scale, off), ca.horzcat(off, A[0, 0] * scale))
    if m == 3:
        a, b, c, d, e, f = A[0, 0], A[0, 1], A[0, 2], A[1, 1], A[1, 2], A[2, 2]
        xx, xy, xz = d * f - e * e, c * e - b * f, b * e - c * d
        scale = 1 / (a * xx + b * xy + c * xz)
        xx, xy, xz = xx * scale, xy * scale, xz * scale
        yy, yz, zz = (a * f - c * c) * scale, (b * c - a * e) * scale, (a * d - b * b) * scale
        return ca.vertcat(ca.horzcat(xx, xy, xz), ca.horzcat(xy, yy, yz), ca.horzcat(xz, yz, zz))
    return _inverse_by_ldl(A)


def _inverse_by_ldl(A: ca.SX) -> ca.SX:
    m = A.shape[0]
    unit_lower = ca.SX.eye(m)
    pivot: list[ca.SX] = []
    for j in range(m):
        weighted = [unit_lower[j, k] * pivot[k] for k in range(j)]
        pivot.append(A[j, j] - sum(unit_lower[j, k] * weighted[k] for k in range(j)))
        reciprocal = 1 / pivot[j]
        for i in range(j + 1, m):
            unit_lower[i, j] = (A[i, j] - sum(unit_lower[i, k] * weighted[k] for k in range(j))) * reciprocal
    inverse_lower = ca.SX.eye(m)
    for j in range(m):
        for i in range(j + 1, m):
            inverse_lower[i, j] = -sum(unit_lower[i, k] * inverse_lower[k, j] for k in range(j, i))
    result = ca.SX(m, m)
    for i in range(m):
        for j in range(i, m):
            result[i, j] = result[j, i] = sum(
                inverse_lower[k, i] * inverse_lower[k, j] / pivot[k] for k in range(j, m)
            )
    return result


def symmetric_solve(A: ca.SX, b: ca.SX) -> ca.SX:
    """x (m) of A x = b for a symmetric positive definite A (m, m) of any size, by L D L^T unrolled."""
    m = A.shape[0]
    lower: list[list[ca.SX]] = [[] for _ in range(m)]
    pivot: list[ca.SX] = []
    x: list[ca.SX] = []
    for i in range(m):
        weighted: list[ca.SX] = []  # L_ij d_j
        for j in range(i):
            entry = A[i, j]
            for k in range(j):
                entry = entry - weighted[k] * lower[j][k]
            weighted.append(entry)
            lower[i].append(entry * pivot[j])
        diagonal, right = A[i, i], b[i]
        for j in range(i):
            diagonal = diagonal - lower[i][j] * weighted[j]
            right = right - lower[i][j] * x[j]
        pivot.append(1 / diagonal)
        x.append(right)
    x = [value * scale for value, scale in zip(x, pivot, strict=True)]
    for i in reversed(range(m)):
        for k in range(i + 1, m):
            x[i] = x[i] - lower[k][i] * x[k]
    return ca.vertcat(*x)


def damped_pseudo_inverse(J: ca.SX, damping: float) -> ca.SX:
    """J^T (J J^T + damping E)^-1, (n, m), for J (m, n), m = 1..6; ``damping`` is lambda squared."""
    return ca.mtimes(J.T, symmetric_inverse(gram(J) + damping * ca.SX.eye(J.shape[0])))


def null_space_projector(J: ca.SX, damping: float) -> ca.SX:
    """E - J+ J, (n, n), with the damped J+."""
    return ca.SX.eye(J.shape[1]) - ca.mtimes(damped_pseudo_inverse(J, damping), J)


def smallest_singular_value(J: ca.SX, sweeps: int = 5) -> ca.SX:
    """The smallest of the min(m, n) singular values of J (m, n), to rounding.

    One-sided Jacobi (Hestenes): pairs of the shorter side's vectors are turned until all are
    orthogonal; their lengths are the singular values, equal ones and small ones alike.
    """
    short = J if J.shape[0] <= J.shape[1] else J.T
    rows = [short[i, :].T for i in range(short.shape[0])]
    for _ in range(sweeps):
        for i in range(len(rows)):
            for j in range(i + 1, len(rows)):
                rows[i], rows[j] = _orthogonal(rows[i], rows[j])
    smallest = dot(rows[0], rows[0])
    for row in rows[1:]:
        smallest = ca.fmin(smallest, dot(row, row))
    return ca.sqrt(smallest)


def _orthogonal(a: ca.SX, b: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Two vectors turned in their own plane by at most 45 deg, so that they stand at right angles."""
    both, apart = 2 * dot(a, b), dot(b, b) - dot(a, a)
    size = ca.fabs(apart) + ca.sqrt(apart * apart + both * both)
    tangent = ca.if_else(apart < 0, -both, both) / ca.fmax(size, 1e-300)
    c = 1 / ca.sqrt(1 + tangent * tangent)
    s = c * tangent
    return c * a - s * b, s * a + c * b
