"""Figures in space: what stands where, in the scale and view that the reader needs, and nothing cut off."""

import dataclasses
from itertools import pairwise
from typing import Any

import factory
import numpy as np
import pytest
import reaching_runs
from matplotlib.transforms import Bbox
from scipy.spatial.transform import Rotation

from fzcli.errors import RecordError
from fzcli.view.arm_plot import (
    configurations_figure,
    even_marks,
    mark_interval,
    time_shades,
    tip_path_figure,
    typical_steps,
)
from fzcli.view.space import ROOM, View, best_view, cube_faces, inner_ticks


def lines(figure: Any) -> dict[str, np.ndarray]:
    """The labelled paths of a 3-D figure, (N, 3) each."""
    return {
        line.get_label(): np.array(line.get_data_3d()).T
        for line in figure.axes[0].lines
        if not line.get_label().startswith("_")
    }


def legend(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def polygons(figure: Any) -> list[np.ndarray]:
    return [np.array(item._faces) for item in figure.axes[0].collections]


def boxes(figure: Any) -> dict[str, Bbox]:
    """Where the parts of a drawn figure lie, in dots."""
    figure.draw_without_rendering()
    axes = figure.axes[0]
    return {
        **{name: getattr(axes, f"{name}axis").get_tightbbox() for name in "xyz"},
        "legend": figure.legends[0].get_window_extent(),
        "title": figure._suptitle.get_window_extent(),
    }


def test_configurations_are_the_arm_at_typical_steps() -> None:
    run = reaching_runs.alone()
    arms = run.signals["arm_points"].reshape(len(run.time), -1, 3)
    figure = configurations_figure(run, "capture")
    found = lines(figure)
    times = [label for label in found if label.endswith(" s")]
    assert len(times) == 7
    assert (times[0], times[-1]) == ("0.00 s", "0.44 s")
    assert legend(figure) == [*times, "target"]
    for label in times:
        step = round(float(label.removesuffix(" s")) / 0.01)
        np.testing.assert_array_equal(found[label], arms[step])
        assert found[label].shape == (8, 3)  # base, six joints, tip
    np.testing.assert_allclose(found["target"], [[0.3, 0.5, 0.8]])
    assert figure._suptitle.get_text() == "capture\narrived after 0.44 s"
    axes = figure.axes[0]
    assert [axes.get_xlabel(), axes.get_ylabel(), axes.get_zlabel()] == ["x [m]", "y [m]", "z [m]"]


def test_the_base_is_drawn_as_it_stands_at_start_and_end() -> None:
    run = reaching_runs.alone()
    *cubes, head = polygons(configurations_figure(run))
    assert head.shape == (1, 3, 3)
    assert len(cubes) == 2
    for cube, step in zip(cubes, (0, -1), strict=True):
        np.testing.assert_allclose(cube.reshape(-1, 3).mean(axis=0), run.base_position[step], atol=1e-12)
    turned = Rotation.from_quat(run.base_quat[-1][[1, 2, 3, 0]])
    before, after = (cube.reshape(-1, 3) - run.base_position[k] for cube, k in zip(cubes, (0, -1), strict=True))
    np.testing.assert_allclose(after, turned.apply(before), atol=1e-12)


def test_cube_faces_are_those_of_a_turned_cube() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        centre, quat, edge = rng.normal(size=3), rng.normal(size=4), rng.uniform(0.1, 2.0)
        faces = cube_faces(centre, quat, edge)
        back = Rotation.from_quat(quat[[1, 2, 3, 0]]).inv().apply((faces - centre).reshape(-1, 3))
        np.testing.assert_allclose(np.abs(back), 0.5 * edge)
        assert len({tuple(np.sign(corner)) for corner in back}) == 8
        sides = np.linalg.norm(faces - np.roll(faces, 1, axis=1), axis=2)
        np.testing.assert_allclose(sides, edge)


@pytest.mark.parametrize("figure", [configurations_figure, tip_path_figure])
def test_lengths_are_the_same_along_all_axes(figure: Any) -> None:
    axes = figure(reaching_runs.alone()).axes[0]
    extent = np.array([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())])
    np.testing.assert_allclose(axes._box_aspect / extent, (axes._box_aspect / extent)[0])
    assert axes.get_proj()[3].tolist()[:3] == [0, 0, 0]  # no perspective


