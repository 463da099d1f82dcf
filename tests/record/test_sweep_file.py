"""A sweep to a file and back."""

import dataclasses
from pathlib import Path

import factory
import h5py
import numpy as np
import pytest
import xarray
from test_rollout_file import assert_same

from fzcli.errors import RecordError
from fzcli.record import hdf5
from fzcli.record.rollout_file import read_rollout, write_rollout
from fzcli.record.sweep_file import read_sweep, read_table_spec, write_sweep
from fzcli.record.sweep_record import KeptRun, SweepRecord
from fzcli.record.table_spec import TableSpec
from fzcli.spec.quantity import Signal
from fzcli.spec.result import Provenance


def assert_same_sweep(one: SweepRecord, other: SweepRecord) -> None:
    assert one.configs == other.configs
    assert list(one.metrics) == list(other.metrics)
    for name, values in one.metrics.items():
        np.testing.assert_array_equal(values, other.metrics[name])
        assert values.dtype == other.metrics[name].dtype
    assert one.certificate_names == other.certificate_names
    for name, values in one.draws.items():
        np.testing.assert_array_equal(values, other.draws[name])
    assert dict(one.draw_info) == dict(other.draw_info)
    assert one.provenance == other.provenance
    assert len(one.kept) == len(other.kept)
    for mine, theirs in zip(one.kept, other.kept, strict=True):
        assert (mine.config, mine.trajectory, mine.role) == (theirs.config, theirs.trajectory, theirs.role)
        assert_same(mine.rollout, theirs.rollout)


def test_round_trip_is_exact_in_f8(tmp_path: Path) -> None:
    record = factory.make_sweep(20, kept=12)
    write_sweep(record, tmp_path / "s.h5", "f8")
    back = read_sweep(tmp_path / "s.h5")
    assert_same_sweep(back, record)
    assert back.metric_info == {
        name: info for name, info in factory.METRICS.items() if name in record.metrics
    }


def test_sweeps_without_kept_runs_draws_or_runs(tmp_path: Path) -> None:
    record = factory.make_sweep(0, kept=0)
    write_sweep(dataclasses.replace(record, draws={}, draw_info={}), tmp_path / "s.h5")
    back = read_sweep(tmp_path / "s.h5")
    assert back.kept == ()
    assert back.draws == {}
    assert len(back.metrics["tip_error_mean"]) == 0


def test_kept_runs_may_differ_in_joints_signals_clock_and_origin(tmp_path: Path) -> None:
    other = factory.make_rollout(
        2, 30, joint_names=("a", "b"), dt=0.003, provenance=Provenance("kind: simulate\n", "ffff", "vm")
    )
    moved = dict(factory.SIGNALS, gain=Signal("gain", "1/s", "null-space gain", ("roll", "pitch")))
    two = factory.make_rollout(3, 25)
    two = dataclasses.replace(
        two, signals={**two.signals, "gain": np.ones((25, 2))}, signal_info=moved, metrics={"only_here": 1.5}
    )
    rollouts = (factory.make_rollout(1, 40), other, two, factory.make_rollout(4, 10, tuned=False))
    kept = tuple(KeptRun(index, 7, "best", rollout) for index, rollout in enumerate(rollouts))
    record = dataclasses.replace(factory.make_sweep(5), kept=kept)
    write_sweep(record, tmp_path / "s.h5", "f8")
    assert_same_sweep(read_sweep(tmp_path / "s.h5"), record)
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf", group="kept") as data:
        assert data["time"].dims == ("kept", "step")
        assert data["q_2"].dims == ("kept", "step", "joint_2")


def test_short_runs_are_padded_with_nan(tmp_path: Path) -> None:
    record = factory.make_sweep(5, kept=6)
    write_sweep(record, tmp_path / "s.h5")
    with h5py.File(tmp_path / "s.h5") as file:
        lengths = file["kept/n_steps"][...]
        q = file["kept/q"][...]
        assert q.dtype == np.float32
        assert len(set(lengths)) > 1
        for row, length in zip(q, lengths, strict=True):
            assert np.isfinite(row[:length]).all()
            assert np.isnan(row[length:]).all()


def test_xarray_reads_every_group(tmp_path: Path) -> None:
    record = factory.make_sweep(30, kept=12)
    table = TableSpec.of({**factory.TABLE, "beside": None})
    write_sweep(record, tmp_path / "s.h5", "f8", table)
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf") as data:
        assert data["tip_error_mean"].dims == ("run",)
        assert data["tip_error_mean"].units == "m"
        assert set(data.coords) == {"run", "config", "trajectory"}
        assert data["status"].flag_meanings == "ok flagged failed"
        chosen = data["yaw_abs_mean"].where(data.config == 3, drop=True)
        np.testing.assert_array_equal(chosen, record.metrics["yaw_abs_mean"][record.metrics["config"] == 3])
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf", group="configs") as data:
        assert list(data["controller.kind"].values[[0, 9]]) == ["clik", "fuzzy_clik"]
        assert data["controller.gain"].values[4] == 5000.0
    with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf", group="kept") as data:
        assert {"kept", "config", "trajectory", "role", "time", "joint"} <= set(data.coords)
        run = record.kept[7].rollout
        np.testing.assert_array_equal(data["q"].sel(kept=7, joint="q3").dropna("time"), run.q[:, 2])
        assert list(data["role"].values[:3]) == ["best", "median", "worst"]
    for group in ("draws", "kept/metrics", "kept/certificate", "provenance", "table"):
        with xarray.open_dataset(tmp_path / "s.h5", engine="h5netcdf", group=group) as data:
            assert len(data) >= 1
            assert not [dim for dim in data.dims if "phony" in str(dim)]
    with h5py.File(tmp_path / "s.h5") as file:
        for dataset in hdf5.walk(file):
            assert {"units", "long_name"} <= set(dataset.attrs), dataset.name


def test_the_table_section_travels_with_the_file(tmp_path: Path) -> None:
    (tmp_path / "paper.csv").write_text("controller.gain,controller.kind,yaw_abs_mean\n10,clik,0.02\n")
    spec = TableSpec.of({**factory.TABLE, "beside": "paper.csv"}, (tmp_path,))
    write_sweep(factory.make_sweep(3), tmp_path / "s.h5", table=spec)
    assert read_table_spec(tmp_path / "s.h5") == spec
    write_sweep(factory.make_sweep(3), tmp_path / "s.h5")
    assert read_table_spec(tmp_path / "s.h5") is None


def test_a_kind_mistaken_for_the_other_says_so(tmp_path: Path) -> None:
    write_rollout(factory.make_rollout(), tmp_path / "run.h5")
    with pytest.raises(RecordError, match=r"run\.h5: holds a rollout, not a sweep"):
        read_sweep(tmp_path / "run.h5")
    write_sweep(factory.make_sweep(3), tmp_path / "s.h5")
    with pytest.raises(RecordError, match=r"s\.h5: holds a sweep, not a rollout"):
        read_rollout(tmp_path / "s.h5")
