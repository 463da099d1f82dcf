"""The reaction null space of Nenchev and Yoshida: the arm moves, the base keeps its attitude."""

import itertools
from typing import Any

import numpy as np
import pytest

from fzcli.errors import SpecError
from fzcli.loop.rollout import Rollout
from fzcli.loop.simulate import simulate
from tests.loop.cases import run_spec

pytestmark = pytest.mark.usefixtures("machine")
START = [0.3, -1.2, 1.0, -0.6, 0.8, 0.2]


def _run(**changes: Any) -> Rollout:
    reference = {"kind": "line", "direction": [1, 0.2, -0.5], "length": 0.1, "duration": 2.0}
    given = {"robot": "ur5_free_flyer", "start": {"q": START}, "reference": reference}
    controller = changes.pop("controller", {"kind": "reaction_null_space"})
    return simulate(run_spec(controller=controller, **{**given, **changes}))


@pytest.mark.parametrize(("method", "order"), [("euler", 1), ("midpoint", 2)])
def test_the_base_keeps_its_attitude_to_the_integrator_s_order(method: str, order: int) -> None:
    """The recorded base stands still; what the joints' path truly does to it shrinks with the step as the method."""
    runs = [_run(method=method, step=step) for step in (0.02, 0.01, 0.005)]
    for one in runs:
        assert np.abs(one.base_quat[:, 1:]).max() < 1e-11
        assert np.abs(np.diff(one.q, axis=0)).max() > 1e-4, "the arm moves"
    errors = [one.certificate["attitude_error_max"] for one in runs]
    for coarse, fine in itertools.pairwise(errors):
        assert 0.8 * 2**order < coarse / fine < 1.25 * 2**order
    spec = run_spec(robot="ur5_free_flyer", start={"q": START}, controller__kind="unconstrained", duration=2.0)
    free = simulate(spec)
    turned = 2 * np.linalg.norm(free.base_quat[:, 1:], axis=1).max()
    assert errors[0] < 0.02 * turned


def test_what_is_left_goes_to_the_tip() -> None:
    """Three joints hold the base, three move the tip along its line."""
    found = _run(method="midpoint")
    assert found.metrics["tip_error_max"] < 0.2 * 0.1


def test_errors_of_the_base_die_out_where_that_is_asked_for() -> None:
    kept, led = (
        _run(start={"q": START, "base_rpy": [0, 0, 0.01]}, base_reference=turn, controller={**kind, "base_gain": 5.0})
        for turn, kind in (
            ({"kind": "hold"}, {"kind": "reaction_null_space"}),
            ({"kind": "turn", "angles": [0, 0, 0.02], "duration": 1.0}, {"kind": "reaction_null_space"}),
        )
    )
    assert 2 * kept.base_quat[-1, 3] == pytest.approx(0.01, abs=1e-6)
    assert 2 * led.base_quat[-1, 3] == pytest.approx(0.02, abs=1e-4)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"robot": "planar3", "start": {"q": [0, 0.3, 0.5]}}, "controller.constraint: holds 3 base angles with 3"),
        ({"robot": "ur5"}, "controller.kind: a fixed base feels no reaction; take another kind"),
    ],
)
def test_robots_that_it_does_not_suit(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        _run(**changes)
    assert text in str(caught.value)
