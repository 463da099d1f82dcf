"""Bad runs are refused in words; runs that fail end with a status, their data and advice."""

import re
from typing import Any

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.loop.rollout import Rollout
from fzcli.loop.run_file import run_of
from fzcli.loop.simulate import simulate
from fzcli.spec.reader import read_text
from tests.loop.cases import run_spec

pytestmark = pytest.mark.usefixtures("machine")
STRETCHED = [0.0, -np.pi / 2, np.pi / 2, 0.0]  # all links along z


def _assert_whole(rollout: Rollout) -> None:
    """All arrays are cut at the stop; what stands before it is finite."""
    length = len(rollout.time)
    arrays = [rollout.q, rollout.qd, rollout.base_quat, rollout.tip_position, *rollout.signals.values()]
    assert {len(array) for array in arrays} == {length}
    assert rollout.metrics["n_steps"] == length - 1
    for array in arrays:
        assert np.isfinite(array[: length - 1]).all()


def test_a_gain_beyond_reason_diverges_and_keeps_its_data() -> None:
    rollout = simulate(run_spec(controller__gain=1e12))
    assert rollout.status.name == "failed"
    assert rollout.status.code == 2
    assert re.match(r"diverged at 0\.\d+ s: a step moved joints and base by more than", rollout.status.reason)
    assert rollout.status.advice == "lower controller.gain or step; the data up to here is kept"
    assert 1 < len(rollout.time) < 100
    _assert_whole(rollout)


def test_no_damping_at_a_singular_start_diverges() -> None:
    rollout = simulate(run_spec(controller__damping=0, start__q=STRETCHED, reference__direction=[0, 0, 1]))
    assert rollout.status.name == "failed"
    assert rollout.status.reason.startswith("diverged at 0.01 s")
    assert rollout.certificate["singular_value_min"] < 1e-6
    _assert_whole(rollout)


def test_damping_keeps_a_singular_start_from_diverging() -> None:
    rollout = simulate(run_spec(controller__damping=1e-2, start__q=STRETCHED, reference__direction=[0, 0, -1]))
    assert rollout.status.name != "failed"
    assert len(rollout.time) == 1001


def test_a_lost_tip_is_flagged_with_advice() -> None:
    rollout = simulate(run_spec(reference__length=30.0, duration=4.0, controller__damping=1e-2))
    assert rollout.status.name == "flagged"
    assert re.fullmatch(r"tip_error_max [\d.e+-]+ breaks the bound 0\.01", rollout.status.reason)
    assert rollout.status.advice.startswith("the tip lost its reference: lower the gain")


def test_bounds_are_the_spec_s() -> None:
    assert simulate(run_spec(duration=1.0)).status.name == "ok"
    strict = simulate(run_spec(duration=1.0, bounds={"tip_error": 1e-12}))
    assert strict.status.reason.endswith("breaks the bound 1e-12")
    narrow = simulate(run_spec(duration=1.0, bounds={"singular_value": 0.9}))
    assert narrow.status.reason.startswith("singular_value_min 0.1")
    assert "controller.damping" in narrow.status.advice
    assert simulate(run_spec(reference__length=30.0, duration=4.0, controller__damping=1e-2,
                             bounds={"tip_error": None})).status.name == "ok"  # fmt: skip


@pytest.mark.parametrize("turned", [False, True])
def test_a_pitch_of_ninety_degrees_stops_by_name(turned: bool) -> None:
    turn = {"kind": "turn", "angles": [0.3, 1.0, 0.5], "duration": 5.0}
    changes: dict[str, Any] = {"base_reference": turn} if turned else {}
    rollout = simulate(run_spec(start__base_rpy=[0.0, "90 deg", 0.0], controller__constraint=["pitch"], **changes))
    assert rollout.status.name == "failed"
    assert rollout.status.reason.startswith("angle_singularity at 0 s: the base's pitch came within")
    assert "controller.constraint: [rotation_vector]" in rollout.status.advice
    assert len(rollout.time) == 1


