"""Figures of plans: the plan's own numbers in the units people read, and solids true to size, before and behind."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import planned_runs
import pytest
from matplotlib.colors import to_rgb
from scipy.spatial.transform import Rotation

from fzcli.errors import RecordError, UsageError
from fzcli.plan.joint_path import JointPath
from fzcli.record.plan_file import write_plan
from fzcli.spec.result import Status
from fzcli.view.arm_plot import time_shades
from fzcli.view.plan_path_plot import STANDING, path_figure
from fzcli.view.plan_plot import clearance_figure, joints_over_time_figure
from fzcli.view.planned import base_solids, is_plan, nearest, obstacles, solid_at, speed_limits, straight_path
from fzcli.view.plots import plot
from fzcli.view.solids import Block, Round, above, finely, hides, open_view, solid_of
from fzcli.view.space import AZIMUTHS, View
from fzcli.view.style import COLORS

JOINTS = ["J1", "J2", "J3", "J4", "J5", "J6"]


def legend(axes: Any) -> list[str]:
    return [text.get_text() for text in axes.get_legend().get_texts()]


def curves(axes: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_ydata() for line in axes.lines if not line.get_label().startswith("_")}


def lines(figure: Any) -> dict[str, np.ndarray]:
    """The labelled paths of a 3-D figure, (N, 3) each."""
    return {
        line.get_label(): np.array(line.get_data_3d()).T
        for line in figure.axes[0].lines
        if not line.get_label().startswith("_")
    }


def shaded(axes: Any) -> list[tuple[float, float]]:
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]


def painted(figure: Any, color: tuple[float, ...]) -> list[Any]:
    """The faces of solids whose edges have a colour darkened."""
    found = [item for item in figure.axes[0].collections if len(item.get_edgecolor())]
    return [item for item in found if np.allclose(item.get_edgecolor()[0][:3], np.array(color) * 0.62, atol=1e-9)]


def polygons(figure: Any, color: tuple[float, ...]) -> list[np.ndarray]:
    """Their corners (N, 3)."""
    return [face for item in painted(figure, color) for face in np.array(item._faces)]


def test_joints_with_two_derivatives() -> None:
    run = planned_runs.balls()
    figure = joints_over_time_figure(run, "plan")
    panels = [axes for axes in figure.axes if axes.get_ylabel()]
    assert [axes.get_ylabel() for axes in panels] == ["displacement [deg]", "velocity [deg/s]", "acceleration [deg/s²]"]
    for axes, values in zip(panels, (run.q, run.qd, run.signals["qdd"]), strict=True):
        drawn = curves(axes)
        np.testing.assert_allclose(np.column_stack([drawn[name] for name in JOINTS]), np.rad2deg(values))
    assert legend(panels[1]) == [*JOINTS, "straight path", "off it"]
    assert panels[-1].get_xlabel() == "time [s]"
    assert figure._suptitle.get_text().startswith("plan\nok; smallest clearance 10")


def test_the_straight_path_stands_beside_and_the_detour_is_shaded() -> None:
    plan, run = planned_runs.planned(planned_runs.BALLS), planned_runs.balls()
    figure = joints_over_time_figure(run)
    nominal = JointPath(run.q[0], run.q[-1] - run.q[0], 4.0).at(run.time)
    (detour,) = plan.detours
    step = run.time[1] - run.time[0]
    for axes, values in zip(figure.axes, nominal, strict=False):
        thin = [line.get_ydata() for line in axes.lines if line.get_linewidth() < 1 and len(line.get_ydata()) > 2]
        assert thin
        for one in thin:
            assert np.abs(np.rad2deg(values) - one[:, None]).max(axis=0).min() < 1e-9
        ((begin, end),) = shaded(axes)
        assert detour.begin - 1e-9 <= begin <= detour.begin + 4 * step
        assert detour.end - 4 * step <= end <= detour.end + 1e-9


def test_a_straight_plan_has_nothing_beside() -> None:
    run = planned_runs.free()
    figure = joints_over_time_figure(run)
    assert legend(figure.axes[1]) == [*JOINTS, "speed limit"]
    assert not shaded(figure.axes[0])


def test_speed_limits_are_drawn_where_a_joint_comes_near() -> None:
    fast, slow = planned_runs.free(), planned_runs.balls()
    np.testing.assert_allclose(np.rad2deg(speed_limits(fast)), [180, 90, 135, 180, 180, 210])
    dotted = [
        line.get_ydata()[0] for line in joints_over_time_figure(fast).axes[1].lines if line.get_linestyle() == ":"
    ]
    assert dotted
    assert max(dotted) == pytest.approx(180.0)
    assert min(dotted) > 0  # no joint is nearly as fast as it may be the other way
    assert not [line for line in joints_over_time_figure(slow).axes[1].lines if line.get_linestyle() == ":"]


def test_steps_are_counted_along_the_top() -> None:
    figure = joints_over_time_figure(planned_runs.balls())
    figure.draw_without_rendering()
    (top,) = figure.axes[0].child_axes
    assert top.get_xlabel() == "step"
    ticks = [float(tick) for tick in top.get_xticks() if 0 <= tick <= 20]
    assert ticks == list(range(0, 21, 2))


def test_many_joints_share_columns_and_sliding_joints_have_their_own() -> None:
    run = planned_runs.balls()
    double = {name: np.hstack([getattr(run, name)] * 2) for name in ("q", "qd")}
    names = (*(f"left_{name}" for name in JOINTS), *(f"right_{name}" for name in JOINTS))
    signals = {**run.signals, "qdd": np.hstack([run.signals["qdd"]] * 2)}
    twice = dataclasses.replace(run, **double, joint_names=names, joint_units=("rad",) * 12, signals=signals)
    figure = joints_over_time_figure(twice)
    assert legend(figure.axes[2])[:6] == [f"left {name}" for name in JOINTS]
    assert legend(figure.axes[3])[:6] == [f"right {name}" for name in JOINTS]
    sliding = dataclasses.replace(run, joint_units=("m", *("rad",) * 5))
    figure = joints_over_time_figure(sliding)
    assert [axes.get_ylabel() for axes in figure.axes[:2]] == ["displacement [deg]", "displacement [m]"]
    np.testing.assert_allclose(curves(figure.axes[1])["J1"], run.q[:, 0])


def test_without_a_law_there_is_no_straight_path() -> None:
    run = planned_runs.respecified(planned_runs.balls(), "law: 3-4-5", "law: none")
    assert straight_path(run) is None
    assert legend(joints_over_time_figure(run).axes[1]) == JOINTS
    unread = dataclasses.replace(run, provenance=dataclasses.replace(run.provenance, spec_text=": ["))
    assert obstacles(unread) == ()
    assert np.isinf(speed_limits(unread)).all()
    joints_over_time_figure(unread)
    clearance_figure(unread)
    path_figure(unread)


def test_clearance_margin_and_the_least() -> None:
    run = planned_runs.balls()
    figure = clearance_figure(run)
    (axes,) = figure.axes
    np.testing.assert_allclose(axes.lines[0].get_ydata(), 1e3 * run.signals["clearance"])
    assert axes.get_ylabel() == "smallest distance [mm]"
    assert curves(axes)["margin 10 mm"][0] == pytest.approx(10.0)
    least, when = run.certificate["clearance_min"], run.certificate["clearance_time"]
    dot = axes.lines[-1]
    assert (dot.get_xdata()[0], dot.get_ydata()[0]) == pytest.approx((when, 1e3 * least))
    assert axes.texts[0].get_text() == f"{1e3 * least:.3g} mm at {when:.3g} s"
    assert axes.get_ylim()[0] == 0.0
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["off the straight path", "margin 10 mm"]


def test_contact_is_shaded() -> None:
    run = planned_runs.balls()
    run = dataclasses.replace(
        run,
        signals={**run.signals, "clearance": run.signals["clearance"] - 0.03},
        metrics={},
        status=Status("failed", "contact: J6_link and sphere 1 overlap by 20 mm", ""),
    )
    figure = clearance_figure(run, "touching")
    low, _ = figure.axes[0].get_ylim()
    assert low < -20.0
    bands = [patch for patch in figure.axes[0].patches if patch.get_label() == "contact"]
    assert [(band.get_y(), band.get_y() + band.get_height()) for band in bands] == [(pytest.approx(low), 0.0)]
    assert "failed: contact" in figure._suptitle.get_text()


def test_nothing_to_come_near() -> None:
    run = planned_runs.balls(clearance=np.full(401, np.inf))
    assert nearest(run) is None
    with pytest.raises(RecordError, match="has nothing that could come near anything: no clearance to draw"):
        clearance_figure(run)
    assert legend_of_path(run)


def legend_of_path(run: Any) -> list[str]:
    return [text.get_text() for text in path_figure(run).legends[0].get_texts()]


def test_the_path_among_its_obstacles() -> None:
    run = planned_runs.balls()
    figure = path_figure(run, "plan")
    found = legend_of_path(run)
    assert found[:3] == ["tip", "tip, no detour", "from above"]
    assert found[-2:] == ["obstacle", "moving obstacle,\nin the arm's shade"]
    assert found[3] == "0.00 s"
    assert found[9] == "4.00 s"
    assert f"{run.certificate['clearance_time']:.2f} s" in found
    assert [text.get_text() for text in figure.axes[0].texts] == ["ball"]
    drawn = lines(figure)["0.00 s"]
    ends = run.signals["arm_points"][0].reshape(-1, 3)
    for point in ends:
        assert np.nanmin(np.linalg.norm(drawn - point, axis=1)) < 1e-12


def test_spheres_are_drawn_true_to_size() -> None:
    run = planned_runs.balls()
    figure = path_figure(run)
    page = View(figure.axes[0].azim).page
    (disc,) = polygons(figure, STANDING)
    np.testing.assert_allclose(np.linalg.norm(disc - [0.338, 0, 0.345], axis=1), 0.05, rtol=1e-9)
    np.testing.assert_allclose((disc - [0.338, 0, 0.345]) @ page[2], 0.0, atol=1e-12)
    shades = time_shades(7)
    times = [float(label[:-2]) for label in lines(figure) if label.endswith(" s")]
    for time, shade in zip(times, shades, strict=True):
        (disc,) = polygons(figure, shade[:3])
        np.testing.assert_allclose(disc[:-1].mean(axis=0), [-0.3, 0.4 - 0.1 * time, 0.6], atol=5e-3)


def test_what_a_solid_hides_lies_below_it() -> None:
    run = planned_runs.balls()
    figure = path_figure(run)
    axes = figure.axes[0]
    way = View(axes.azim).page[2]
    sphere = solid_at(obstacles(run)[0], 0.0)
    level = min(item.zorder for item in painted(figure, STANDING))
    straight = [
        line for line in axes.lines if to_rgb(line.get_color()) == to_rgb(COLORS[1]) and line.get_linestyle() == "--"
    ]
    assert len(straight) > 1
    inside = 0
    for line in straight:
        points = np.array(line.get_data_3d()).T
        points = points[np.isfinite(points).all(axis=1)]
        covered = hides(sphere, points, way)
        if line.zorder < level:
            inside += int(covered.sum())
        else:
            assert covered.mean() < 0.05  # the ends of its pieces alone
    assert inside > 5


def test_a_free_base_stands_cut_off() -> None:
    run = planned_runs.free()
    (first,), (last,) = base_solids(run, 0), base_solids(run, len(run.time) - 1)
    assert isinstance(first, Block)
    assert isinstance(last, Block)
    np.testing.assert_allclose(first.center, [0, 0, -0.4])
    quat = run.base_quat[-1]
    turn = Rotation.from_quat(quat[[1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(last.turn, turn, atol=1e-12)
    np.testing.assert_allclose(last.center, run.base_position[-1] + turn @ [0, 0, -0.4], atol=1e-12)
    figure = path_figure(run)
    low = figure.axes[0].get_zlim()[0]
    assert low > -0.3
    for item in figure.axes[0].collections:
        assert np.array(item._faces)[..., 2].min() >= low - 1e-12
    assert "base, first and last" in legend_of_path(run)
    assert "from above" not in legend_of_path(run)
    assert not base_solids(planned_runs.balls(), 0)


def test_both_arms_are_drawn() -> None:
    run = planned_runs.balls()
    points = run.signals["arm_points"]
    run = planned_runs.balls(arm_points_right=points + np.tile([0.0, 0.8, 0.0], points.shape[1] // 3))
    figure = path_figure(run)
    assert legend_of_path(run)[:2] == ["tips", "first tip, no detour"]
    colors = [line.get_color() for line in figure.axes[0].lines]
    single = [line.get_color() for line in path_figure(planned_runs.balls()).axes[0].lines]
    dark = time_shades(7)[-1]
    assert sum(color == dark for color in colors) >= 2 * sum(color == dark for color in single) - 2
    assert figure.axes[0].get_ylim()[1] > 1.0


def test_a_plan_of_the_tip_alone_and_one_that_is_not_finite() -> None:
    run = planned_runs.balls()
    alone = dataclasses.replace(run, signals={k: v for k, v in run.signals.items() if k != "arm_points"})
    assert legend_of_path(alone)[:2] == ["tip", "tip, no detour"]
    points = run.signals["arm_points"].copy()
    points[7] = np.nan
    with pytest.raises(RecordError, match="has samples that are not finite, which no plan has"):
        path_figure(planned_runs.balls(arm_points=points))


def test_a_plan_file_has_three_figures(tmp_path: Path) -> None:
    path = tmp_path / "detour.h5"
    write_plan(planned_runs.planned(planned_runs.BALLS), path)
    found = plot(path)
    assert [one.name for one in found] == ["detour-joints_over_time.png", "detour-path.png", "detour-clearance.png"]
    assert all(one.stat().st_size > 10_000 for one in found)
    assert [one.name for one in plot(path, tmp_path / "one.svg", "clearance")] == ["one.svg"]
    with pytest.raises(UsageError, match=r"'tips': of a rollout there are run, .*joints_over_time, path, clearance"):
        plot(path, what="tips")
    with pytest.raises(UsageError, match="one file for 3 figures"):
        plot(path, tmp_path / "one.png")
    run = planned_runs.balls()
    assert is_plan(run)
    assert not is_plan(dataclasses.replace(run, signals={"clearance": run.signals["clearance"]}))


def test_a_plan_with_nothing_near_has_two_figures(tmp_path: Path) -> None:
    from fzcli.record.rollout_file import write_rollout

    path = tmp_path / "alone.h5"
    write_rollout(planned_runs.balls(clearance=np.full(401, np.inf)), path)
    assert [one.name for one in plot(path)] == ["alone-joints_over_time.png", "alone-path.png"]
    with pytest.raises(RecordError, match=r"alone\.h5: has nothing that could come near anything"):
        plot(path, what="clearance")


def test_distances_of_solids() -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-2, 2, (500, 3))
    ball = solid_of("sphere", [0.1, 0.2, 0.3, 0.5])
    np.testing.assert_allclose(ball.distance(points), np.linalg.norm(points - [0.1, 0.2, 0.3], axis=1) - 0.5)
    rod = solid_of("capsule", [-1, 0, 0, 1, 0, 0, 0.25])
    np.testing.assert_allclose(rod.distance(np.array([[0, 1, 0], [2, 0, 0], [0, 0, 0.1]])), [0.75, 0.75, -0.15])
    quat = np.array([np.cos(0.3), 0, 0, np.sin(0.3)])
    box = solid_of("box", [1, 0, 0, *quat, 0.4, 0.6, 0.8])
    turn = Rotation.from_quat(quat[[1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(box.distance(box.middle[None]), [-0.2])
    np.testing.assert_allclose(box.distance(box.middle + np.array([[0, 0.5, 0]]) @ turn.T), [0.2])
    np.testing.assert_allclose(np.abs(box.distance(box.corners)), 0.0, atol=1e-12)
    grown = rng.normal(size=(500, 3))
    surface = box.middle + (grown / np.abs(grown).max(axis=1, keepdims=True) * [0.2, 0.3, 0.4]) @ turn.T
    np.testing.assert_allclose(box.distance(surface), 0.0, atol=1e-12)


@pytest.mark.parametrize("azimuth", AZIMUTHS)
def test_what_is_behind_a_ball_is_hidden(azimuth: int) -> None:
    page = View(azimuth).page
    rng = np.random.default_rng(azimuth + 400)
    points = rng.uniform(-1, 1, (400, 3))
    ball = Round(np.array([0.1, 0.0, 0.2]), np.array([0.1, 0.0, 0.2]), 0.4)
    off = points - ball.middle
    beside = np.linalg.norm(off @ page[:2].T, axis=1)
    depth = off @ page[2]
    expected = (beside < 0.4) & (depth < np.sqrt(np.maximum(0.0, 0.4**2 - beside**2)))
    clear = np.abs(beside - 0.4) > 1e-3
    np.testing.assert_array_equal(hides(ball, points, page[2])[clear], expected[clear])


def test_a_thin_panel_hides_what_lies_behind_it() -> None:
    panel = Block(np.zeros(3), np.eye(3), np.array([1.0, 0.002, 1.0]))
    way = np.array([0.0, -1.0, 0.0])
    points = np.array([[0, 0.5, 0], [0, -0.5, 0], [0.7, 0.5, 0], [0.49, 3.0, 0.49]])
    np.testing.assert_array_equal(hides(panel, points, way), [True, False, False, True])


def test_outlines_hold_what_solids_cover() -> None:
    """Every point of a solid lies within the drawn faces on the page, and the faces within the solid."""
    from matplotlib.path import Path as Outline

    rng = np.random.default_rng(9)
    box = solid_of("box", [0.1, 0.2, 0.3, *np.array([0.8, 0.2, -0.4, 0.4]), 0.5, 0.2, 0.7])
    rod = solid_of("capsule", [0.1, -0.3, 0.2, -0.2, 0.4, 0.6, 0.15])
    for solid in (box, rod):
        for azimuth in AZIMUTHS[::3]:
            view = View(azimuth)
            points = solid.middle + rng.uniform(-0.7, 0.7, (2000, 3))
            points = points[solid.distance(points) < -0.005]
            outlines = [Outline(corners @ view.page[:2].T) for corners, _ in solid.faces(view)]
            inside = np.any([one.contains_points(points @ view.page[:2].T, radius=1e-3) for one in outlines], axis=0)
            assert inside.all()
    for corners, _ in box.faces(View(-55)):
        np.testing.assert_allclose(box.distance(corners), 0.0, atol=1e-12)
    for edge in rod.edges(View(-55)):
        np.testing.assert_allclose(rod.distance(edge), 0.0, atol=1e-9)


def test_pieces_of_lines_and_polygons() -> None:
    line = np.array([[0, 0, 0], [1, 0, 0], [1, 0.05, 0.0]])
    fine = finely(line, 0.3)
    assert np.linalg.norm(np.diff(fine, axis=0), axis=1).max() <= 0.3
    np.testing.assert_allclose(fine[[0, 4, 5]], line)
    square = np.array([[0, 0, -1], [0, 1, -1], [0, 1, 1], [0, 0, 1]], dtype=float)
    np.testing.assert_allclose(above(square, 0.0), [[0, 1, 0], [0, 1, 1], [0, 0, 1], [0, 0, 0]])
    assert len(above(square, 2.0)) == 0


def test_the_open_view_sees_past_a_wall() -> None:
    """A wall along x would hide a line beside it from the front, and shows it along its plane."""
    wall = Block(np.zeros(3), np.eye(3), np.array([2.0, 0.01, 2.0]))
    line = np.column_stack([np.linspace(-0.9, 0.9, 50), np.full(50, 0.3), np.zeros(50)])
    spread = np.random.default_rng(1).normal(size=(200, 3))
    chosen = open_view(spread, line, [wall])

    def covered(view: View) -> float:
        return float((hides(wall, line, view.page[2]) | hides(wall, line, -view.page[2])).mean())

    assert covered(chosen) == min(covered(View(azimuth)) for azimuth in AZIMUTHS)
    assert covered(chosen) < max(covered(View(azimuth)) for azimuth in AZIMUTHS)
