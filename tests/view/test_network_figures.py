"""Figures of networks: the comparison with the exact kinematics, and the error maps."""

from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import RecordError, UsageError
from fzcli.learn.network_set import NetworkSet
from fzcli.learn.store import save
from fzcli.learn.train import train, train_of
from fzcli.spec.document import document_of
from fzcli.view.network_plot import comparison_figure, error_figure, plot_networks

SMALL = {
    "kind": "train",
    "robot": "rrr_planar",
    "map": {"kind": "planar_forward", "radius": 0.1, "turn": 0.2, "modes": ["+++", "---"]},
    "samples": {"train": 200, "test": 60},
    "trainer": {"kind": "levenberg_marquardt", "iterations": 10, "starts": 1},
}


@pytest.fixture(scope="module")
def networks() -> NetworkSet:
    return train(train_of(document_of(SMALL)))


def test_the_comparison_shows_both_values_of_every_output(networks: NetworkSet) -> None:
    figure = comparison_figure(networks, "small")
    assert len(figure.axes) == 6
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["x [m]", "y [m]", "phi [deg]"] * 2
    exact, network = figure.axes[2].lines
    truth = networks.trained["+++ det+"].truth[:40]
    assert np.sort(exact.get_ydata()) == pytest.approx(np.sort(np.degrees(truth[:, 2])))
    assert np.abs(network.get_ydata() - exact.get_ydata()).max() < 5


def test_the_error_maps_stand_side_by_side(networks: NetworkSet) -> None:
    figure = error_figure(networks, "small")
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert len(titles) == 12
    assert titles[0] == "+++ det+, raw: phi = -11.46 deg"
    assert titles[3] == "after 3: phi = -11.46 deg"


def test_files_are_written_where_asked(networks: NetworkSet, tmp_path: Path) -> None:
    save(networks, tmp_path / "nets.npz")
    assert [path.name for path in plot_networks(tmp_path / "nets.npz")] == ["nets-comparison.png", "nets-errors.png"]
    (one,) = plot_networks(tmp_path / "nets.npz", tmp_path / "map.svg", "errors")
    assert one.stat().st_size > 5000
    with pytest.raises(UsageError, match="there are 2 figures; name a folder, or choose one with --what"):
        plot_networks(tmp_path / "nets.npz", tmp_path / "map.svg")
    with pytest.raises(UsageError, match="'joints': of networks there are comparison, errors"):
        plot_networks(tmp_path / "nets.npz", None, "joints")
    with pytest.raises(RecordError, match="no such file"):
        plot_networks(tmp_path / "none.npz")
