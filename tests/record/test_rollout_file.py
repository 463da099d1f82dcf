"""One run to a file and back."""

import dataclasses
import os
import subprocess
import sys
from pathlib import Path

import factory
import h5py
import numpy as np
import pytest
import xarray

from fzcli.errors import RecordError
from fzcli.loop.rollout import Rollout
from fzcli.record import hdf5
from fzcli.record.rollout_file import read_rollout, write_rollout
from fzcli.spec.quantity import Signal

ARRAYS = ("time", "q", "qd", "base_position", "base_quat", "base_twist", "tip_position", "tip_quat")


def assert_same(one: Rollout, other: Rollout) -> None:
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert set(one.signals) == set(other.signals)
    for name, values in one.signals.items():
        np.testing.assert_array_equal(values, other.signals[name])
    for name in ("signal_info", "joint_names", "joint_units", "status", "provenance"):
        assert getattr(one, name) == getattr(other, name)
    for name in ("metrics", "certificate"):
        np.testing.assert_equal(dict(getattr(one, name)), dict(getattr(other, name)))
        assert list(getattr(one, name)) == list(getattr(other, name))


@pytest.mark.parametrize("seed", range(5))
def test_round_trip_is_exact_in_f8(tmp_path: Path, seed: int) -> None:
    run = factory.make_rollout(seed, steps=1 + 97 * seed, tuned=seed % 2 == 0)
    write_rollout(run, tmp_path / "run.h5", "f8")
    assert_same(read_rollout(tmp_path / "run.h5"), run)
    assert list(read_rollout(tmp_path / "run.h5").signals) == list(run.signals)


def test_f4_is_the_default_for_trajectories_only(tmp_path: Path) -> None:
    run = factory.make_rollout()
    write_rollout(run, tmp_path / "run.h5")
    back = read_rollout(tmp_path / "run.h5")
    np.testing.assert_array_equal(back.q, run.q.astype("f4"))
    np.testing.assert_array_equal(back.time, run.time)
    np.testing.assert_equal(back.metrics, run.metrics)


def test_signals_named_like_something_else_survive(tmp_path: Path) -> None:
    names = ("q", "time", "status", "config")
    signals = {name: np.full(50, float(index)) for index, name in enumerate(names)}
    info = {name: Signal(name, "m", f"a signal called {name}") for name in names}
    run = factory.make_rollout(steps=50, signals=signals, signal_info=info)
    write_rollout(run, tmp_path / "run.h5", "f8")
    assert_same(read_rollout(tmp_path / "run.h5"), run)


def test_joint_units_label_prismatic_joints(tmp_path: Path) -> None:
    run = factory.make_rollout(joint_units=("rad", "m", "rad", "rad"))
    write_rollout(run, tmp_path / "run.h5", "f8")
    assert_same(read_rollout(tmp_path / "run.h5"), run)
    with h5py.File(tmp_path / "run.h5") as file:
        assert file["q"].attrs["units"] == "rad or m"
        assert list(file["qd"].attrs["component_units"]) == ["rad/s", "m/s", "rad/s", "rad/s"]


def with_variants() -> Rollout:
    variants = {
        "unconstrained": factory.make_rollout(1, steps=90, tuned=False),
        "fixed gain": factory.make_rollout(2, steps=57, provenance=dataclasses.replace(factory.ORIGIN, seed=3)),
    }
    return factory.make_rollout(steps=90, variants=variants)


def test_variants_come_back_by_name_each_with_its_own_length_and_origin(tmp_path: Path) -> None:
    run = with_variants()
    write_rollout(run, tmp_path / "run.h5", "f8")
    back = read_rollout(tmp_path / "run.h5")
    assert_same(back, run)
    assert list(back.variants) == ["unconstrained", "fixed gain"]
    for name, variant in run.variants.items():
        assert_same(back.variants[name], variant)
        assert back.variants[name].variants == {}
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf", group="variants") as data:
        assert data["q"].dims == ("kept", "time", "joint")
        assert list(data["role"].values) == ["unconstrained", "fixed gain"]


def test_a_diverged_run_keeps_its_data(tmp_path: Path) -> None:
    run = factory.make_rollout(steps=4)
    run.q[2:] = [[1e300] * 4, [np.nan] * 4]
    write_rollout(run, tmp_path / "run.h5")
    back = read_rollout(tmp_path / "run.h5")
    assert np.isinf(back.q[2]).all()
    assert np.isnan(back.q[3]).all()


def test_every_dataset_says_unit_meaning_and_dimensions(tmp_path: Path) -> None:
    write_rollout(factory.make_rollout(), tmp_path / "run.h5")
    with h5py.File(tmp_path / "run.h5") as file:
        for dataset in hdf5.walk(file):
            assert {"units", "long_name"} <= set(dataset.attrs), dataset.name
            assert dataset.attrs["long_name"], dataset.name
            assert all(dim.label for dim in dataset.dims), dataset.name
        assert file["q"].compression == "gzip"
        assert file["q"].shuffle
        assert file["q"].fletcher32
        assert file.attrs["NX_class"] == "NXdata"
        assert file.attrs["signal"] == "tip_error"
        assert list(file.attrs["axes"]) == ["time"]


