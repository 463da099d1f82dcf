"""Sweeps: the same numbers whatever the jobs, and each row the run that its configuration and draw describe."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from fzcli.loop.compiler import find_compiler
from fzcli.loop.replay import ATTITUDE_ERROR
from fzcli.loop.simulate import simulate
from fzcli.record.sweep_record import SweepRecord
from fzcli.spec.document import document_of
from fzcli.sweep.builds import Builds, split
from fzcli.sweep.draws import candidate, generator
from fzcli.sweep.execute import run_sweep, unexpected_failures
from fzcli.sweep.resolve import Sweep, resolve, with_values
from fzcli.sweep.trajectories import draw_trajectories, trial_builds
from tests.loop.cases import raw_run

needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
DRAW = {
    "start.q": {"uniform": [[0.438, -1.883, -0.187, 0.059], [1.418, -0.903, 0.793, 1.039]]},
    "reference.direction": {"sphere": 3},
    "reference.length": {"uniform": [0.05, 0.2]},
    "reference.duration": {"uniform": ["1 s", "2 s"]},
}
KEEP = {"with": {"controller.kind": "unconstrained"}, "that": ["tip_error_max < 4e-4", "yaw_abs_max < 0.02"]}
GRID = {"controller.kind": ["clik", "fuzzy_clik"], "controller.gain": [10, 5000]}


def sweep_of(count: int = 6, **changes: Any) -> Sweep:
    """A small Table 2 on short lines."""
    trajectories = {"count": count, "seed": 2011, "draw": DRAW, **changes.pop("trajectories", {})}
    data = {**raw_run(), "kind": "sweep", "trajectories": trajectories, **changes}
    if "fuzzy_clik" in changes.get("grid", {}).get("controller.kind", []):
        data["controller"]["rulebase"] = "bulgarelli2011"
    for path in trajectories["draw"]:
        section, _, key = path.partition(".")
        if isinstance(data.get(section), dict):
            data[section] = {k: v for k, v in data[section].items() if k != key}
    return resolve(document_of(data))


def assert_same(a: SweepRecord, b: SweepRecord) -> None:
    """Bit for bit, kept runs and draws included."""
    assert a.configs == b.configs
    assert a.draw_info == b.draw_info
    for name in (*a.metrics, *b.metrics):
        assert a.metrics[name].tobytes() == b.metrics[name].tobytes(), name
    for path in a.draws:
        assert a.draws[path].tobytes() == b.draws[path].tobytes(), path
    for x, y in zip(a.kept, b.kept, strict=True):
        assert (x.config, x.trajectory, x.role) == (y.config, y.trajectory, y.role)
        assert x.rollout.q.tobytes() == y.rollout.q.tobytes()


@cache
def _filtered() -> tuple[Sweep, SweepRecord]:
    sweep = sweep_of(140, trajectories={"keep_if": KEEP}, grid=GRID)
    return sweep, run_sweep(sweep, jobs=1)


@needs_compiler
def test_jobs_do_not_matter() -> None:
    sweep, record = _filtered()
    assert len(record.metrics["status"]) == 4 * 140
    assert_same(run_sweep(sweep, jobs=2), record)


@needs_compiler
def test_a_trajectory_is_found_by_its_index_alone() -> None:
    """Rows 120..129 of the whole, the filter's rejected candidates included."""
    _, whole = _filtered()
    part = run_sweep(sweep_of(10, trajectories={"keep_if": KEEP, "first": 120}, grid=GRID))
    rows = np.concatenate([np.arange(120, 130) + c * 140 for c in range(4)])
    for name, values in part.metrics.items():
        assert values.tobytes() == whole.metrics[name][rows].tobytes(), name
    for path, values in part.draws.items():
        assert values.tobytes() == whole.draws[path][120:130].tobytes()
    assert part.metrics["trajectory"].tolist() == [*range(120, 130)] * 4


@needs_compiler
def test_the_filter_keeps_the_first_candidate_that_passes() -> None:
    sweep, record = _filtered()
    assert record.draw_info["accepted"] == 140
    assert 140 < record.draw_info["candidates"] < 140 * 50
    random = generator(2011, 0)
    while True:
        values = candidate(sweep.draws, random)
        assert sweep.filter is not None
        rollout = simulate(with_values(sweep.filter, split(sweep.draws, values)))
        if rollout.metrics["tip_error_max"] < 4e-4 and rollout.metrics["yaw_abs_max"] < 0.02:
            break
    for path, expected in split(sweep.draws, values).items():
        np.testing.assert_array_equal(record.draws[path][0], expected)


