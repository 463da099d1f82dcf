"""References of the tip and the base: end points, rest, and rates that are the derivatives."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import fzcli
from fzcli.plan.registry import BASE_REFERENCES, TIP_REFERENCES
from fzcli.plan.time_laws.registry import TIME_LAWS
from tests.oracle.numpy_reference import quat_exp, quat_multiply, rotation_from_quat, rotation_vector

Array = NDArray[np.float64]
MODEL = fzcli.build_model(fzcli.load_robot("bulgarelli4"))
Q, BASE = np.array([0.4, -1.2, 0.3, 0.5]), np.array([1.0, 0.0, 0.0, 0.0])
START = (np.array([0.4, -0.2, 0.9]), quat_exp(np.array([0.3, 0.1, -0.4])), np.array([0.05, 0.1, 0.2]))
LINE = {"direction": (1.0, 2.0, -2.0), "length": 0.6, "duration": 8.0, "turn": (0.3, -0.5, 0.2)}
POINTS = ((0.1, 0.0, 0.0), (0.1, 0.2, 0.0), (0.0, 0.2, 0.3))
WAYPOINTS = {
    "points": POINTS,
    "relative": True,
    "durations": (2.0, 3.0, 1.5),
    "turns": ((0.1, 0, 0), (0, 0.4, 0.2), (0, 0, -1.0)),
}


class Motion:
    """A reference as plain numbers: pose and rates at a time."""

    def __init__(self, kind: str, fields: dict[str, Any]) -> None:
        entry = TIP_REFERENCES[kind]
        spec = entry.spec.model_validate(fields)
        self.reference = entry.build(spec, MODEL, None)
        values = [np.ravel(spec.value_at(p.path.removeprefix("reference."))) for p in self.reference.parameters]
        assert [len(v) for v in values] == [p.size for p in self.reference.parameters]
        self.parameters = np.concatenate(values) if values else np.zeros(0)
        self.constants = self.reference.prepare(self.parameters, Q, BASE, *START)

    def at(self, time: float) -> list[Array]:
        return [np.array(v).ravel() for v in self.reference.evaluate(time, self.constants)]

    @property
    def duration(self) -> float:
        return float(self.reference.duration(self.parameters))


CASES = {"line": LINE, "waypoints": WAYPOINTS, "hold": {}}


def test_the_345_law_has_its_published_constants() -> None:
    """Velocity 1.875 at the middle, acceleration 5.7735 at 0.2113, jerk 60 at the ends (T = 1)."""
    law = TIME_LAWS["3-4-5"]
    phase = np.linspace(0, 1, 100_001)
    s, rate = np.array([[float(v) for v in law(p)] for p in phase[::100]]).T
    fine = np.array([float(law(p)[1]) for p in phase[20_000:22_500:5]])
    assert s[0] == 0.0
    assert s[-1] == pytest.approx(1.0, abs=1e-15)
    assert float(law(0.5)[0]) == pytest.approx(0.5, abs=1e-15)
    assert rate.max() == pytest.approx(1.875, abs=1e-12)
    acceleration = np.diff(fine) / 5e-5
    assert acceleration.max() == pytest.approx(10 / np.sqrt(3), rel=1e-6)
    h = 1e-4
    assert (float(law(h)[1]) / h**2) == pytest.approx(30.0, rel=1e-3)  # s''' = 60
    assert float(law(0.4)[0]) == pytest.approx(0.31744, abs=1e-12)
    assert [float(v) for v in law(-0.3)] == [0.0, 0.0]
    assert [float(v) for v in law(1.3)] == [1.0, 0.0]


def test_a_line_ends_where_it_should() -> None:
    motion = Motion("line", LINE)
    assert motion.duration == 8.0
    begin, end, later = motion.at(0.0), motion.at(8.0), motion.at(11.0)
    np.testing.assert_allclose(begin[0], START[0], atol=1e-15)
    np.testing.assert_allclose(end[0], START[0] + 0.6 * np.array([1, 2, -2]) / 3, atol=1e-15)
    np.testing.assert_allclose(end[2], quat_multiply(quat_exp(np.array(LINE["turn"])), START[1]), atol=1e-15)
    for sample in (begin, end, later):
        np.testing.assert_allclose([*sample[1], *sample[3]], 0.0, atol=1e-15)
    np.testing.assert_allclose(later[0], end[0], atol=1e-15)


def test_waypoints_are_passed_at_rest() -> None:
    motion = Motion("waypoints", WAYPOINTS)
    assert motion.duration == 6.5
    turned = START[1]
    for point, turn, time in zip(POINTS, WAYPOINTS["turns"], np.cumsum(WAYPOINTS["durations"]), strict=True):
        position, velocity, quat, rate = motion.at(float(time))
        turned = quat_multiply(quat_exp(np.array(turn, dtype=float)), turned)
        np.testing.assert_allclose(position, START[0] + point, atol=1e-14)
        np.testing.assert_allclose(quat, turned, atol=1e-14)
        np.testing.assert_allclose([*velocity, *rate], 0.0, atol=1e-13)


def test_world_waypoints_count_from_the_world_s_origin() -> None:
    """The loop's positions are relative to the CoM at the start."""
    motion = Motion("waypoints", {"points": ((1.0, 2.0, 3.0),), "durations": (2.0,)})
    np.testing.assert_allclose(motion.at(2.0)[0], np.array([1.0, 2.0, 3.0]) - START[2], atol=1e-15)


