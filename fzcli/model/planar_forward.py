"""Forward kinematics of the planar 3-RRR: every real pose of a platform on three rods of given ends."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_DEGREE = 3  # of the closing condition, as a trigonometric polynomial of the platform's angle
_SAMPLES = 16
_NEARLY_REAL = 1e-3  # imaginary part, over 1 + |t|^2, up to which a root is tried as a real one
_SAME = 1e-6  # m, rad: poses nearer than this are one
_CLOSED = 1e-12  # of the rods' squared length
_ROUNDS = 40


def platform_poses(ends: Array, corners: Array, rod: float) -> Array:
    """All real poses (k, 3) x, y [m], angle [rad] in (-pi, pi], k = 0..6, in the order of the angle.

    ``ends`` (3, 2) [m] are the elbows, ``corners`` (3, 2) [m] the platform's joints in its frame, ``rod``
    the length [m] between the two. The centre is eliminated by the differences of the three circles'
    equations, the rest is a polynomial of degree six in the tangent of half the angle (as of a planar
    3-RPR; Gosselin, Sefrioui and Richard 1992), whose roots are polished on the circles themselves.
    Poses that are not isolated (a platform congruent with the elbows' triangle) are not found.
    """
    found: list[Array] = []
    scale = max(float(np.abs(ends).max()), float(np.abs(corners).max()), rod)
    for angle in _angles(ends, corners, rod):
        for centre in _centres(ends, corners, rod, angle):
            pose = _polished(np.array([*centre, angle]), ends, corners, rod, scale)
            if pose is not None and not any(_distance(pose, other) < _SAME for other in found):
                found.append(pose)
    return np.array(sorted(found, key=lambda pose: float(pose[2]))).reshape(-1, 3)


def _offsets(ends: Array, corners: Array, angle: Array) -> tuple[Array, Array]:
    """w (..., 3): corner i minus end i as complex numbers when the centre is at 0; and |w|^2 in full."""
    ends_c, corners_c = ends[:, 0] + 1j * ends[:, 1], corners[:, 0] + 1j * corners[:, 1]
    w = np.exp(1j * angle)[..., None] * corners_c - ends_c
    return w, np.asarray((w * w.conj()).real)


def _closing(ends: Array, corners: Array, rod: float, angle: Array) -> Array:
    """Zero where the three circles meet in one point, at platform angles (m)."""
    w, square = _offsets(ends, corners, angle)
    one, two = w[..., 1] - w[..., 0], w[..., 2] - w[..., 0]
    first, second = square[..., 1] - square[..., 0], square[..., 2] - square[..., 0]
    D = 2 * (one.conj() * two).imag
    N = 1j * (first * two - second * one)  # centre = N / D
    start = w[..., 0]
    return np.asarray((N * N.conj()).real + 2 * D * (N * start.conj()).real + D * D * (square[..., 0] - rod * rod))


def _angles(ends: Array, corners: Array, rod: float) -> Array:
    """The real platform angles that may close the loops, and some that nearly do."""
    grid = 2 * np.pi * np.arange(_SAMPLES) / _SAMPLES
    values = _closing(ends, corners, rod, grid)
    size = float(np.abs(values).max())
    if size == 0.0:
        return np.zeros(0)
    middle = float(grid[np.argmax(np.abs(values))]) - np.pi  # what lies at infinity is no root
    fourier = np.fft.fft(values / size) / _SAMPLES
    polynomial = np.zeros(2 * _DEGREE + 1, dtype=complex)
    plus, minus = np.array([1j, 1.0]), np.array([-1j, 1.0])
    for k in range(-_DEGREE, _DEGREE + 1):
        factors = [plus] * (_DEGREE + k) + [minus] * (_DEGREE - k)
        term = np.array([1.0 + 0j])
        for factor in factors:
            term = np.polymul(term, factor)
        polynomial += fourier[k] * np.exp(1j * k * middle) * term
    roots = np.roots(polynomial.real)
    kept = roots[np.abs(roots.imag) < _NEARLY_REAL * (1 + np.abs(roots) ** 2)]
    return np.asarray(middle + 2 * np.arctan(kept.real))


def _centres(ends: Array, corners: Array, rod: float, angle: float) -> list[tuple[float, float]]:
    """Where the platform's centre may be at an angle: on the first circle, and on a line it shares with another."""
    w, square = _offsets(ends, corners, np.array(angle))
    gaps = w[1:] - w[0]
    j = int(np.argmax(np.abs(gaps)))
    length = float(abs(gaps[j]))
    if length == 0.0:
        return []
    along = gaps[j] / length
    foot = -float(square[j + 1] - square[0]) / (2 * length) * along
    offset = foot + w[0]
    half = float((offset * along.conj()).real)  # from the foot to the middle of the circle's chord
    across = float((offset * (1j * along).conj()).real)
    room = max(rod * rod - half * half, 0.0)
    points = [foot + (-across + sign * np.sqrt(room)) * 1j * along for sign in (1.0, -1.0)]
    return [(float(point.real), float(point.imag)) for point in points]


def _polished(pose: Array, ends: Array, corners: Array, rod: float, scale: float) -> Array | None:
    """The pose after Newton's method on the three circles; None where it does not end on them."""
    for _ in range(_ROUNDS):
        c, s = np.cos(pose[2]), np.sin(pose[2])
        arm = corners @ np.array([[c, s], [-s, c]])
        u = pose[:2] + arm - ends
        error = (u * u).sum(axis=1) - rod * rod
        if np.abs(error).max() <= 1e-15 * scale * scale:
            break
        A = np.column_stack([u, u[:, 1] * arm[:, 0] - u[:, 0] * arm[:, 1]])
        step = np.linalg.lstsq(A, -error / 2, rcond=1e-9)[0]
        size = float(np.abs(step).max())
        pose = pose + step * min(1.0, 0.5 * scale / max(size, 1e-300))
        if size <= 1e-16 * scale:
            break
    if np.abs(error).max() > _CLOSED * scale * scale:
        return None
    pose[2] = np.pi - np.remainder(np.pi - pose[2], 2 * np.pi)
    return pose


def _distance(one: Array, other: Array) -> float:
    turn = np.remainder(one[2] - other[2] + np.pi, 2 * np.pi) - np.pi
    return float(max(np.abs(one[:2] - other[:2]).max(), abs(turn)))
