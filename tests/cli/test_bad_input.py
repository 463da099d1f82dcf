"""Bad input: exit code 2, a message that names place, field and rule, and never a traceback."""

from pathlib import Path

import pytest
from cli_cases import RUN, SWEEP, Invoke

BOMB = "a: &a [x, x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]\n" for before, name in zip("abcdef", "bcdefg", strict=True)
)
TEXTS = {
    "unknown key": (RUN + "stepp: 0.01\n", ["bad.yaml:6:1: stepp: unknown key; did you mean 'step'?"]),
    "two at once": (
        RUN.replace("gain: 10", "gain: -1").replace("1 s", "1 kg"),
        ["bad.yaml:4:", "duration: ", "'1 kg'", "bad.yaml:5:32: controller.gain: must be >= 0"],
    ),
    "nan reference": (
        RUN.replace("[1, 1, 0]", "[.nan, 1, 0]"),
        ["reference.direction.0: must be a finite number, got nan"],
    ),
    "zero reference": (RUN.replace("[1, 1, 0]", "[0, 0, 0]"), ["reference.direction: ", "points nowhere"]),
    "unknown robot": (
        RUN.replace("bulgarelli4", "bulgareli4"),
        ["robot: no robot named 'bulgareli4'; did you mean 'bulgarelli4'?"],
    ),
    "unknown tip": (RUN.replace("gain: 10", "gain: 10, tip: foot"), ["the robot has no tip 'foot'; it has hand"]),
    "joint count": (
        RUN.replace("0.303, 0.549", "0.303"),
        ["bad.yaml:3:12: start.q: has 3 values for 4 active joints (q1, q2, q3, q4)"],
    ),
    "unknown kind of law": (RUN.replace("clik", "klik"), ["controller", "'klik'", "clik"]),
    "other kind": ("kind: robot\n", ["bad.yaml:1:7: kind: simulate is wanted, got 'robot'"]),
    "no kind": ("robot: bulgarelli4\n", ["kind is missing; simulate is wanted"]),
    "duplicate key": (RUN + "robot: planar3\n", ["bad.yaml:6:1: ", "robot"]),
    "bomb": (BOMB, ["bad.yaml:4:4: more than 100000 values, aliases written out"]),
    "empty": ("", ["bad.yaml: ", "empty"]),
    "no mapping": ("[1, 2]\n", ["must be a mapping"]),
    "not yaml": ("a: [1, 2\n", ["bad.yaml:"]),
    "endless": (
        RUN.replace("{kind: line, direction: [1, 1, 0], length: 0.1, duration: 1 s}", "{kind: hold}"),
        ["duration: is missing"],
    ),
}


@pytest.mark.parametrize("case", TEXTS)
def test_a_bad_run_is_told_with_its_place(fzcli: Invoke, tmp_path: Path, case: str) -> None:
    text, wanted = TEXTS[case]
    (tmp_path / "bad.yaml").write_text(text)
    for command in ("simulate", "validate"):
        if command == "validate" and "kind" in case:
            continue
        result = fzcli(command, "bad.yaml", code=2)
        assert result.stdout == ""
        assert result.stderr.startswith("error: ")
        assert "Traceback" not in result.stderr
        for part in wanted:
            assert part in result.stderr
    assert not (tmp_path / "bad").exists()


