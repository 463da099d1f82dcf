"""Time laws, the half-cycloidal detour and joint paths: printed numbers, derivatives, smoothness, bounds."""

import math

import numpy as np
import pytest

from fzcli.plan.half_cycloid import bump, bump_acceleration, bump_rate
from fzcli.plan.joint_path import Detour, JointPath, fastest, law_values, paper_detour
from fzcli.plan.time_laws.registry import TIME_LAWS, TimeLawName

LAWS: list[TimeLawName] = list(TIME_LAWS)  # type: ignore[arg-type]


@pytest.mark.parametrize("law", LAWS)
def test_laws_go_from_rest_to_rest_with_their_derivatives(law: TimeLawName) -> None:
    found = TIME_LAWS[law]
    s, ds, dds = law_values(law, np.array([-0.5, 0.0, 0.5, 1.0, 1.7]))
    np.testing.assert_allclose(s, [0, 0, 0.5, 1, 1], atol=1e-15)
    np.testing.assert_allclose(ds[[0, 1, 3, 4]], 0, atol=1e-15)
    if found.smooth >= 2:
        np.testing.assert_allclose(dds[[0, 1, 3, 4]], 0, atol=1e-13)
    p = np.linspace(0.003, 0.997, 400)
    p = p[np.abs((p % (1 / 3)) - 1 / 6) < 0.166]  # away from the trapezoid's corners
    h = 1e-6
    s, ds, dds = law_values(law, p)
    ahead, behind = law_values(law, p + h), law_values(law, p - h)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), ds, atol=1e-8)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), dds, atol=1e-7)
    fine = law_values(law, np.linspace(0, 1, 200_001))
    assert fine[1].max() == pytest.approx(found.peak_speed, rel=1e-9)
    assert np.abs(fine[2]).max() == pytest.approx(found.peak_acceleration, rel=1e-8)


def test_345_has_the_printed_numbers() -> None:
    s, _, dds = law_values("3-4-5", np.array([0.4, 0.6, (3 - math.sqrt(3)) / 6]))
    np.testing.assert_allclose(s[:2], [0.31744, 0.68256], atol=1e-12)
    assert dds[2] == pytest.approx(5.773503, abs=5e-7)
    assert TIME_LAWS["3-4-5"].peak_speed == 1.875


def test_bump_has_the_printed_numbers_and_derivatives() -> None:
    np.testing.assert_allclose(bump(np.arange(5.0)), [0, 1, 2, 1, 0], atol=1e-15)
    np.testing.assert_allclose(bump(np.array([0.5, 1.5])), [0.1816901, 1.8183099], atol=5e-8)
    u, h = np.linspace(-0.5, 4.5, 2001), 1e-6
    np.testing.assert_allclose((bump(u + h) - bump(u - h)) / (2 * h), bump_rate(u), atol=1e-6)
    np.testing.assert_allclose((bump_rate(u + h) - bump_rate(u - h)) / (2 * h), bump_acceleration(u), atol=1e-5)
    assert np.abs(bump_rate(u)).max() == pytest.approx(2, abs=1e-5)
    assert np.abs(bump_acceleration(u)).max() == pytest.approx(np.pi, abs=1e-4)


def _path(rng: np.random.Generator, law: TimeLawName, detours: int, n: int = 4) -> JointPath:
    duration = rng.uniform(1, 6)
    added = []
    for _ in range(detours):
        begin, end = np.sort(rng.uniform(0, duration, 2))
        added.append(Detour(rng.normal(size=n), begin, end + 0.2, rng.choice([0.0, 0.3 * (end + 0.2 - begin)])))
    return JointPath(rng.normal(size=n), rng.normal(size=n), duration, law, tuple(added))