@needs_compiler
def test_candidates_that_end_early_are_those_that_do_not_pass() -> None:
    """The same draws after as many candidates as when every one of them is run to its end."""
    sweep, record = _filtered()
    early = draw_trajectories(sweep, trial_builds(sweep), range(140))
    whole = draw_trajectories(sweep, Builds(), range(140))
    assert early.values.tobytes() == whole.values.tobytes()
    assert early.candidates.tobytes() == whole.candidates.tobytes()
    assert whole.candidates.sum() == record.draw_info["candidates"]


@needs_compiler
def test_every_row_is_the_run_it_describes() -> None:
    """Pairs share their trajectory; each row equals a run simulated by itself, bit for bit."""
    sweep, record = _filtered()
    assert record.metrics["config"].tolist() == np.repeat(range(4), 140).tolist()
    for row in (0, 3 * 140 + 7, 140 + 139):
        config, trajectory = int(record.metrics["config"][row]), int(record.metrics["trajectory"][row])
        drawn = {path: values[trajectory] for path, values in record.draws.items()}
        rollout = simulate(with_values(sweep.specs[config], drawn))
        assert sweep.specs[config].controller.kind == record.configs[config]["controller.kind"]
        for name, values in record.metrics.items():
            if name in rollout.metrics:
                np.testing.assert_array_equal(values[row], rollout.metrics[name], err_msg=name)
        assert record.metrics["status"][row] == rollout.status.code


@needs_compiler
def test_kept_runs_are_best_median_and_worst() -> None:
    sweep, record = _filtered()
    assert len(record.kept) == 12
    rank = record.metrics["tip_error_mean"].reshape(4, 140)
    for kept in record.kept:
        values = np.sort(rank[kept.config])
        place = {"best": 0, "median": 69, "worst": 139}[kept.role]
        assert rank[kept.config, kept.trajectory] == values[place]
        drawn = {path: draws[kept.trajectory] for path, draws in record.draws.items()}
        if kept.config != 3:
            continue
        alone = simulate(with_values(sweep.specs[kept.config], drawn))
        for name in ("time", "q", "qd", "base_quat", "base_position", "tip_position"):
            assert getattr(alone, name).tobytes() == getattr(kept.rollout, name).tobytes(), name
        for name, values in alone.signals.items():
            assert values.tobytes() == kept.rollout.signals[name].tobytes(), name
        measured = {name: value for name, value in alone.metrics.items() if name != ATTITUDE_ERROR}  # of single runs
        assert measured == dict(kept.rollout.metrics)
        assert alone.status == kept.rollout.status


@needs_compiler
def test_the_machine_gives_the_same_sweep(request: pytest.FixtureRequest) -> None:
    small = sweep_of(8, trajectories={"keep_if": KEEP}, grid={"controller.kind": ["clik", "fuzzy_clik"]})
    compiled = run_sweep(small)
    request.getfixturevalue("machine")
    machine = run_sweep(small)
    assert (compiled.provenance.engine, machine.provenance.engine) == ("compiled", "vm")
    assert compiled.draw_info == machine.draw_info
    for name, values in compiled.metrics.items():
        np.testing.assert_allclose(machine.metrics[name], values, rtol=1e-7, atol=1e-12, err_msg=name)