def test_what_is_no_yaml_file(fzcli: Invoke, tmp_path: Path) -> None:
    (tmp_path / "binary.yaml").write_bytes(b"\x7fELF\0\0\1")
    (tmp_path / "folder.yaml").mkdir()
    assert "binary.yaml: is a binary file, not YAML text" in fzcli("simulate", "binary.yaml", code=2).stderr
    assert "folder.yaml: is a directory; name a file in it" in fzcli("simulate", "folder.yaml", code=2).stderr
    missing = fzcli("simulate", "rum.yaml", code=2).stderr
    assert "no such file 'rum.yaml'; did you mean 'run.yaml'?" in missing
    assert "no run named 'fig33'; did you mean 'fig3'?" in fzcli("simulate", "fig33", code=2).stderr
    assert "did you mean 'bulgarelli4'?" in fzcli("info", "bulgareli4", code=2).stderr


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("controller.gian=3", "error: --set controller.gian=3: controller.gian: unknown key; did you mean 'gain'?"),
        ("controller.gain", "write KEY=VALUE, such as controller.gain=100"),
        ("step=1 kg", "step"),
        ("robot.mass=3", "'robot' is the single value 'bulgarelli4'; nothing lies inside it"),
    ],
)
def test_bad_options_are_told_as_options(fzcli: Invoke, option: str, message: str) -> None:
    assert message in fzcli("simulate", "run.yaml", "--set", option, code=2).stderr


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("controller.gain: [10", "controller.gian: [10", "unknown key; did you mean 'gain'?"),
        ("rows: controller.gain", "rows: controller.gian", "did you mean 'controller.gain'?"),
        ("[tip_error_mean]", "[tip_error_meen]", "the sweep has no such metric; did you mean 'tip_error_mean'?"),
        ("{sphere: 3}", "{spere: 3}", "unknown distribution 'spere'; did you mean 'sphere'?"),
        ("count: 4", "count: 0", "trajectories.count: must be >= 1, got 0"),
        (
            "  seed: 1",
            "  seed: 1\n  keep_if: {with: {controller.gain: 10}, that: [tip_eror_max < 1]}",
            "no metric 'tip_eror_max'",
        ),
    ],
)
def test_bad_sweeps(fzcli: Invoke, tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in SWEEP
    (tmp_path / "sweep.yaml").write_text(SWEEP.replace(old, new))
    result = fzcli("sweep", "sweep.yaml", code=2)
    assert message in result.stderr


def test_wrong_kind_of_command(fzcli: Invoke) -> None:
    assert "kind: simulate is wanted, got 'sweep'" in fzcli("simulate", "sweep.yaml", code=2).stderr
    assert "kind: sweep is wanted, got 'simulate'" in fzcli("sweep", "run.yaml", code=2).stderr


def test_result_files_that_are_none(fzcli: Invoke, tmp_path: Path, made: Path) -> None:
    (tmp_path / "text.h5").write_text("kind: sweep")
    for command in (
        ("table", "text.h5"),
        ("get", "text.h5", "q"),
        ("get", "text.h5"),
        ("plot", "text.h5"),
        ("info", "text.h5"),
    ):
        assert "text.h5: not an HDF5 file" in fzcli(*command, code=2).stderr
    assert "none.h5: no such file" in fzcli("table", "none.h5", code=2).stderr
    assert "run.h5: holds a rollout, not a sweep" in fzcli("table", made / "run.h5", code=2).stderr
    assert "has no 'gaim'; did you mean 'gain'?" in fzcli("get", made / "run.h5", "gaim", code=2).stderr
    assert (
        "plot: 'table': of a rollout there are run, comparison"
        in fzcli("plot", made / "run.h5", "--what", "table", code=2).stderr
    )
    assert "--what run: a rule base has one figure" in fzcli("plot", "bulgarelli2011", "--what", "run", code=2).stderr


def test_usage_errors_are_those_of_the_option(fzcli: Invoke) -> None:
    assert "No such command" in fzcli("simulatte", code=2).stderr
    assert "--format" in fzcli("simulate", "run.yaml", "--format", "xml", code=2).stderr
    assert "--jobs" in fzcli("sweep", "sweep.yaml", "--jobs", "0", code=2).stderr


def test_an_unexpected_error_is_one_line_and_a_way_to_the_traceback(
    fzcli: Invoke, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("of all things\nand more")

    monkeypatch.setattr("fzcli.loop.run_file.load_run", broken)
    result = fzcli("simulate", "run.yaml", code=1)
    expected = "error: unexpected ZeroDivisionError: of all things (FZCLI_DEBUG=1 shows the traceback)\n"
    assert result.stderr == expected
    monkeypatch.setenv("FZCLI_DEBUG", "1")
    assert isinstance(fzcli("simulate", "run.yaml", code=1).exception, ZeroDivisionError)


def test_an_interrupt_ends_with_130(fzcli: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("fzcli.loop.run_file.load_run", interrupted)
    assert fzcli("simulate", "run.yaml", code=130).stderr == "fzcli: interrupted\n"