def test_hold_stays_for_ever() -> None:
    motion = Motion("hold", {})
    assert motion.duration == np.inf
    for time in (0.0, 3.0, 1e6):
        position, velocity, quat, rate = motion.at(time)
        np.testing.assert_array_equal(position, START[0])
        np.testing.assert_array_equal(quat, START[1])
        np.testing.assert_array_equal([*velocity, *rate], 0.0)


@pytest.mark.parametrize("kind", list(CASES))
def test_rates_are_the_derivatives(kind: str) -> None:
    motion, h = Motion(kind, CASES[kind]), 1e-6
    end = motion.duration if np.isfinite(motion.duration) else 5.0
    for time in np.random.default_rng(4).uniform(0.01, end - 0.01, 40):
        before, now, after = (motion.at(time + shift) for shift in (-h, 0.0, h))
        np.testing.assert_allclose(now[1], (after[0] - before[0]) / (2 * h), atol=1e-8)
        turned = rotation_from_quat(after[2]) @ rotation_from_quat(before[2]).T
        np.testing.assert_allclose(now[3], rotation_vector(turned) / (2 * h), atol=1e-8)
        assert np.linalg.norm(now[2]) == pytest.approx(1.0, abs=1e-14)


def test_base_references() -> None:
    start = np.array([0.1, -0.2, 0.3])
    hold = BASE_REFERENCES["hold"]
    held = hold.build(hold.spec())
    angles, rates = held.evaluate(4.0, held.prepare(np.zeros(0), start))
    np.testing.assert_array_equal(np.array(angles).ravel(), start)
    np.testing.assert_array_equal(np.array(rates).ravel(), 0.0)
    turn = BASE_REFERENCES["turn"]
    reference = turn.build(turn.spec(angles=(0.4, 0.0, -0.1), duration=5.0))
    constants = reference.prepare(np.array([0.4, 0.0, -0.1, 5.0]), start)

    def at(time: float) -> tuple[Array, Array]:
        angles, rates = reference.evaluate(time, constants)
        return np.array(angles).ravel(), np.array(rates).ravel()

    np.testing.assert_allclose(at(0.0)[0], start, atol=1e-15)
    np.testing.assert_allclose(at(9.0)[0], [0.4, 0.0, -0.1], atol=1e-15)
    for time in (0.7, 2.5, 4.1):
        difference = (at(time + 1e-6)[0] - at(time - 1e-6)[0]) / 2e-6
        np.testing.assert_allclose(at(time)[1], difference, atol=1e-8)


def test_waypoints_say_which_count_is_wrong() -> None:
    spec = TIP_REFERENCES["waypoints"].spec
    with pytest.raises(ValueError, match="durations has 1 entries for 2 points"):
        spec.model_validate({"points": POINTS[:2], "durations": (1.0,)})
    with pytest.raises(ValueError, match="turns has 1 entries for 2 points"):
        spec.model_validate({"points": POINTS[:2], "durations": (1.0, 1.0), "turns": ((0, 0, 0),)})
    with pytest.raises(ValueError, match=r"every duration must be above 0 s"):
        spec.model_validate({"points": POINTS[:2], "durations": (1.0, 0.0)})
    with pytest.raises(ValueError, match="a direction of zero length points nowhere"):
        TIP_REFERENCES["line"].spec.model_validate({**LINE, "direction": (0.0, 0.0, 0.0)})
