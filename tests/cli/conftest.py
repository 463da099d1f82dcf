"""Small runs for the commands to chew on, made once."""

from pathlib import Path

import pytest
from cli_cases import RUN, SWEEP, Invoke, shell
from typer.testing import CliRunner, Result

from fzcli.cli.main import app


@pytest.fixture
def fzcli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Invoke:
    """Runs the command line in this process and an empty folder; ``code`` is the expected exit code."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FZCLI_DEBUG", raising=False)
    (tmp_path / "run.yaml").write_text(RUN)
    (tmp_path / "sweep.yaml").write_text(SWEEP)

    def invoke(*words: object, code: int = 0, text: str | None = None) -> Result:
        result = CliRunner().invoke(app, [str(word) for word in words], input=text)
        assert result.exit_code == code, result.output
        return result

    return invoke


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, cache_of_the_tests: None) -> Path:
    """A folder with run.h5 and sweep.h5."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "run.yaml").write_text(RUN)
    (folder / "sweep.yaml").write_text(SWEEP)
    shell("simulate", folder / "run.yaml", "-o", folder, cwd=folder)
    shell("sweep", folder / "sweep.yaml", "-o", folder, cwd=folder)
    return folder
