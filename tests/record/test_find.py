"""Finding trajectories by criteria, against the same selection written in NumPy."""

import numpy as np
import pytest

from fzcli.errors import UsageError
from fzcli.record.find import configuration, drawn, find, nested
from fzcli.record.sweep_record import SweepRecord
from fzcli.spec.result import Provenance

COUNT = 40
FIRST = 7


@pytest.fixture
def record() -> SweepRecord:
    rng = np.random.default_rng(3)
    error, yaw = rng.uniform(0, 2, 2 * COUNT), rng.uniform(0, 1, 2 * COUNT)
    error[5] = np.nan
    return SweepRecord(
        configs=[{"controller.kind": kind, "controller.gain": 10} for kind in ("clik", "fuzzy")],
        metrics={
            "error": error,
            "yaw": yaw,
            "config": np.repeat([0, 1], COUNT),
            "trajectory": np.tile(np.arange(COUNT) + FIRST, 2),
            "status": np.zeros(2 * COUNT, dtype=np.int8),
        },
        metric_info={},
        certificate_names=(),
        draws={"start.q": rng.normal(size=(COUNT, 3)), "reference.length": rng.uniform(size=(COUNT, 1))},
        draw_info={},
        kept=(),
        provenance=Provenance("", "", "vm"),
    )


NAMES = {"fixed": 0, "fuzzy": 1}


def test_criteria_select_and_rank_as_numpy_does(record: SweepRecord) -> None:
    error, yaw = record.metrics["error"], record.metrics["yaw"]
    fixed, fuzzy = slice(0, COUNT), slice(COUNT, 2 * COUNT)
    good = (error[fixed] < 1.5) & (yaw[fixed] > 0.5 * yaw[fuzzy])
    expected = np.flatnonzero(good)[np.argsort(-(error[fixed] / yaw[fuzzy])[good], kind="stable")] + FIRST
    found = find(record, NAMES, ["fixed.error < 1.5", "fixed.yaw > 0.5 * fuzzy.yaw"], "fixed.error / fuzzy.yaw")
    assert list(found.trajectories) == list(expected)
    assert 5 + FIRST not in found.trajectories  # NaN meets no criterion
    lowest = find(record, NAMES, ["fixed.error < 1.5", "fixed.yaw > 0.5 * fuzzy.yaw"], "fixed.error / fuzzy.yaw", True)
    assert list(lowest.trajectories) == list(expected[::-1])


def test_drawn_values_come_back_as_fields(record: SweepRecord) -> None:
    fields = nested(drawn(record, FIRST + 4))
    assert fields == {
        "start": {"q": [float(v) for v in record.draws["start.q"][4]]},
        "reference": {"length": float(record.draws["reference.length"][4, 0])},
    }


def test_configurations_are_named_by_their_entries(record: SweepRecord) -> None:
    assert configuration(record, {"controller.kind": "fuzzy"}) == 1
    with pytest.raises(UsageError, match=r"2 configurations have controller\.gain=10"):
        configuration(record, {"controller.gain": 10})
    with pytest.raises(UsageError, match=r"0 configurations have controller\.gain=11"):
        configuration(record, {"controller.gain": 11})


@pytest.mark.parametrize(
    ("criterion", "text"),
    [
        ("fixed.error", "is not of the form SIDE < SIDE"),
        ("fixd.error < 1", "no configuration named 'fixd'; did you mean 'fixed'?"),
        ("fixed.eror < 1", "no metric 'eror'; did you mean 'error'?"),
        ("fixed.error < two", "'two' is neither a number nor CONFIGURATION.METRIC"),
    ],
)
def test_bad_criteria_are_refused(record: SweepRecord, criterion: str, text: str) -> None:
    with pytest.raises(UsageError, match=text.replace("?", r"\?")):
        find(record, NAMES, [criterion], "fixed.error")