def test_the_rotation_vector_has_no_such_attitude() -> None:
    """The calm line, turned with the base."""
    changes = {"start__base_rpy": [0.0, "90 deg", 0.0], "reference__direction": [-0.5, 0.2, -1.0]}
    rollout = simulate(run_spec(controller__constraint=["rotation_vector"], **changes))
    assert rollout.status.name == "ok"
    assert rollout.metrics["tip_error_max"] < 1e-3


def test_every_stop_has_words() -> None:
    """Divergence and the singular pitch may fall on one sample."""
    for gain in (1e14, 1e25, 1e60):
        rollout = simulate(
            run_spec(start__base_rpy=[0.0, "89.9999999 deg", 0.0], controller__gain=gain, base_reference={
                "kind": "turn", "angles": [0.3, 1.0, 0.5], "duration": 0.01})
        )  # fmt: skip
        assert rollout.status.name == "failed"
        assert rollout.status.advice


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"start__q": [1, 2, 3]}, "start.q: has 3 values for 4 active joints (q1, q2, q3, q4)"),
        ({"controller__tip": "hnad"}, "controller.tip: the robot has no tip 'hnad'; it has hand"),
        (
            {"controller__gain": [1, 2, 3], "controller__constraint": ["roll", "yaw"]},
            "controller: gain has 3 numbers for 2 constrained axes (roll, yaw)",
        ),
        ({"controller__gain": -1}, "controller.gain: must be >= 0"),
        ({"controller__kind": "click"}, "controller.kind: unknown kind 'click'; did you mean 'clik'?"),
        ({"controller__dampign": 1e-8}, "controller.dampign: unknown key; did you mean 'damping'?"),
        (
            {"controller__constraint": ["rotation_vector", "yaw"]},
            "controller.constraint: rotation_vector holds all three axes; it stands alone",
        ),
        ({"controller__constraint": ["yaw", "yaw"]}, "controller.constraint: an angle stands twice"),
        ({"start__base_quat": [1, 1, 0, 0]}, "start: base_quat must have length 1, it has 1.41421"),
        (
            {"start__base_quat": [1, 0, 0, 0], "start__base_rpy": [0, 0, 0]},
            "start: give base_quat or base_rpy, not both",
        ),
        ({"reference__length": float("nan")}, "reference.length: must be a finite number, got nan"),
        ({"reference__duration": "5 m"}, "reference.duration"),
        ({"duration": 0}, "duration: must be > 0, got 0"),
        ({"step": "-1 ms"}, "step"),
        ({"robot": "bulgarelli5"}, "bulgarelli4"),
    ],
)
def test_a_bad_run_is_refused_in_words(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        run_spec(**changes)
    assert text in str(caught.value)


def test_numbers_that_are_none_are_shown_in_their_places() -> None:
    text = (
        "kind: simulate\nrobot: bulgarelli4\nstart: {q: [0, 0, 0, 0]}\n"
        "reference: {kind: line, direction: [1, .nan, 0], length: .inf, duration: 3 s}\n"
        "controller: {kind: clik, gain: 1}\n"
    )
    with pytest.raises(SpecError) as caught:
        run_of(read_text(text))
    first, second = caught.value.problems
    assert (first.field, first.line, first.column) == ("reference.direction.1", 4, 40)
    assert first.message == "must be a finite number, got nan"
    assert (second.field, second.message) == ("reference.length", "must be a finite number, got inf")


def test_a_reference_without_end_needs_a_duration() -> None:
    with pytest.raises(SpecError, match=r"^[^:]+: duration: is missing: the reference 'hold' has no end of its own$"):
        simulate(run_spec(reference={"kind": "hold"}))


def test_a_run_too_long_to_count_is_refused() -> None:
    with pytest.raises(SpecError, match=r"^duration: 1e\+09 steps in one run; at most 1e\+08 are run$"):
        simulate(run_spec(duration=1e7))


def test_a_rule_base_of_other_names_is_refused() -> None:
    spec = run_spec(controller__kind="fuzzy_clik")
    rulebase = spec.controller.rulebase
    other = rulebase.model_copy(update={"inputs": {"speed": rulebase.inputs["error"]}})
    with pytest.raises(ValueError, match="the rule base must map inputs error, oscillating to output increment"):
        type(spec.controller).model_validate({**dict(spec.controller), "rulebase": other})
