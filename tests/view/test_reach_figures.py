"""Joint and reach histories: the numbers of the record in the units people read, and several runs told apart."""

import dataclasses
from pathlib import Path
from typing import Any

import factory
import numpy as np
import pytest
import reaching_runs
from scipy.spatial.transform import Rotation

from fzcli.errors import RecordError, UsageError
from fzcli.record.rollout_file import write_rollout
from fzcli.record.sweep_file import write_sweep
from fzcli.record.sweep_record import KeptRun
from fzcli.spec.result import Status
from fzcli.view.joint_plot import joints_figure
from fzcli.view.plots import plot
from fzcli.view.reach_plot import reach_figure, turn_angle
from fzcli.view.rollout_plot import rollout_figure
from fzcli.view.target import drives, headline, outcome, tolerance


def labels(figure: Any) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes]


def legend(figure: Any) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def curves(axes: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): line.get_ydata() for line in axes.lines if not line.get_label().startswith("_")}


def shaded(axes: Any) -> list[tuple[float, float]]:
    return [(patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]


def test_joints_are_in_degrees() -> None:
    run = reaching_runs.alone()
    figure = joints_figure(run, "capture")
    assert labels(figure) == ["joint angle [deg]"]
    assert figure.axes[0].get_xlabel() == "time [s]"
    names = ["shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3"]
    assert legend(figure) == names
    drawn = curves(figure.axes[0])
    np.testing.assert_allclose(np.column_stack([drawn[name] for name in names]), np.rad2deg(run.q))
    assert len({line.get_color() for line in figure.axes[0].lines}) == 6
    assert figure._suptitle.get_text() == "capture\narrived after 0.44 s"


def test_sliding_joints_have_a_panel_in_metres() -> None:
    run = reaching_runs.alone(joint_units=("m", "rad", "rad", "rad", "rad", "m"))
    hinges, sliding = joints_figure(run).axes
    assert (hinges.get_ylabel(), sliding.get_ylabel()) == ("joint angle [deg]", "joint position [m]")
    assert (len(hinges.lines), len(sliding.lines)) == (4, 2)
    np.testing.assert_array_equal(sliding.lines[0].get_ydata(), run.q[:, 0])


def test_drives_after_a_restart_are_shaded() -> None:
    run = reaching_runs.driving(reaching_runs.alone(), (5, 12), (40, 45))
    assert drives(run) == [pytest.approx((0.05, 0.12)), pytest.approx((0.40, 0.44))]
    assert drives(factory.make_rollout()) == []
    figure = joints_figure(run)
    assert shaded(figure.axes[0]) == [pytest.approx((0.05, 0.12)), pytest.approx((0.40, 0.44))]
    assert legend(figure)[-1] == "drive after a restart"
    assert figure._suptitle.get_text() == "arrived after 0.44 s, 2 restarts"
    reach = reach_figure([("capture", run)])
    assert [len(shaded(axes)) for axes in reach.axes] == [2, 2, 2]
    assert legend(reach) == ["drive after a restart"]
    both = reach_figure([("a", run), ("b", reaching_runs.alone())])
    assert [len(shaded(axes)) for axes in both.axes] == [0, 0, 0]
    assert sum(line.get_linewidth() == 5 for line in both.axes[0].lines) == 2


def test_reach_of_one_run() -> None:
    run = reaching_runs.alone()
    figure = reach_figure([("fabrik", run)], "capture")
    assert labels(figure) == ["distance to target [mm]", "angle to target [deg]", "base turned by [deg]"]
    distance, angle, turn = (curves(axes)["fabrik: arrived after 0.44 s"] for axes in figure.axes)
    np.testing.assert_allclose(distance, 1e3 * run.signals["target_distance"])
    np.testing.assert_allclose(angle, np.rad2deg(run.signals["target_angle"]))
    assert turn[-1] == pytest.approx(29.59, abs=0.01)
    assert [axes.get_yscale() for axes in figure.axes] == ["log", "log", "linear"]
    assert [text.get_text() for axes in figure.axes for text in axes.texts] == ["tolerance 10 mm", "tolerance 2 deg"]
    assert 10.0 in [line.get_ydata()[0] for line in figure.axes[0].lines]
    assert figure.axes[0].get_ylim()[0] < distance[-1]
    assert not figure.legends


def test_reach_tells_variants_apart() -> None:
    run = reaching_runs.capture()
    figure = reach_figure([("fabrik", run), *run.variants.items()])
    missed = run.variants["translation only"].signals["miss_distance"]
    assert missed[-1] > 0.1
    texts = legend(figure)
    assert texts[0] == "fabrik: arrived after 0.44 s"
    assert texts[1].startswith("least squares: arrived after 1.2")
    assert texts[2] == "translation only: arrived after 0.49 s"
    assert texts[3] == f"translation only, on the base that turns: {1e3 * missed[-1]:.3g} mm off"
    np.testing.assert_allclose(curves(figure.axes[0])[texts[3]], 1e3 * missed)
    assert [len(curves(axes)) for axes in figure.axes] == [4, 4, 4]
    lines = {line.get_label(): line for line in figure.axes[0].lines}
    assert lines[texts[2]].get_color() == lines[texts[3]].get_color() != lines[texts[0]].get_color()
    assert lines[texts[3]].get_linestyle() == "--"


def test_reach_without_angle_or_tolerance() -> None:
    origin = dataclasses.replace(factory.ORIGIN, spec_text="stop: {position: null}\n")
    run = reaching_runs.without(reaching_runs.alone(provenance=origin), "target_angle", "target_direction")
    figure = reach_figure([("point", run)])
    assert labels(figure) == ["distance to target [mm]", "base turned by [deg]"]
    assert not figure.axes[0].texts
    far = reaching_runs.alone(signals={"target_distance": 40 + run.signals["target_distance"]}, provenance=origin)
    axes = reach_figure([("far", far)]).axes[0]
    assert (axes.get_ylabel(), axes.get_yscale()) == ("distance to target [m]", "linear")


def test_turn_angles_are_those_of_the_relative_rotation() -> None:
    rng = np.random.default_rng(6)
    quat = rng.normal(size=(200, 4))
    quat /= np.linalg.norm(quat, axis=1, keepdims=True)
    turns = Rotation.from_quat(quat[:, [1, 2, 3, 0]])
    np.testing.assert_allclose(turn_angle(quat), (turns[0].inv() * turns).magnitude(), atol=1e-7)
    assert turn_angle(-quat[:1])[0] == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("stop: {position: 0.01, direction: 0.03}", (0.01, 0.03)),
        ("stop: {position: 0.01, direction: null, orientation: 0.02}", (0.01, 0.02)),
        ("stop: null", (None, None)),
        ("controller: {kind: clik}", (None, None)),
        ("[no mapping]", (None, None)),
        ("{not: [yaml", (None, None)),
    ],
)
def test_tolerances_come_from_the_specification(text: str, expected: tuple[float | None, float | None]) -> None:
    run = factory.make_rollout(provenance=dataclasses.replace(factory.ORIGIN, spec_text=text + "\n"))
    assert (tolerance(run, "position"), tolerance(run, "direction", "orientation")) == expected