@pytest.mark.parametrize("law", [law for law in LAWS if TIME_LAWS[law].smooth >= 2])
def test_paths_are_twice_continuously_differentiable(law: TimeLawName) -> None:
    """At every knot, position, velocity and acceleration do not jump; elsewhere they are each other's derivatives."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        path = _path(rng, law, 3)
        knots = {0.0, path.duration}
        for detour in path.detours:
            middle, half = 0.5 * (detour.begin + detour.end), 0.5 * detour.dwell
            knots |= {detour.begin, detour.end, middle - half, middle + half}
        for knot in knots:
            below, above = path.at(knot - 1e-12), path.at(knot + 1e-12)
            for a, b, scale in zip(below, above, path.at(np.linspace(0, path.duration, 500)), strict=True):
                assert np.abs(a - b).max() <= 1e-9 * np.abs(scale).max()
        t = rng.uniform(0, path.duration, 200)
        h = 1e-6
        ahead, behind = path.at(t + h), path.at(t - h)
        _, qd, qdd = path.at(t)
        np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), qd, rtol=1e-5, atol=1e-6)
        np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), qdd, rtol=1e-4, atol=1e-3 * np.abs(qdd).max())


@pytest.mark.parametrize("law", LAWS)
def test_speed_bounds_hold_and_are_sharp_for_single_parts(law: TimeLawName) -> None:
    rng = np.random.default_rng(4)
    for detours in (0, 1, 3):
        for _ in range(30):
            path = _path(rng, law, detours)
            begin, end = np.sort(rng.uniform(0, path.duration, 2))
            fastest_met = np.abs(path.at(np.linspace(begin, end, 400))[1]).max(axis=0)
            bound = path.speed_bound(begin, end)
            assert (fastest_met <= bound * (1 + 1e-12) + 1e-15).all()
            if not detours:
                np.testing.assert_allclose(fastest_met, bound, rtol=2e-3)


def test_a_detour_peaks_where_it_should_and_leaves_the_rest_alone() -> None:
    peak = np.array([0.1, -0.3])
    plain = JointPath(np.zeros(2), np.ones(2), 4.0)
    path = JointPath(np.zeros(2), np.ones(2), 4.0, detours=(Detour(peak, 1.0, 3.0),))
    np.testing.assert_allclose(path.at(2.0)[0] - plain.at(2.0)[0], [peak], atol=1e-15)
    for time in (0.0, 0.5, 1.0, 3.0, 3.5, 4.0):
        for a, b in zip(path.at(time), plain.at(time), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-15)
    times = np.linspace(0, 4, 100_001)
    added = [a - b for a, b in zip(path.at(times), plain.at(times), strict=True)]
    np.testing.assert_allclose(np.abs(added[1]).max(axis=0), 4 * np.abs(peak) / 2.0, rtol=1e-8)
    np.testing.assert_allclose(np.abs(added[2]).max(axis=0), 8 * np.pi * np.abs(peak) / 2.0**2, rtol=1e-7)


def test_the_printed_equation_cannot_move_a_joint_that_does_not_travel() -> None:
    start, goal = np.array([0.0, 1.0]), np.array([2.0, 1.0])
    detour = paper_detour(start, goal, np.array([0.25, 5.0]), 1.0, 2.0)
    np.testing.assert_allclose(detour.peak, [1.0, 0.0])


@pytest.mark.parametrize("law", LAWS)
def test_the_fastest_duration_just_keeps_the_limits(law: TimeLawName) -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        start, goal = rng.normal(size=(2, 3))
        speeds, accelerations = rng.uniform(0.5, 2, 3), rng.uniform(0.5, 5, 3)
        duration = fastest(start, goal, speeds, accelerations, law)
        _, qd, qdd = JointPath(start, goal - start, duration, law).at(np.linspace(0, duration, 20_001))
        ratio = max((np.abs(qd).max(axis=0) / speeds).max(), (np.abs(qdd).max(axis=0) / accelerations).max())
        assert ratio == pytest.approx(1, abs=1e-6)
    assert fastest(np.zeros(2), np.array([1.0, 0.0]), np.array([np.inf, 0.0]), np.full(2, np.inf)) == 0.0
