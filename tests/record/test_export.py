"""Datasets as columns, and what a file says about itself."""

import csv
import io
import json
from pathlib import Path

import factory
import numpy as np
import pytest

from fzcli.errors import RecordError, UsageError
from fzcli.record.export import Columns, get, names, write_columns
from fzcli.record.info import describe
from fzcli.record.rollout_file import write_rollout
from fzcli.record.sweep_file import write_sweep

RUN = factory.make_rollout()
SWEEP = factory.make_sweep(15, kept=8)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("files")
    write_rollout(RUN, folder / "run.h5", "f8")
    write_rollout(RUN, folder / "run4.h5", "f4")
    write_sweep(SWEEP, folder / "sweep.h5", "f8")
    return folder


def as_csv(columns: Columns) -> list[dict[str, str]]:
    stream = io.BytesIO()
    write_columns(columns, stream, "csv")
    return list(csv.DictReader(io.StringIO(stream.getvalue().decode())))


def test_time_series_have_time_first(files: Path) -> None:
    columns = get(files / "run.h5", "q")
    assert columns.names == ("time", "q.q1", "q.q2", "q.q3", "q.q4")
    assert columns.units == ("s", "rad", "rad", "rad", "rad")
    np.testing.assert_array_equal(np.array(columns.arrays[1:]).T, RUN.q)


@pytest.mark.parametrize("name", ["gain", "signals/gain", "/gain"])
def test_signals_by_either_name(files: Path, name: str) -> None:
    columns = get(files / "run.h5", name)
    assert columns.names == ("time", "gain.yaw")
    np.testing.assert_array_equal(columns.arrays[1], RUN.signals["gain"][:, 0])


def test_groups_give_all_their_columns(files: Path) -> None:
    assert get(files / "run.h5", "signals").names[:3] == ("time", "tip_error", "gain.yaw")
    assert get(files / "run.h5", "metrics").names == ("tip_error_mean", "yaw_abs_max")
    assert get(files / "run.h5", "tip_error_mean").arrays[0] == RUN.metrics["tip_error_mean"]
    assert get(files / "run.h5", "certificate").arrays[0] == 1e-13
    assert get(files / "sweep.h5", "kept").names[:4] == ("kept", "config", "trajectory", "n_steps")
    assert get(files / "sweep.h5", "start.q").names == ("trajectory", *(f"start.q.{k}" for k in range(4)))


def test_variants_come_run_after_run_with_their_names(tmp_path: Path) -> None:
    variants = {"bare": factory.make_rollout(1, steps=5, tuned=False), "fixed": factory.make_rollout(2, steps=3)}
    write_rollout(factory.make_rollout(variants=variants), tmp_path / "run.h5", "f8")
    columns = get(tmp_path / "run.h5", "variants/q")
    assert columns.names == ("role", "time", "q.q1", "q.q2", "q.q3", "q.q4")
    assert list(columns.arrays[0]) == ["bare"] * 5 + ["fixed"] * 3
    both = np.concatenate([one.q for one in variants.values()])
    np.testing.assert_array_equal(np.array(columns.arrays[2:]).T, both)
    metrics = get(tmp_path / "run.h5", "variants/metrics/tip_error_mean")
    assert list(metrics.arrays[-1]) == [one.metrics["tip_error_mean"] for one in variants.values()]
    assert "variants/q" in names(tmp_path / "run.h5")
    with pytest.raises(RecordError, match=r"has no 'variants/qq'; did you mean 'variants/q"):
        get(tmp_path / "run.h5", "variants/qq")


@pytest.mark.parametrize("name", ["tip_error_mean", "metrics/tip_error_mean"])
def test_metrics_carry_their_configuration(files: Path, name: str) -> None:
    columns = get(files / "sweep.h5", name)
    assert columns.names == (
        "run",
        "config",
        "trajectory",
        "controller.kind",
        "controller.gain",
        "tip_error_mean",
    )
    rows = as_csv(columns)
    assert len(rows) == 150
    for row, known in zip(rows, SWEEP.metrics["tip_error_mean"], strict=True):
        np.testing.assert_equal(float(row["tip_error_mean"]), known)
        assert SWEEP.configs[int(row["config"])] == {
            "controller.kind": row["controller.kind"],
            "controller.gain": float(row["controller.gain"]),
        }