def flat(run: Any) -> Any:
    """The run squeezed into the plane z = 0."""
    arms, target = run.signals["arm_points"].copy(), run.signals["target_position"] * [1, 1, 0]
    arms[:, 2::3] = 0
    signals = {**reaching_runs.without(run, "target_direction").signals, "arm_points": arms, "target_position": target}
    plane = np.array([1.0, 1.0, 0.0])
    return dataclasses.replace(
        run, signals=signals, tip_position=run.tip_position * plane, base_position=run.base_position * plane
    )


@pytest.mark.parametrize("figure", [configurations_figure, tip_path_figure])
@pytest.mark.parametrize("kind", ["capture", "flat", "single", "long title", "still"])
def test_nothing_is_cut_off_and_nothing_overlaps(figure: Any, kind: str) -> None:
    run, title = reaching_runs.alone(), "a title"
    if kind == "flat":
        run = flat(run)
    elif kind == "single":
        run = reaching_runs.cut(run, 1)
    elif kind == "long title":
        title = "a title that is a good deal longer than the plot is wide, as those of kept runs of a sweep are"
    elif kind == "still":
        run = reaching_runs.alone(tip_position=run.tip_position[:1].repeat(45, axis=0))
    drawn = figure(run, title)
    parts = boxes(drawn)
    page = Bbox.from_bounds(0, 0, *(drawn.get_size_inches() * drawn.dpi))
    for name, box in parts.items():
        assert box.x0 >= page.x0 - 1, name
        assert box.y0 >= page.y0 - 1, name
        assert box.x1 <= page.x1 + 1, name
        assert box.y1 <= page.y1 + 1, name
        assert name == "legend" or not box.overlaps(parts["legend"]), name
        assert name == "title" or not box.overlaps(parts["title"]), name
    plot = Bbox.union([parts[name] for name in "xyz"]).size / drawn.dpi
    assert 0.85 < max(plot / ROOM) < 1.02  # the axes fill their room


def test_typical_steps_are_even_in_travel() -> None:
    rng = np.random.default_rng(5)
    for count in (2, 3, 10, 200):
        arms = np.cumsum(rng.normal(size=(count, 4, 3)) * rng.uniform(0, 1, (count, 1, 1)), axis=0)
        steps = typical_steps(arms, 7)
        assert (steps[0], steps[-1]) == (0, count - 1)
        assert (np.diff(steps) > 0).all()
        assert len(steps) <= 7
        moves = np.linalg.norm(np.diff(arms, axis=0), axis=2).sum(axis=1)
        travel = np.concatenate([[0], np.cumsum(moves)])
        wanted = travel[-1] * np.arange(7) / 6
        nearest = np.abs(travel[steps][:, None] - wanted).min(axis=0)
        assert (nearest <= 0.5 * moves.max() + 1e-12).all()
    assert typical_steps(np.zeros((1, 4, 3)), 7).tolist() == [0]
    assert typical_steps(np.zeros((5, 4, 3)), 7).tolist() == [0, 4]


def test_time_goes_from_light_to_dark() -> None:
    brightness = [np.dot(color[:3], (0.2126, 0.7152, 0.0722)) for color in time_shades(7)]
    assert all(later < earlier for earlier, later in pairwise(brightness))


def test_tip_path_shows_tip_base_start_end_and_target() -> None:
    run = reaching_runs.alone()
    figure = tip_path_figure(run, "capture")
    found = lines(figure)
    assert list(found) == legend(figure) == ["tip", "tip, from above", "base origin", "start", "end", "target"]
    np.testing.assert_array_equal(found["tip"], run.tip_position)
    np.testing.assert_array_equal(found["tip, from above"][:, :2], run.tip_position[:, :2])
    np.testing.assert_array_equal(found["base origin"], run.base_position)
    np.testing.assert_array_equal(found["start"][0], run.tip_position[0])
    np.testing.assert_array_equal(found["end"][0], run.tip_position[-1])