def test_titles_say_how_a_run_ended() -> None:
    reason = "target not reached in 0.44 s, 98.1 mm and 70.2 deg short: the arm came to rest short of it"
    run = reaching_runs.alone(metrics={"arrived": 0.0, "restarts": 1.0}, status=Status("flagged", reason))
    assert outcome(run) == "not arrived in 0.44 s, 1 restart"
    title, *rest = headline(run, "literal").split("\n")
    assert title == "literal"
    assert " ".join(rest) == f"flagged: {reason}"
    assert max(map(len, rest)) <= 60
    assert headline(reaching_runs.alone(), "") == "arrived after 0.44 s"
    assert headline(factory.make_rollout(status=Status("ok")), "fig3") == "fig3\nok"


def test_a_run_with_a_target_is_drawn_four_times(tmp_path: Path) -> None:
    path = tmp_path / "capture.h5"
    write_rollout(reaching_runs.capture(), path)
    tags = ("configurations", "tip_path", "joints", "reach")
    assert plot(path) == [tmp_path / f"capture-{tag}.png" for tag in tags]
    assert plot(path, tmp_path / "figures") == [tmp_path / "figures" / f"capture-{tag}.png" for tag in tags]
    for tag in tags:
        assert (tmp_path / f"capture-{tag}.png").read_bytes().startswith(b"\x89PNG")
        assert plot(path, tmp_path / f"{tag}.svg", tag) == [tmp_path / f"{tag}.svg"]
    words = (tmp_path / "reach.svg").read_text(encoding="utf-8")  # in comments, beside the letters' outlines
    assert "translation only, on the base that turns" in words
    assert plot(path, what="comparison") == [tmp_path / "capture-comparison.png"]
    assert plot(path, what="run") == [tmp_path / "capture-run.png"]
    with pytest.raises(UsageError) as caught:
        plot(path, tmp_path / "one.png")
    names = ", ".join(tags)
    assert str(caught.value).endswith(f"one.png: one file for 4 figures ({names}); name a folder or one of them")
    assert not (tmp_path / "one.png").exists()


def test_figures_of_files_without_their_signals_are_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "old.h5"
    write_rollout(factory.make_rollout(tuned=False), path)
    for what, name in (("configurations", "arm_points"), ("reach", "target_distance")):
        with pytest.raises(RecordError) as caught:
            plot(path, what=what)
        words = f"{path}: has no signal {name!r}, which {what!r} is drawn from; its signals: tip_error"
        assert str(caught.value) == words
    assert plot(path, what="tip_path") == [tmp_path / "old-tip_path.png"]
    assert plot(path, what="joints") == [tmp_path / "old-joints.png"]


def test_kept_runs_with_targets_are_compared_by_their_reach(tmp_path: Path) -> None:
    run = reaching_runs.capture()
    runs = [reaching_runs.alone(), run.variants["least squares"]]
    kept = tuple(KeptRun(index, 7, "best", one) for index, one in enumerate(runs))
    configs = [{"controller.kind": kind} for kind in ("fabrik", "dls")]
    record = dataclasses.replace(factory.make_sweep(5), configs=configs, kept=kept)
    write_sweep(record, tmp_path / "pair.h5")
    assert plot(tmp_path / "pair.h5", tmp_path / "pair.svg") == [tmp_path / "pair.svg"]
    words = (tmp_path / "pair.svg").read_text(encoding="utf-8")
    assert "fabrik: arrived after 0.44 s" in words
    assert "distance to target [mm]" in words


def test_a_whole_run_shows_the_distance_to_its_target() -> None:
    figure = rollout_figure(reaching_runs.alone())
    assert "target distance [m]" in labels(figure)
