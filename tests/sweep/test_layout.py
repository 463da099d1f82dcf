"""How sweeps are parted and identified: every run once, by its index; by what a file means, not how it is written."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fzcli.errors import RecordError, SpecError
from fzcli.spec.document import document_of
from fzcli.spec.reader import read_text
from fzcli.sweep.draws import generator, sources
from fzcli.sweep.execute import load_sweep, resolve_any
from fzcli.sweep.layout import LARGEST, SMALLEST, layout_of
from fzcli.sweep.meaning import Meaning, meaning_of, sweep_of
from fzcli.sweep.resolve import Sweep, resolve
from tests.loop.cases import raw_run

RUNS = Path(__file__).parents[2] / "runs"
TEXT = """\
kind: sweep
robot: bulgarelli4
reference: {kind: line, length: 0.1, duration: 1 s}
controller: {kind: clik}
trajectories:
  count: 4
  draw: {start.q: {uniform: [[0.9, -1.4, 0.3, 0.5], [1.0, -1.3, 0.4, 0.6]]}, reference.direction: {sphere: 3}}
grid: {controller.gain: [10, 100]}
"""


def sweep_with(configs: int, count: int, **changes: Any) -> Sweep:
    data = {**raw_run(), "kind": "sweep", "trajectories": {"count": count}, **changes}
    return resolve(document_of({**data, "grid": {"controller.gain": [float(10 + i) for i in range(configs)]}}))


@pytest.mark.parametrize("configs", [1, 2, 10, 130])
@pytest.mark.parametrize("count", [1, 7, 100, 3001])
@pytest.mark.parametrize("record", ["metrics", "full"])
def test_every_run_is_in_one_shard(configs: int, count: int, record: str) -> None:
    layout = layout_of(sweep_with(configs, count, record=record))
    seen = np.zeros((configs, count), dtype=int)
    for index in range(layout.shards):
        piece = layout.piece(index)
        assert piece.runs <= LARGEST
        seen[piece.configs.start : piece.configs.stop, piece.places.start : piece.places.stop] += 1
        for config, place in ((piece.configs[0], piece.places[0]), (piece.configs[-1], piece.places[-1])):
            assert layout.shard_of(config * count + place) == index
    assert (seen == 1).all()
    assert layout.piece(0).runs >= min(SMALLEST, configs * count)


def test_more_configurations_than_a_shard_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules[layout_of.__module__], "LARGEST", 100)
    layout = layout_of(sweep_with(106, 20))
    assert layout.across == 2
    assert {len(layout.piece(index).configs) for index in range(layout.shards)} == {100, 6}


def identity(text: str, name: str = "<text>") -> str:
    return meaning_of(resolve_any(read_text(text, name))).identity


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("kind: sweep", "# a comment\nkind:   sweep"),
        ("duration: 1 s", "duration: 1000 ms"),
        ("[10, 100]", "[10.0, 1e2]"),
        ("kind: sweep", "kind: sweep\nabout: words"),
        ("kind: sweep", "kind: sweep\nexpect_failures: true\ntable: {show: [tip_error_mean]}"),
        ("kind: line, length: 0.1", "length: 100 mm, kind: line"),
    ],
)
def test_words_do_not_matter(old: str, new: str) -> None:
    assert old in TEXT
    assert identity(TEXT.replace(old, new)) == identity(TEXT)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("length: 0.1", "length: 0.1000000000000001"),
        ("count: 4", "count: 5"),
        ("count: 4", "count: 4\n  seed: 1"),
        ("count: 4", "count: 4\n  first: 1"),
        ("[10, 100]", "[100, 10]"),
        ("0.5]", "0.50001]"),
        ("kind: sweep", "kind: sweep\nmethod: midpoint"),
        ("kind: sweep", "kind: sweep\nrecord: metrics"),
        ("kind: sweep", "kind: sweep\nbounds: {tip_error: 0.02}"),
    ],
)
def test_numbers_do(old: str, new: str) -> None:
    assert old in TEXT
    assert identity(TEXT.replace(old, new, 1)) != identity(TEXT)


def test_the_engine_belongs_to_it(request: pytest.FixtureRequest) -> None:
    before = identity(TEXT)
    engine = meaning_of(resolve_any(read_text(TEXT))).data["engine"]
    request.getfixturevalue("machine")
    assert (identity(TEXT) == before) == (engine == "vm")


@pytest.mark.parametrize(
    "name", [path.stem for path in sorted(RUNS.glob("*.yaml")) if "kind: sweep" in path.read_text()]
)
def test_a_meaning_is_the_whole_sweep(name: str) -> None:
    sweep = load_sweep(RUNS / f"{name}.yaml")
    meaning = meaning_of(sweep)
    again = sweep_of(Meaning.from_json(meaning.to_json(), "sweep.json"))
    assert meaning_of(again).identity == meaning.identity
    assert again.changes == sweep.changes
    for one, other in zip(again.specs, sweep.specs, strict=True):
        assert one == other.model_copy(update={"about": "", **({"compare": {}} if "compare" in other.__dict__ else {})})
    for one, other in zip(again.draws, sweep.draws, strict=True):
        assert (one.path, one.distribution) == (other.path, other.distribution)
        assert (one.low.tobytes(), one.high.tobytes()) == (other.low.tobytes(), other.high.tobytes())


def test_an_attitude_given_as_angles_survives() -> None:
    sweep = sweep_with(1, 2, start={"q": [0.9, -1.4, 0.3, 0.5], "base_rpy": ["10 deg", 0, 0.1]})
    (again,) = sweep_of(meaning_of(sweep)).specs
    assert again == sweep.specs[0]


def test_a_changed_meaning_is_found() -> None:
    text = meaning_of(sweep_with(1, 2)).to_json()
    for broken in (text.replace('"step":0.01', '"step":0.02'), text[:-9], "[]", ""):
        with pytest.raises(RecordError, match=r"^sweep\.json: damaged, or not written by fzcli"):
            Meaning.from_json(broken, "sweep.json")


def _laid_out(sampling: str, count: int, first: int = 0) -> Sweep:
    draw = {"reference.length": {"uniform": [0.0, 1.0]}, "controller.gain": {"log_uniform": [1, 100]}}
    data = {**raw_run(), "kind": "sweep"}
    del data["reference"]["length"], data["controller"]["gain"]
    trajectories = {"count": count, "first": first, "seed": 5, "sampling": sampling, "draw": draw}
    return resolve(document_of({**data, "trajectories": trajectories}))


def _points(sweep: Sweep, places: range) -> np.ndarray:
    points = np.empty((len(places), 2))
    for point, (source, _) in zip(points, sources(sweep.file.trajectories, sweep.draws, places), strict=True):
        source.random(out=point)
    return points


def test_a_latin_hypercube_has_one_point_in_every_part() -> None:
    points = _points(_laid_out("latin_hypercube", 50), range(50))
    for axis in points.T:
        assert sorted(np.floor(axis * 50).astype(int)) == list(range(50))


def test_sobol_is_scipy_s_sequence_and_found_by_index() -> None:
    from scipy.stats import qmc

    whole = _points(_laid_out("sobol", 64), range(64))
    assert np.array_equal(whole, qmc.Sobol(2, scramble=True, rng=generator(5, 0)).random(64))
    assert np.array_equal(_points(_laid_out("sobol", 64), range(17, 30)), whole[17:30])
    assert np.array_equal(_points(_laid_out("sobol", 4, first=40), range(4)), whole[40:44])


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"draw": {"reference.direction": {"sphere": 3}}}, "reference.direction: sphere cannot be laid out by sobol"),
        ({"draw": {}, "keep_if": {"that": ["tip_error_max < 1"]}}, "keep_if needs sampling: random"),
        ({"sampling": "latin_hypercube", "count": 2_000_000}, "a Latin hypercube is laid out whole, of 1000000 points"),
    ],
)
def test_what_cannot_be_laid_out_is_refused(changes: dict[str, Any], text: str) -> None:
    data = {**raw_run(), "kind": "sweep", "trajectories": {"count": 2, "sampling": "sobol", **changes}}
    with pytest.raises(SpecError) as caught:
        resolve(document_of(data))
    assert text in str(caught.value)


def test_zipped_fields_go_together() -> None:
    data = {**raw_run(), "kind": "sweep", "grid": {"method": ["euler", "midpoint"]}}
    sweep = resolve(document_of({**data, "zip": {"step": ["10 ms", "20 ms"], "controller.gain": [1, 2]}}))
    assert [(spec.step, spec.controller.gain, spec.method) for spec in sweep.specs] == [
        (0.01, 1, "euler"), (0.01, 1, "midpoint"), (0.02, 2, "euler"), (0.02, 2, "midpoint")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"zip": {"step": [0.01], "controller.gain": [1, 2]}}, "has 1 values beside 2: zipped fields go together"),
        ({"zip": {"step": [0.01]}, "grid": {"step": [0.02]}}, "is an axis of the grid as well (step)"),
        ({"zip": {"step": [0.01]}, "list": [{"step": 0.02}]}, "is zipped as well (step)"),
    ],
)
def test_zips_that_do_not_fit_are_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        resolve(document_of({**raw_run(), "kind": "sweep", **changes}))
    assert text in str(caught.value)