def test_time_marks_lie_on_the_path_at_their_times_and_stand_apart() -> None:
    run = reaching_runs.alone()
    figure = tip_path_figure(run)
    axes = figure.axes[0]
    dots = np.array([line.get_data_3d() for line in axes.lines if line.get_markersize() == 4]).reshape(-1, 3)
    instants = [float(text.get_text().removesuffix(" s")) for text in axes.texts]
    assert len(instants) == len(dots) >= 4
    np.testing.assert_allclose(np.array(instants) / 0.05, np.round(np.array(instants) / 0.05), atol=1e-9)
    for instant, dot in zip(instants, dots, strict=True):
        np.testing.assert_allclose(dot, [np.interp(instant, run.time, axis) for axis in run.tip_position.T])
    page = View(axes.azim, axes.elev).page[:2]
    places = np.array([page @ point for point in (*dots, run.tip_position[0], run.tip_position[-1])])
    gaps = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert gaps.min() > 0.05
    labels = np.array([page @ text.get_position_3d() for text in axes.texts])
    apart = np.abs(labels[:, None] - labels) + np.eye(len(labels))[..., None]
    assert ((apart[..., 0] > 0.05) | (apart[..., 1] > 0.03)).all()


@pytest.mark.parametrize(
    ("duration", "interval"), [(0.44, 0.05), (0.62, 0.1), (1.0, 0.2), (9.0, 1.0), (10.0, 2.0), (0.009, 0.001)]
)
def test_mark_intervals_are_round(duration: float, interval: float) -> None:
    assert mark_interval(duration, 9) == pytest.approx(interval)


def test_marks_suit_the_time_in_which_the_tip_moves() -> None:
    time = np.linspace(0, 10, 1001)
    tip = np.column_stack([np.minimum(time, 1.0), np.zeros((1001, 2))])  # one second's motion, nine at rest
    marks = even_marks(time, tip)
    assert [instant for instant, _, _ in marks][:3] == pytest.approx([0.1, 0.2, 0.3])
    assert even_marks(time, np.ones((1001, 3))) == []


def test_the_view_shows_the_spread_and_the_arrow() -> None:
    rng = np.random.default_rng(8)
    for _ in range(50):
        points, arrow = rng.normal(size=(30, 3)) * rng.uniform(0.1, 1, 3), rng.normal(size=3)
        page = best_view(points, arrow).page
        np.testing.assert_allclose(page @ page.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(page) == pytest.approx(1)
        assert np.linalg.norm(page[:2] @ arrow) > 0.3 * np.linalg.norm(arrow)
    wall = np.column_stack([rng.normal(size=200), np.zeros(200), rng.normal(size=200)])  # the plane y = 0
    assert abs(best_view(wall).page[2][1]) > 0.8


def test_ticks_keep_clear_of_the_ends() -> None:
    rng = np.random.default_rng(9)
    for _ in range(100):
        low, width = rng.normal(), 10 ** rng.uniform(-3, 2)
        ticks = inner_ticks(np.array([low, low + width]), 4)
        assert len(ticks) >= 2
        assert low < min(ticks) < max(ticks) < low + width


def test_a_moving_target_has_a_path_and_a_mere_point_no_arrow() -> None:
    run = reaching_runs.alone()
    moved = run.signals["target_position"] + np.outer(run.time - run.time[-1], [0.3, -0.2, 0.1])
    figure = configurations_figure(reaching_runs.alone(signals={"target_position": moved}))
    np.testing.assert_allclose(lines(figure)["target's path"], moved)
    np.testing.assert_allclose(lines(figure)["target"], moved[-1:])
    point = configurations_figure(reaching_runs.without(run, "target_direction"))
    assert [len(faces) for faces in polygons(point)] == [6, 6]


def test_runs_without_a_target_and_failed_ones_are_drawn_too() -> None:
    path = tip_path_figure(factory.make_rollout(), "any run")
    assert legend(path) == ["tip", "tip, from above", "base origin", "start", "end"]
    assert path._suptitle.get_text() == "any run\nflagged: tip error 2e-2 m > 1e-2 m"
    run = reaching_runs.alone()
    arms, tip = run.signals["arm_points"].copy(), run.tip_position.copy()
    arms[30:], tip[30:] = np.nan, np.nan
    broken = reaching_runs.alone(tip_position=tip, signals={"arm_points": arms})
    assert legend(configurations_figure(broken))[-2:] == ["0.29 s", "target"]
    assert len(lines(tip_path_figure(broken))["tip"]) == 30


def test_what_is_missing_is_named() -> None:
    with pytest.raises(RecordError) as caught:
        configurations_figure(factory.make_rollout(tuned=False))
    assert str(caught.value) == (
        "has no signal 'arm_points', which 'configurations' is drawn from; its signals: tip_error"
    )
    run = reaching_runs.alone(tip_position=np.full((45, 3), np.nan))
    with pytest.raises(RecordError, match="has no finite sample to draw"):
        tip_path_figure(run)
