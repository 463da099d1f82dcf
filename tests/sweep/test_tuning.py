"""Tuning: the same numbers by seed, jobs and after a stop; better where it looked; refused in words."""

import sys
from pathlib import Path
from typing import Any

import pytest

from fzcli.errors import SpecError, UnfinishedError
from fzcli.loop.events import make_engine
from fzcli.spec.document import document_of
from fzcli.spec.load import load_rulebase
from fzcli.spec.reader import read
from fzcli.sweep.tune_spec import Tuning, resolve_tuning
from fzcli.sweep.tuned_rulebase import write_rulebase
from fzcli.sweep.tuning import Tuned, _Search, tune_to
from fzcli.sweep.vary import changed
from tests.loop.cases import raw_run

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("machine")
DRAW = {"reference.direction": {"sphere": 3}}
SECTION = {"vary": {"controller.gain": [1, 1000]}, "minimise": "yaw_abs_mean", "candidates": 5, "generations": 3}


def tuning(section: dict[str, Any] | None = None, **changes: Any) -> Tuning:
    data = {**raw_run(), "kind": "tune", "duration": 0.3, "trajectories": {"count": 6, "seed": 1, "draw": DRAW}}
    del data["reference"]["direction"]
    return resolve_tuning(document_of({**data, "tune": {**SECTION, **(section or {})}, **changes}))


def test_the_result_hangs_on_the_seed_alone(tmp_path: Path) -> None:
    first = tune_to(tuning(), tmp_path / "a.json", jobs=1)
    again = tune_to(tuning(), tmp_path / "b.json", jobs=2)
    other = tune_to(tuning({"seed": 2}), tmp_path / "c.json")
    assert first == again
    assert other.identity != first.identity
    assert first.after.mean < first.before.mean
    assert first.after.lost <= first.before.lost
    assert (first.before.runs, first.held_out_after and first.held_out_after.runs) == (3, 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "b.json", "c.json"]


def test_a_stopped_tuning_goes_on_and_a_finished_one_is_read(tmp_path: Path) -> None:
    calm, path = tune_to(tuning(), tmp_path / "calm.json"), tmp_path / "t.json"
    tried: list[int] = []

    def tell(what: str, done: int, total: int) -> None:
        tried.append(done)

    for most in (4, 9):
        with pytest.raises(UnfinishedError, match=r"^stopped; \d+ candidates are tried, of about 20, in "):
            tune_to(tuning(), path, 1, tell, lambda most=most: len(tried) > most)  # type: ignore[misc]
    (journal,) = tmp_path.glob("*.jsonl")
    with journal.open("a") as file:
        file.write('\n[[1.0], 0.1, 0')  # as a kill leaves it
    assert tune_to(tuning(), path, 1) == calm
    assert not journal.exists()
    assert tune_to(tuning(), path, 1) == calm
    assert Tuned.from_json(path.read_text()) == calm


def test_numbers_of_a_rule_base_become_a_rule_base(tmp_path: Path) -> None:
    controller = {"kind": "fuzzy_clik", "gain": 10, "rulebase": "bulgarelli2011"}
    vary = {"controller.rulebase.outputs.increment.terms.NL": {"scale": [0.1, 1]}}
    made = tuning({"vary": vary, "generations": 0, "lost": "tip_error_max > 1e-2"}, controller=controller)
    found = tune_to(made, tmp_path / "t.json")
    place = write_rulebase(made, found, tmp_path / "t.json", ("fzcli", "tune", "t.yaml"))
    assert place == tmp_path / "t-rulebase.yaml"
    again = load_rulebase(place)
    (factor,) = found.values.values()
    own = load_rulebase("bulgarelli2011")
    for name, term in own.outputs["increment"].terms.items():
        expected = tuple(float(f"{x * factor:.4g}") for x in term.numbers) if name == "NL" else term.numbers
        assert again.outputs["increment"].terms[name].numbers == expected
    assert [rule.text for rule in again.rules] == [rule.text for rule in own.rules]
    assert again.inputs == own.inputs
    head = place.read_text().split("kind:")[0]
    assert "# Tuned from bulgarelli2011 by: fzcli tune t.yaml" in head
    assert found.identity in head


def test_a_baseline_is_another_run_on_the_same_trajectories(tmp_path: Path) -> None:
    lost = {"lost": "tip_error_max > 1e-9"}  # all of them
    own = tune_to(tuning(), tmp_path / "own.json")
    other = tune_to(tuning({"baseline": {"controller.gain": 500}, **lost}), tmp_path / "other.json")
    at_500 = {**raw_run(controller__gain=500.0)["controller"]}
    alone = tune_to(tuning({"generations": 0, **lost}, controller=at_500), tmp_path / "alone.json")
    assert (other.before, other.held_out_before) == (alone.before, alone.held_out_before)
    assert other.before.mean < own.before.mean
    assert other.before.lost == 3
    change = other.held_out_change
    assert change is not None
    assert other.held_out_after is not None
    assert other.held_out_before is not None
    assert change.mean == pytest.approx(other.held_out_after.mean - other.held_out_before.mean, rel=1e-12)
    assert change.error > 0


