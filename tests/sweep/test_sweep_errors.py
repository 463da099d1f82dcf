"""Sweeps that make no sense are refused in words, before anything is run or as soon as it shows."""

from typing import Any

import pytest

from fzcli.errors import SpecError
from fzcli.spec.document import document_of
from fzcli.sweep.execute import run_sweep
from fzcli.sweep.resolve import resolve
from fzcli.sweep.trajectories import FilterError
from tests.loop.cases import raw_run

pytestmark = pytest.mark.usefixtures("machine")
LENGTH = {"reference.length": {"uniform": [0.1, 0.2]}}


def sweep_data(**changes: Any) -> dict[str, Any]:
    """A sweep of a short run as plain data."""
    return {**raw_run(duration=0.05), "kind": "sweep", "trajectories": {"count": 2, "seed": 1}, **changes}


def _drawing(draw: dict[str, Any]) -> dict[str, Any]:
    return sweep_data(trajectories={"count": 2, "draw": draw})


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (sweep_data(grid={"controller.gian": [1, 2]}), "controller.gian: unknown key; did you mean 'gain'?"),
        (sweep_data(grid={"controler.gain": [1, 2]}), "controler: unknown key; did you mean 'controller'?"),
        (sweep_data(grid={"controller.gain": 3}), "grid.controller.gain: must be a list, got 3"),
        (sweep_data(grid={"controller.gain": []}), "grid.controller.gain: needs at least 1 item, has 0"),
        (sweep_data(list=[{"stepp": 0.01}]), "stepp: unknown key; did you mean 'step'?"),
        (sweep_data(trajectoris={}), "trajectoris: unknown key; did you mean 'trajectories'?"),
        (
            sweep_data(controller={"kind": "clik", "gain": 1, "dampign": 1}),
            "controller.dampign: unknown key; did you mean 'damping'?",
        ),
        (sweep_data(trajectories={"count": 0}), "trajectories.count: must be >= 1, got 0"),
        (
            _drawing({"controller.kind": {"choice": ["clik", "unconstrained"]}}),
            "trajectories.draw.controller.kind: is not a field of numbers; only those can be drawn",
        ),
        (
            _drawing({"reference.length": {"unifrm": [0, 1]}}),
            "trajectories.draw.reference.length: unknown distribution 'unifrm'; did you mean 'uniform'?",
        ),
        (
            _drawing({"reference.length": {"uniform": [1, 0.5]}}),
            "trajectories.draw.reference.length.uniform: the lower end 1 lies above the upper 0.5",
        ),
        (_drawing({"reference.length": {"uniform": [1, 2, 3]}}), "uniform takes 2 entries, got 3"),
        (_drawing({"reference.direction": {"sphere": 4}}), "sphere takes the number of dimensions, 2 or 3"),
        (_drawing({"reference.length": {"log_uniform": [0, 1]}}), "log_uniform needs ends above 0"),
        (_drawing({"reference.lenght": {"uniform": [0, 1]}}), "reference.lenght: unknown key; did you mean 'length'?"),
        (
            _drawing({"start.q": {"uniform": [[0, 0, 0], [1, 1, 1]]}}),
            "start.q: has 3 values for 4 active joints (q1, q2, q3, q4)",
        ),
        (
            _drawing({"robot.base.mass": {"uniform": [10, 20]}}),
            "robot.base.mass: 'robot' is the single value 'bulgarelli4'; nothing lies inside it",
        ),
        (
            sweep_data(trajectories={"count": 1, "draw": LENGTH, "keep_if": {"that": ["tip_error_max << 0"]}}),
            "trajectories.keep_if.that: must be METRIC < NUMBER (or <=, >, >=), got 'tip_error_max << 0'",
        ),
        (raw_run(), "kind: sweep is wanted, got 'simulate'"),
    ],
)
def test_a_bad_sweep_is_refused_in_words(data: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        resolve(document_of(data))
    assert text in str(caught.value)


def test_problems_of_all_configurations_are_told_at_once() -> None:
    with pytest.raises(SpecError) as caught:
        resolve(document_of(sweep_data(grid={"controller.gain": [-1, 5, -2]})))
    assert len(caught.value.problems) == 2


def _filtered(that: str) -> dict[str, Any]:
    keep_if = {"with": {"controller.kind": "unconstrained"}, "that": [that], "most": 3}
    return sweep_data(trajectories={"count": 2, "first": 7, "draw": LENGTH, "keep_if": keep_if})


def test_a_filter_on_an_unknown_metric_names_those_there_are() -> None:
    with pytest.raises(SpecError) as caught:
        run_sweep(resolve(document_of(_filtered("tip_eror_max < 1"))))
    text = "trajectories.keep_if.that.0: no metric 'tip_eror_max'; did you mean 'tip_error_max'?"
    assert str(caught.value) == f"<python>: {text}"


def test_a_filter_that_lets_nothing_through_says_so() -> None:
    with pytest.raises(FilterError) as caught:
        run_sweep(resolve(document_of(_filtered("tip_error_max < 0"))))
    assert str(caught.value) == (
        "trajectories.keep_if: trajectory 7 passed none of 3 candidates (0 of 2 trajectories found); "
        "loosen the conditions"
    )


def test_a_sweep_without_end_needs_a_duration() -> None:
    data = sweep_data(reference={"kind": "hold"})
    del data["duration"]
    with pytest.raises(SpecError, match=r"^[^:]+: duration: is missing: the reference 'hold' has no end of its own$"):
        run_sweep(resolve(document_of(data)))


def test_a_field_both_drawn_and_in_the_grid_is_refused() -> None:
    data = _drawing({"controller.gain": {"uniform": [5, 6]}}) | {"grid": {"controller.gain": [1, 2]}}
    with pytest.raises(SpecError, match=r"controller\.gain"):
        resolve(document_of(data))


def test_ranking_by_an_unknown_metric_is_refused() -> None:
    with pytest.raises((SpecError, FilterError), match="tip_eror_mean"):
        run_sweep(resolve(document_of(sweep_data(record={"rank_by": "tip_eror_mean"}))))


def test_drawing_one_component_of_a_list_works_or_is_refused() -> None:
    try:
        record = run_sweep(resolve(document_of(_drawing({"start.q.1": {"uniform": [-1.4, -1.3]}}))))
    except SpecError:
        return
    assert record.draws["start.q.1"].shape == (2, 1)


def test_drawn_bounds_are_those_that_judge_or_are_refused() -> None:
    try:
        record = run_sweep(resolve(document_of(_drawing({"bounds.tip_error": {"choice": [1e-12, 1.0]}}))))
    except SpecError:
        return
    judged = (record.metrics["tip_error_max"] > record.draws["bounds.tip_error"][:, 0]).astype(int)
    assert judged.tolist() == record.metrics["status"].tolist()


def test_drawn_and_swept_fields_carry_their_units() -> None:
    data = sweep_data(
        trajectories={"count": 2, "draw": {"start.q": {"uniform": [[0.9] * 4, [1.0] * 4]}, **LENGTH}},
        grid={"controller.gain": [1, 2]},
    )
    info = run_sweep(resolve(document_of(data))).metric_info
    assert info["start.q"].unit == "rad or m"
    assert info["reference.length"].unit == "m"
    assert info["controller.gain"].unit == "1/s"
