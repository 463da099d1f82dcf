"""Figures of a plan of the planar 3-RRR: true to size, and all that is drawn is the plan's own."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import fzcli
from fzcli.loop.rollout import Rollout
from fzcli.record.plan_file import as_rollout, write_plan
from fzcli.view.planar_plan_plot import is_planar, planar_path_figure, singularity_figure
from fzcli.view.planned import speed_limits
from fzcli.view.plots import plot

RUN = "runs/rrr_obstacle.yaml"


@cache
def run() -> Rollout:
    return as_rollout(fzcli.plan(RUN))


def test_a_plan_is_drawn_in_four_figures(tmp_path: Path) -> None:
    write_plan(fzcli.plan(RUN), tmp_path / "rrr.h5")
    names = [path.name for path in plot(tmp_path / "rrr.h5")]
    assert names == [f"rrr-{tag}.png" for tag in ("joints_over_time", "path", "clearance", "singularity")]
    assert all((tmp_path / name).stat().st_size > 10_000 for name in names)


def test_the_mechanism_is_drawn_where_it_is_and_as_wide_as_it_is() -> None:
    assert is_planar(run())
    figure = planar_path_figure(run(), "rrr")
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    shown = [line.get_label() for line in axes.lines if str(line.get_label()).endswith(" s")]
    assert shown[0] == "0.00 s"
    assert shown[-1] == "4.00 s"
    outlines = [path.vertices for item in axes.collections for path in item.get_paths()]
    assert len(outlines) == 9 * len(shown)
    first = outlines[0]  # leg 1, from its foot to its elbow, at the start
    foot, elbow = run().signals["arm_points"][0].reshape(3, 3)[:2, :2]
    away = np.linalg.norm(first[:-1] - foot, axis=1)
    assert away.min() == pytest.approx(0.01, abs=1e-9)
    assert np.linalg.norm(first[:-1] - elbow, axis=1).min() == pytest.approx(0.01, abs=1e-9)
    centre = next(line for line in axes.lines if line.get_label() == "platform's centre")
    np.testing.assert_allclose(np.transpose(centre.get_data()), run().tip_position[:, :2])
    (post,) = [patch for patch in axes.patches if len(patch.get_xy()) > 12]
    np.testing.assert_allclose(np.linalg.norm(post.get_xy() - [-0.21, -0.02], axis=1), 0.03, atol=1e-12)
    assert "smallest clearance 10.1 mm" in figure.get_suptitle()


def test_the_singularity_measures_and_what_is_asked_of_them() -> None:
    axes = singularity_figure(run()).axes[0]
    curves = {line.get_label(): np.asarray(line.get_ydata()) for line in axes.lines}
    assert list(curves) == ["sine of elbow 1", "of elbow 2", "of elbow 3", "det A", "off_singular"]
    np.testing.assert_allclose(np.transpose(list(curves.values())[:4]), run().signals["singularity"])
    assert curves["off_singular"][0] == 0.1
    assert axes.get_ylim()[0] == 0.0


def test_speed_limits_are_those_of_the_drives() -> None:
    np.testing.assert_allclose(speed_limits(run()), np.pi)
