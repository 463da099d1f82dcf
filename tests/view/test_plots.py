"""Figures: what is drawn, where it goes, and what cannot be drawn."""

import dataclasses
import subprocess
import sys
from pathlib import Path
from typing import Any

import casadi as ca
import factory
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fzcli.errors import RecordError, UsageError
from fzcli.record.rollout_file import write_rollout
from fzcli.record.sweep_file import write_sweep
from fzcli.record.sweep_record import KeptRun
from fzcli.record.table import build_table
from fzcli.record.table_spec import TableSpec
from fzcli.spec.rulebase import Input, Output, Rulebase, RuleText, Term
from fzcli.view.attitude import roll_pitch_yaw
from fzcli.view.plots import plot
from fzcli.view.rollout_plot import plot_comparison, rollout_figure
from fzcli.view.rulebase_plot import outline, plot_rulebase, rulebase_figure
from fzcli.view.table_plot import table_figure

ROOT = Path(__file__).parents[2]
TABLE = TableSpec.of(factory.TABLE, (ROOT / "runs",))


def labels(figure: Any) -> list[str]:
    return [axes.get_ylabel() for axes in figure.axes]


def is_png(path: Path) -> bool:
    return path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size > 10_000


def test_roll_pitch_yaw_are_zyx_angles() -> None:
    rng = np.random.default_rng(4)
    quat = rng.normal(size=(500, 4))
    expected = Rotation.from_quat(quat[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, ::-1]
    ours = np.array([roll_pitch_yaw(one[None])[0] for one in quat])
    np.testing.assert_allclose(ours, expected, atol=1e-7)


def test_yaw_is_continuous_past_half_a_turn() -> None:
    angle = np.linspace(0, 4 * np.pi, 200)
    quat = np.column_stack([np.cos(angle / 2), np.zeros((200, 2)), np.sin(angle / 2)])
    np.testing.assert_allclose(roll_pitch_yaw(quat)[:, 2], angle, atol=1e-12)


def test_a_run_shows_what_it_has() -> None:
    figure = rollout_figure(factory.make_rollout(), "a run")
    assert labels(figure) == [
        "joint position [rad]",
        "tip error [m]",
        "base attitude [rad]",
        "gain [1/s]",
        "oscillating joints",
    ]
    assert len(figure.axes[0].lines) == 4
    np.testing.assert_array_equal(figure.axes[0].lines[1].get_ydata(), factory.make_rollout().q[:, 1])
    bare = rollout_figure(factory.make_rollout(tuned=False, joint_units=("rad", "m", "rad", "rad")))
    assert labels(bare) == ["joint position [rad or m]", "tip error [m]", "base attitude [rad]"]
    assert bare.axes[-1].get_xlabel() == "time [s]"


def test_comparison_has_yaw_on_the_left_and_gains_on_the_right() -> None:
    runs = [("unconstrained", factory.make_rollout(1, tuned=False)), ("fuzzy", factory.make_rollout(2))]
    left, right = plot_comparison(runs).axes
    assert [line.get_label() for line in left.lines] == ["unconstrained", "fuzzy"]
    np.testing.assert_array_equal(left.lines[0].get_ydata(), roll_pitch_yaw(runs[0][1].base_quat)[:, 2])
    assert len(right.lines) == 1
    np.testing.assert_array_equal(right.lines[0].get_ydata(), runs[1][1].signals["gain"][:, 0])
    assert left.lines[1].get_color() == right.lines[0].get_color()


def test_a_run_with_variants_is_drawn_as_a_comparison(tmp_path: Path) -> None:
    variants = {"unconstrained": factory.make_rollout(1, tuned=False)}
    origin = dataclasses.replace(factory.ORIGIN, spec_text="controller: {kind: fuzzy_clik}\n")
    write_rollout(factory.make_rollout(2, variants=variants, provenance=origin), tmp_path / "fig.h5")
    assert plot(tmp_path / "fig.h5") == [tmp_path / "fig-comparison.png"]
    assert is_png(tmp_path / "fig-comparison.png")
    assert plot(tmp_path / "fig.h5", what="run") == [tmp_path / "fig-run.png"]
    write_rollout(factory.make_rollout(), tmp_path / "one.h5")
    assert plot(tmp_path / "one.h5") == [tmp_path / "one-run.png"]
    with pytest.raises(RecordError, match=r"one\.h5: holds one run without variants, nothing to compare"):
        plot(tmp_path / "one.h5", what="comparison")


def test_table_figure_draws_the_tables_numbers() -> None:
    table = build_table(factory.make_sweep(50), TABLE)
    figure = table_figure(table)
    assert labels(figure) == [
        "tip error mean [m]",
        "yaw abs max [rad]",
        "yaw abs mean [rad]",
        "oscillating joints mean",
        "lost runs [%]",
        "tip error mean less that\nof clik [m]",
        "yaw abs max less that\nof clik [rad]",
        "yaw abs mean less that\nof clik [rad]",
        "oscillating joints mean less that\nof clik",
    ]
    yaw = figure.axes[2]
    assert yaw.get_xscale() == "log"
    drawn = [list(line.get_ydata()) for line in yaw.lines]
    for kind in table.columns:
        stats = [table.cells[row, kind].statistics["yaw_abs_mean"] for row in table.rows]
        for name in ("mean", "median", "paper"):
            assert [getattr(one, name) for one in stats] in drawn


def test_table_of_named_rows_has_them_as_ticks(tmp_path: Path) -> None:
    spec = {"rows": "controller.kind", "columns": "controller.gain", "show": ["yaw_abs_mean"]}
    figure = table_figure(build_table(factory.make_sweep(20), spec))
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == ["clik", "fuzzy_clik"]
    assert figure.axes[0].get_xscale() == "linear"


def test_long_names_of_rows_stand_in_a_key_and_numbers_below_the_axes() -> None:
    sweep = factory.make_sweep(20)
    configs = [{**config, "controller.rulebase": f"rules_of_kind_{i}"} for i, config in enumerate(sweep.configs)]
    table = build_table(dataclasses.replace(sweep, configs=configs), {"show": ["yaw_abs_mean"]})
    figure = table_figure(table, "study")
    names = [str(row) for row in table.rows]
    assert max(map(len, names)) > 24
    assert [text.get_text() for text in figure.axes[0].get_xticklabels()] == [str(i + 1) for i in range(len(names))]
    title, *key = figure.get_suptitle().splitlines()
    assert title == "study"
    assert key == [f"{i}  {name}" for i, name in enumerate(names, 1)]
    figure.canvas.draw()
    heights = [axes.get_position().height for axes in figure.axes]
    assert min(heights) > 0.1  # the key leaves the panels their room


def test_files_are_drawn_beside_themselves_or_where_told(tmp_path: Path) -> None:
    write_rollout(factory.make_rollout(), tmp_path / "run.h5")
    assert plot(tmp_path / "run.h5") == [tmp_path / "run-run.png"]
    assert is_png(tmp_path / "run-run.png")
    assert plot(tmp_path / "run.h5", tmp_path / "a" / "x.svg") == [tmp_path / "a" / "x.svg"]
    assert "<svg" in (tmp_path / "a" / "x.svg").read_text()[:1000]
    assert plot(tmp_path / "run.h5", tmp_path / "a") == [tmp_path / "a" / "run-run.png"]
    write_sweep(factory.make_sweep(20), tmp_path / "s.h5", table=TABLE)
    assert plot(tmp_path / "s.h5") == [tmp_path / "s-table.png"]
    assert is_png(tmp_path / "s-table.png")


def test_kept_runs_of_one_trajectory_are_compared(tmp_path: Path) -> None:
    kinds = [{"controller.kind": kind} for kind in ("unconstrained", "clik", "fuzzy_clik")]
    kept = tuple(KeptRun(index, 42, "best", factory.make_rollout(index)) for index in range(3))
    record = dataclasses.replace(factory.make_sweep(5), configs=kinds, kept=kept)
    write_sweep(record, tmp_path / "fig3.h5")
    assert plot(tmp_path / "fig3.h5") == [tmp_path / "fig3-comparison.png"]
    runs = plot(tmp_path / "fig3.h5", tmp_path / "runs", "runs")
    assert [path.name for path in runs] == ["fig3-run0.png", "fig3-run1.png", "fig3-run2.png"]
    assert all(map(is_png, runs))


def test_what_cannot_be_drawn_says_so(tmp_path: Path) -> None:
    write_sweep(factory.make_sweep(5, kept=2), tmp_path / "s.h5")
    write_sweep(factory.make_sweep(5, kept=0), tmp_path / "bare.h5")
    cases: list[tuple[str, str | None, str | None, type[Exception], str]] = [
        ("s.h5", None, "tabel", UsageError, "plot: 'tabel': of a sweep there are table, comparison, runs"),
        ("s.h5", None, "table", RecordError, "s.h5: has no table section to draw"),
        ("s.h5", None, "comparison", RecordError, "keeps no two configurations of one trajectory"),
        ("bare.h5", None, None, RecordError, "keeps no runs to draw, and has no table section"),
        ("s.h5", "x.gif", "runs", UsageError, "one file for 2 figures (run0, run1); name a folder"),
        ("none.h5", None, None, RecordError, "none.h5: no such file"),
    ]
    for name, out, what, error, message in cases:
        with pytest.raises(error) as caught:
            plot(tmp_path / name, out, what)
        assert message in str(caught.value)
    write_rollout(factory.make_rollout(), tmp_path / "run.h5")
    with pytest.raises(
        UsageError, match=r"x\.gif: cannot draw '\.gif' files; expected one of \.png, \.svg, \.pdf"
    ):
        plot(tmp_path / "run.h5", tmp_path / "x.gif")


def terms(**shapes: tuple[str, tuple[float, ...]]) -> dict[str, Term]:
    return {name: Term.model_validate({"shape": s, "numbers": n}) for name, (s, n) in shapes.items()}


def small_rulebase() -> tuple[Rulebase, ca.Function]:
    rulebase = Rulebase(
        name="small",
        inputs={
            "error": Input(range=(0, 1), terms=terms(Z=("ramp", (0.5, 0)), P=("ramp", (0, 0.5)))),
            "count": Input(range=(0, 10), terms=terms(OFF=("ramp", (1, 0)), ON=("gaussian", (1, 0.5)))),
            "third": Input(range=(-2, 4), terms=terms(A=("rectangle", (0, 1)))),
        },
        outputs={
            "step": Output(range=(-900, 5), terms=terms(N=("singleton", (-900,)), P=("triangle", (1, 2, 3))))
        },
        rules=(RuleText(text="if error is Z then step is P"),),
    )
    error, count, third, last = (ca.SX.sym(name) for name in ("error", "count", "third", "step_previous"))
    names = ["error", "count", "third", "step_previous"]
    outputs = [error * 5 - 300 * count + third, ca.vertcat(error, count)]
    return rulebase, ca.Function(
        "surface", [error, count, third, last], outputs, names, ["step", "firing_strength"]
    )


def test_rule_base_shows_terms_and_surface(tmp_path: Path) -> None:
    rulebase, surface = small_rulebase()
    figure = rulebase_figure(rulebase, surface)
    assert [axes.get_xlabel() for axes in figure.axes] == ["error", "count", "third", "step", "error"]
    lower = figure.axes[-1]
    assert [line.get_label() for line in lower.lines] == [
        f"count = {level:g}" for level in (0, 0.25, 0.5, 0.75, 1)
    ]
    error = np.array(lower.lines[2].get_xdata())
    np.testing.assert_allclose(lower.lines[2].get_ydata(), error * 5 - 150 + 1)
    assert lower.get_yscale() == "symlog"
    path = plot_rulebase(rulebase, surface, tmp_path / "rulebase.png")
    assert is_png(path)


@pytest.mark.parametrize(
    ("shape", "numbers", "at", "membership"),
    [
        ("triangle", (0.0, 0.25, 1.0), [0.125, 0.25, 0.625], [0.5, 1.0, 0.5]),
        ("trapezoid", (0.0, 0.2, 0.6, 1.0), [0.1, 0.4, 0.8], [0.5, 1.0, 0.5]),
        ("ramp", (0.2, 0.6), [0.1, 0.4, 0.9], [0.0, 0.5, 1.0]),
        ("ramp", (0.6, 0.2), [0.1, 0.4, 0.9], [1.0, 0.5, 0.0]),
        ("rectangle", (0.2, 0.6), [0.3, 0.5], [1.0, 1.0]),
        ("gaussian", (0.5, 0.1), [0.5, 0.6], [1.0, np.exp(-0.5)]),
    ],
)
def test_outlines_are_the_memberships(shape: Any, numbers: tuple, at: list, membership: list) -> None:
    x, y = outline(Term(shape=shape, numbers=numbers), (0.0, 1.0))
    order = np.argsort(x, kind="stable")
    np.testing.assert_allclose(np.interp(at, x[order], y[order]), membership, atol=1e-3)


def test_drawing_leaves_matplotlib_alone(tmp_path: Path) -> None:
    write_rollout(factory.make_rollout(), tmp_path / "run.h5")
    script = (
        "import sys; from fzcli.view.plots import plot\n"
        "assert not [m for m in sys.modules if m.startswith('matplotlib')]\n"
        f"plot({str(tmp_path / 'run.h5')!r})\n"
        "import matplotlib\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
        "assert matplotlib.rcParams['lines.linewidth'] == matplotlib.rcParamsDefault['lines.linewidth']\n"
        "assert 'casadi' not in sys.modules and 'fzcli.model' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