def test_kept_series_are_cut_where_each_run_ends(files: Path) -> None:
    columns = get(files / "sweep.h5", "q")
    assert columns.names[:4] == ("kept", "config", "trajectory", "time")
    assert len(columns) == sum(len(run.rollout.time) for run in SWEEP.kept)
    table = dict(zip(columns.names, columns.arrays, strict=True))
    for index, run in enumerate(SWEEP.kept):
        np.testing.assert_array_equal(table["q.q2"][table["kept"] == index], run.rollout.q[:, 1])
        np.testing.assert_array_equal(table["time"][table["kept"] == index], run.rollout.time)


def test_csv_of_f4_is_short_and_exact(files: Path) -> None:
    rows = as_csv(get(files / "run4.h5", "q"))
    np.testing.assert_array_equal(np.array([row["q.q1"] for row in rows], "f4"), RUN.q[:, 0].astype("f4"))
    assert max(len(row["q.q1"]) for row in rows) < 16
    np.testing.assert_array_equal([float(row["time"]) for row in rows], RUN.time)


def test_jsonl_and_npy_say_the_same(files: Path) -> None:
    columns = get(files / "sweep.h5", "metrics")
    lines, binary = io.BytesIO(), io.BytesIO()
    write_columns(columns, lines, "jsonl")
    write_columns(columns, binary, "npy")
    binary.seek(0)
    table = np.load(binary)
    parsed = [json.loads(line) for line in lines.getvalue().splitlines()]
    assert table.dtype.names == columns.names
    values = [np.nan if row["tip_error_mean"] is None else row["tip_error_mean"] for row in parsed]
    np.testing.assert_array_equal(values, table["tip_error_mean"])
    assert [row["controller.kind"] for row in parsed] == list(table["controller.kind"])


def test_unknown_names_and_formats_are_refused(files: Path) -> None:
    with pytest.raises(
        RecordError, match=r"sweep\.h5: has no 'tip_eror_mean'; did you mean 'tip_error_mean'\?"
    ):
        get(files / "sweep.h5", "tip_eror_mean")
    with pytest.raises(RecordError, match=r"run\.h5: has no ''"):
        get(files / "run.h5", "")
    with pytest.raises(UsageError, match=r"format 'xls': expected one of csv, jsonl, npy"):
        write_columns(get(files / "run.h5", "q"), io.BytesIO(), "xls")


def test_a_sweep_describes_itself(files: Path) -> None:
    info = describe(files / "sweep.h5")
    assert (info.kind, info.runs, info.configs) == ("sweep", 150, 10)
    assert info.status == {
        name: int(np.sum(SWEEP.metrics["status"] == code))
        for code, name in enumerate(("ok", "flagged", "failed"))
    }
    assert info.certificate["momentum_angular_max"].value == SWEEP.metrics["momentum_angular_max"].max()
    assert info.provenance == factory.ORIGIN
    names = [one.name for one in info.datasets]
    assert names.index("tip_error_mean") < names.index("kept/q")
    text = "\n".join(info.lines())
    assert "150 runs in 10 configurations: " in text
    assert "0123abcd" in text


def test_a_run_describes_itself(files: Path) -> None:
    info = describe(files / "run.h5")
    assert (info.kind, info.runs, info.reason) == ("rollout", 1, "tip error 2e-2 m > 1e-2 m")
    assert np.isnan(info.certificate["clearance_min"].value)
    assert info.certificate["clearance_min"].runs == 0
    q = next(one for one in info.datasets if one.name == "q")
    assert (q.dims, q.dtype, q.unit) == ((("time", 200), ("joint", 4)), "float64", "rad")
    assert "1 run: 1 flagged" in "\n".join(info.lines())