def test_a_margin_of_lost_runs_is_left_free(tmp_path: Path) -> None:
    """All runs of the baseline are lost: with half of them allowed, every candidate pays for the others."""
    section = {"lost": "tip_error_max > 1e-9", "vary": {"controller.gain": [9, 10]}, "generations": 0}
    costs = []
    for margin in (0.0, 0.5):
        made = tuning({**section, "margin": margin})
        search = _Search(made, tmp_path / f"{margin}.jsonl", tmp_path, 1, None, None)
        found = search.run("identity")
        costs.append(search._cost(found.after))
    assert costs[1] - costs[0] == pytest.approx(2 * found.before.mean, rel=1e-12)  # 3 lost, 1 allowed


SINGLETONS = """
kind: rulebase
inputs:
  error: {range: [0, 1], terms: {SMALL: [ramp, 0.4, 0], LARGE: [ramp, 0, 0.4]}}
  oscillating: {range: [0, 10], terms: {OFF: [ramp, 1, 0], ON: [ramp, 0, 1]}}
outputs:
  increment: {range: [-2000, 100], terms: {DOWN: [singleton, -900], UP: [singleton, 1.3], FAST: [singleton, 8]}}
rules:
  - if error is SMALL and oscillating is OFF then increment is UP
  - if error is LARGE and oscillating is OFF then increment is FAST
  - if oscillating is ON then increment is DOWN
"""


def test_singletons_are_moved_without_another_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plain.yaml").write_text(SINGLETONS)
    controller = {"kind": "fuzzy_clik", "gain": 700, "rulebase": str(tmp_path / "plain.yaml")}
    terms = "controller.rulebase.outputs.increment.terms"
    vary = {f"{terms}.FAST.numbers.0": [1, 99], f"{terms}.DOWN": {"scale": [0.01, 3]}}
    made = tuning({"vary": vary, "generations": 0, "candidates": 8}, controller=controller, duration=1.0)
    loops: list[Any] = []

    def engine(loop: Any, folder: Path) -> Any:
        loops.append(loop)
        return make_engine(loop, folder=folder)

    monkeypatch.setattr(sys.modules[tune_to.__module__], "make_engine", engine)
    found = tune_to(made, tmp_path / "t.json")
    assert len(loops) == 1
    assert found.after.mean < found.before.mean
    again = write_rulebase(made, found, tmp_path / "t.json", ("fzcli", "tune", "t.yaml"))
    moved = tuning({"generations": 0}, controller={**controller, "rulebase": str(again)}, duration=1.0)
    assert tune_to(moved, tmp_path / "m.json").before == found.after  # to the last bit, with its numbers in the file


def test_a_singleton_is_not_moved_out_of_its_range(tmp_path: Path) -> None:
    (tmp_path / "plain.yaml").write_text(SINGLETONS)
    spec = tuning(controller={"kind": "fuzzy_clik", "gain": 9, "rulebase": str(tmp_path / "plain.yaml")}).sweep.specs[0]
    path = "controller.rulebase.outputs.increment.terms.FAST"
    vary = tuning({"vary": {"controller.gain": {"scale": [1, 100]}}}).section.vary
    assert changed(spec, {path: vary["controller.gain"]}, [12]) is not None
    assert changed(spec, {path: vary["controller.gain"]}, [13]) is None


def test_candidates_that_make_no_sense_are_not_chosen() -> None:
    spec = tuning().sweep.specs[0]
    vary = tuning({"vary": {"controller.kp": [-1, 1]}}).section.vary
    assert changed(spec, vary, [-0.5]) is None
    assert changed(spec, vary, [0.5]).controller.kp == 0.5  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("section", "changes", "text"),
    [
        ({"vary": {"controller.gian": [1, 2]}}, {}, "tune.vary.controller.gian: is not a number of the run"),
        ({"vary": {"controller.gain": [2, 1]}}, {}, "the lower end 2 must lie below the upper 1"),
        ({"vary": {"controller.gain": 3}}, {}, "must be two numbers, [LOW, HIGH], or {scale: [LOW, HIGH]}"),
        ({"vary": {"controller": {"scale": [0, 1]}}}, {}, "factors are above 0"),
        ({"vary": {"start.q": [0, 1]}}, {}, "holds several numbers: scale them, or name one"),
        ({"vary": {"controller.gain": [1, 2]}}, {"grid": {"controller.gain": [1]}}, "is drawn or swept as well"),
        ({"lost": "tip_error_max"}, {}, "must be METRIC < NUMBER"),
        ({"baseline": {"controller.kind": "fuzy_clik"}}, {}, "controller.kind: unknown kind 'fuzy_clik'"),
        ({"baseline": {"controller.gian": 3}}, {}, "gian"),
        ({"baseline": {"start.base_rpy": 3}}, {}, "start.base_rpy"),
        ({"margin": 1}, {}, "tune.margin"),
    ],
)
def test_bad_tunings_are_refused(section: dict[str, Any], changes: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        tuning(section, **changes)
    assert text in str(caught.value)


def test_a_metric_that_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match=r"tune\.minimise: no metric 'yaw_abs_men'; did you mean 'yaw_abs_mean'"):
        tune_to(tuning({"minimise": "yaw_abs_men"}), tmp_path / "t.json")


def test_the_shipped_tunings_are_valid() -> None:
    assert len(resolve_tuning(read(ROOT / "runs/tune_gain.yaml")).sweep.specs) == 2
    made = resolve_tuning(read(ROOT / "runs/tune_priority.yaml"))
    kinds = [spec.controller.kind for spec in (*made.sweep.specs, *made.baseline)]
    assert kinds == ["fuzzy_task_priority", "fuzzy_clik"]