@pytest.mark.usefixtures("machine")
class TestByTheMachine:
    """Small sweeps, run without compiling."""

    def test_the_order_of_the_keys_does_not_matter(self) -> None:
        turned = dict(reversed(DRAW.items()))
        a, b = (run_sweep(sweep_of(3, trajectories={"draw": draw})) for draw in (DRAW, turned))
        assert_same(a, b)

    def test_another_seed_is_another_sweep(self) -> None:
        a, b = (run_sweep(sweep_of(3, trajectories={"seed": seed})) for seed in (1, 2))
        assert not (a.draws["reference.length"] == b.draws["reference.length"]).any()

    def test_grid_and_list_combine(self) -> None:
        sweep = sweep_of(1, grid={"controller.gain": [1, 2]}, list=[{"step": "10 ms"}, {"step": "20 ms"}])
        assert sweep.changes == [
            {"step": step, "controller.gain": gain} for step in ("10 ms", "20 ms") for gain in (1, 2)
        ]
        assert [(s.step, s.controller.gain) for s in sweep.specs] == [(0.01, 1), (0.01, 2), (0.02, 1), (0.02, 2)]
        record = run_sweep(sweep)
        half = record.metrics["n_steps"][:2] / 2
        assert np.abs(record.metrics["n_steps"][2:] - half).max() <= 0.5

    def test_fields_that_are_built_in_may_be_drawn(self) -> None:
        """The step means a build for every value; the attitude and momentum are run-time numbers."""
        draw = {
            "step": {"choice": ["10 ms", "20 ms"]},
            "start.base_rpy": {"uniform": [["-10 deg", 0, 0], ["10 deg", 0, "5 deg"]]},
            "start.momentum.angular": {"uniform": [[-0.01, 0, 0.001], [0.01, 0, 0.002]]},
        }
        sweep = sweep_of(4, trajectories={"draw": draw})
        record = run_sweep(sweep)
        assert set(record.draws["step"].ravel()) == {0.01, 0.02}
        for i in range(4):
            drawn = {path: values[i] for path, values in record.draws.items()}
            rollout = simulate(with_values(sweep.specs[0], drawn))
            assert rollout.metrics["n_steps"] == record.metrics["n_steps"][i]
            for name in ("tip_error_mean", "yaw_abs_max", "angular_momentum_max"):
                np.testing.assert_allclose(record.metrics[name][i], rollout.metrics[name], rtol=1e-9)

    def test_distributions(self) -> None:
        draw = {
            "reference.length": {"log_uniform": ["1 mm", 0.1]},
            "reference.direction": {"sphere": 3},
            "controller.gain": {"choice": [3, 7]},
            "start.q": {"normal": [[0.9, -1.4, 0.3, 0.5], [0.01, 0.02, 0.0, 0.1]]},
        }
        record = run_sweep(sweep_of(300, duration=0.02, trajectories={"draw": draw}))
        length, q = record.draws["reference.length"].ravel(), record.draws["start.q"]
        assert 1e-3 <= length.min() < 1.5e-3
        assert 0.07 < length.max() <= 0.1
        assert np.median(length) == pytest.approx(1e-2, rel=0.6)
        np.testing.assert_allclose(np.linalg.norm(record.draws["reference.direction"], axis=1), 1.0, rtol=1e-14)
        assert np.abs(record.draws["reference.direction"].mean(axis=0)).max() < 0.12
        assert set(record.draws["controller.gain"].ravel()) == {3.0, 7.0}
        np.testing.assert_array_equal(record.metrics["gain_final"], record.draws["controller.gain"].ravel())
        np.testing.assert_allclose(q.mean(axis=0), [0.9, -1.4, 0.3, 0.5], atol=0.02)
        np.testing.assert_allclose(q.std(axis=0), [0.01, 0.02, 0.0, 0.1], rtol=0.15, atol=1e-12)

    def test_failed_runs_are_rows(self) -> None:
        grid = {"controller.gain": [10, 1e12]}
        excuses: list[tuple[Any, int]] = [
            (False, 4), (True, 0), ({"controller.gain": 1e12}, 0), ({"controller.gain": 10}, 4)
        ]  # fmt: skip
        for expected, unexpected in excuses:
            sweep = sweep_of(4, grid=grid, duration=1.0, expect_failures=expected)
            record = run_sweep(sweep)
            assert (record.metrics["status"][:4] != 2).all()
            assert (record.metrics["status"][4:] == 2).all()
            assert unexpected_failures(sweep, record) == unexpected
        assert (record.metrics["n_steps"][4:] < 100).all()
        worst = next(kept for kept in record.kept if kept.config == 1)
        assert worst.rollout.status.name == "failed"

    def test_a_lost_tip_is_flagged(self) -> None:
        record = run_sweep(sweep_of(3, duration=0.5, bounds={"tip_error": 1e-12}))
        assert record.metrics["status"].tolist() == [1] * 3

    def test_progress_is_told(self) -> None:
        told: list[tuple[str, int, int]] = []
        run_sweep(sweep_of(3, duration=0.05, trajectories={"keep_if": {"that": ["tip_error_max < 1"]}}),
                  tell=lambda *what: told.append(what))  # fmt: skip
        assert {what for what, _, _ in told} >= {"compiling", "running"}
        assert told[-1][0] == "recording"
        assert [t for t in told if t[0] == "running"][-1] == ("running", 3, 3)

    def test_waypoints_of_unlike_number_stand_side_by_side(self) -> None:
        way = {"kind": "waypoints", "relative": True}
        one = {"reference.points": [[0.1, 0, 0]], "reference.durations": [1]}
        two = {"reference.points": [[0.1, 0, 0], [0.1, 0.1, 0]], "reference.durations": [1, 2]}
        sweep = sweep_of(1, trajectories={"draw": {}}, reference={**way, "points": [[0, 0, 0]], "durations": [1]},
                         list=[one, two])  # fmt: skip
        assert run_sweep(sweep).metrics["n_steps"].tolist() == [100, 300]

    def test_whole_numbers_may_be_drawn(self) -> None:
        path = "controller.oscillation.average"
        sweep = sweep_of(4, duration=0.2, trajectories={"draw": {path: {"choice": [5, 10]}}})
        assert set(run_sweep(sweep).draws[path].ravel()) == {5.0, 10.0}
