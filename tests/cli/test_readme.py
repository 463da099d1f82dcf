"""The README's examples do what it says."""

import io
import re
import tomllib
from contextlib import redirect_stdout

import pytest
from cli_cases import ROOT, RUN, Invoke

from fzcli.control import registry
from fzcli.loop.run_spec import simulate_model

TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str, holding: str = "") -> list[str]:
    """The code blocks of a language that hold some text."""
    found = re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)
    return [block for block in found if holding in block]


@pytest.mark.parametrize("text", blocks("yaml"), ids=lambda text: text.split("\n")[0])
def test_the_yaml_examples_are_valid(fzcli: Invoke, text: str) -> None:
    kind = text.split("\n")[0].removeprefix("kind: ")
    assert fzcli("validate", "-", text=text).stdout == f"-: ok ({kind})\n"


def test_the_rule_base_stands_in_for_the_shipped_one(fzcli: Invoke) -> None:
    with open("rules.yaml", "w", encoding="utf-8") as file:
        file.write(blocks("yaml", "kind: rulebase")[0])
    tuned = "controller={kind: fuzzy_clik, gain: 10, rulebase: rules.yaml}"
    assert "gain_final" in fzcli("simulate", "run.yaml", "--set", tuned).stdout


def test_the_python_example_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    with redirect_stdout(io.StringIO()) as printed:
        exec(blocks("python", "import fzcli\n")[0], {})
    assert "Status(name='ok'" in printed.getvalue()


def test_the_ball_chain_example_runs() -> None:
    with redirect_stdout(io.StringIO()) as printed:
        exec(blocks("python", "BallTree")[0], {})
    assert "converged=True" in printed.getvalue()
    assert "out of reach by 1 m" in printed.getvalue()


def test_the_controller_example_joins_and_keeps_its_limit(fzcli: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    space: dict[str, object] = {"__name__": "slowed"}
    exec(blocks("python", "CONTROLLER")[0], space)
    monkeypatch.setattr(registry, "_OWN", (*registry._OWN, space["CONTROLLER"]))
    forget = (registry.controllers.cache_clear, simulate_model.cache_clear)
    for one in forget:
        one()
    try:
        slowed = "controller={kind: slowed, speed: 2 deg/s}"
        fzcli("simulate", "-", "--set", slowed, "--set", "record.precision=f8", text=RUN)
        lines = fzcli("get", "runs/stdin/stdin.h5", "qd").stdout.splitlines()[1:]
    finally:
        for one in forget:
            one()
    fastest = max(abs(float(cell)) for line in lines for cell in line.split(",")[1:])
    assert fastest == pytest.approx(2 * 3.141592653589793 / 180, rel=1e-9)


def test_the_entry_point_example_names_the_group_that_is_read() -> None:
    group = tomllib.loads(blocks("toml")[0])["project"]["entry-points"]
    assert list(group) == [registry.ENTRY_POINTS]


def test_every_command_is_listed(fzcli: Invoke) -> None:
    commands = re.findall(r"^  (\w+) ", fzcli("--help").stdout.split("Commands:")[1], flags=re.MULTILINE)
    for command in commands:
        assert f"| `{command} " in TEXT