def test_xarray_reads_names_units_and_coordinates(tmp_path: Path) -> None:
    run = factory.make_rollout()
    write_rollout(run, tmp_path / "run.h5", "f8")
    with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf") as data:
        assert data["q"].dims == ("time", "joint")
        assert data["q"].units == "rad"
        np.testing.assert_array_equal(data["q"].sel(joint="q2"), run.q[:, 1])
        np.testing.assert_array_equal(data["base_quat"].sel(quaternion="w"), run.base_quat[:, 0])
        np.testing.assert_array_equal(data["base_twist"].sel(twist="wz"), run.base_twist[:, 5])
        assert float(data["tip_error"].sel(time=0.5)) == run.signals["tip_error"][50]
        assert list(data["firing_strength_component"].values) == ["rule1", "rule2", "rule3"]
        assert not [dim for dim in data.dims if "phony" in str(dim)]
    for group in ("metrics", "certificate", "provenance"):
        with xarray.open_dataset(tmp_path / "run.h5", engine="h5netcdf", group=group) as data:
            assert len(data) >= 2


def test_equal_runs_make_equal_bytes(tmp_path: Path) -> None:
    for name in ("a.h5", "b.h5"):
        write_rollout(factory.make_rollout(), tmp_path / name)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_a_failure_while_writing_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.h5"
    write_rollout(factory.make_rollout(), path)
    before = path.read_bytes()

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    for step in ("fzcli.record.rollout_file.write_provenance", "os.fsync", "os.replace"):
        with monkeypatch.context() as patch:
            patch.setattr(step, stop)
            with pytest.raises(KeyboardInterrupt):
                write_rollout(factory.make_rollout(1), path)
        assert path.read_bytes() == before
        assert os.listdir(tmp_path) == ["run.h5"]


def test_a_full_disk_is_a_record_error_and_leaves_nothing(tmp_path: Path) -> None:
    script = (
        "import resource, signal, sys; sys.path[:0] = ['tests/record', '.']\n"
        "import factory; from fzcli.record.rollout_file import write_rollout\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        f"write_rollout(factory.make_rollout(steps=3000), {str(tmp_path / 'run.h5')!r})\n"
    )
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", script], cwd=root, capture_output=True, text=True)
    assert done.returncode == 1
    assert "RecordError" in done.stderr
    assert "run.h5: cannot be written: File too large" in done.stderr
    assert os.listdir(tmp_path) == []


def test_a_wrong_shape_names_the_array(tmp_path: Path) -> None:
    run = dataclasses.replace(factory.make_rollout(steps=10), qd=np.zeros((9, 4)))
    with pytest.raises(RecordError, match=r"^qd: shape \(9, 4\), expected \(10, 4\)$"):
        write_rollout(run, tmp_path / "run.h5")
    assert os.listdir(tmp_path) == []


def _broken(path: Path, kind: str) -> None:
    if kind == "folder":
        path.mkdir()
    elif kind == "empty":
        path.write_bytes(b"")
    elif kind == "text":
        path.write_text("kind: sweep\n")
    elif kind == "foreign":
        with h5py.File(path, "w") as file:
            file["x"] = [1.0]
    elif kind != "missing":
        write_rollout(factory.make_rollout(), path)
        whole = path.read_bytes()
        if kind == "truncated":
            path.write_bytes(whole[: len(whole) // 2])
        elif kind == "newer":
            with h5py.File(path, "r+") as file:
                file.attrs["fzcli_format"] = 99
        elif kind == "gutted":
            with h5py.File(path, "r+") as file:
                del file["metrics"]
        elif kind == "flipped":
            with h5py.File(path) as file:
                place = file["base_twist"].id.get_chunk_info(0).byte_offset
            path.write_bytes(whole[: place + 50] + bytes([whole[place + 50] ^ 1]) + whole[place + 51 :])


def test_a_folder_that_cannot_be_made_is_a_record_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordError, match=r"file/run\.h5: cannot be written: "):
        write_rollout(factory.make_rollout(), tmp_path / "file" / "run.h5")


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("missing", "run.h5: no such file"),
        ("folder", "run.h5: is a folder, not a result file"),
        ("empty", "run.h5: not an HDF5 file"),
        ("text", "run.h5: not an HDF5 file"),
        ("foreign", "run.h5: an HDF5 file, but not one written by fzcli"),
        ("truncated", "run.h5: truncated HDF5 file: its end is missing"),
        ("newer", "run.h5: written in format 99 by a newer fzcli; this one reads up to 1"),
        ("gutted", "run.h5: an fzcli file with a part missing or damaged"),
        ("flipped", "run.h5: cannot be read: "),
    ],
)
def test_a_file_that_is_no_result_says_why(tmp_path: Path, kind: str, message: str) -> None:
    _broken(tmp_path / "run.h5", kind)
    with pytest.raises(RecordError) as caught:
        read_rollout(tmp_path / "run.h5")
    assert message in str(caught.value)
