"""Names of files: where they are looked for, and the copy that a new project starts from."""

import shutil
from pathlib import Path

import pytest

from fzcli.errors import SpecError, UsageError
from fzcli.spec import library
from fzcli.spec.library import find, init, shipped_root
from fzcli.spec.load import load_robot, load_rulebase


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for folder in ("robots", "runs", "elsewhere"):
        (tmp_path / folder).mkdir()
    (tmp_path / "robots" / "mine.yaml").write_text("kind: robot\n")
    (tmp_path / "runs" / "job.yaml").write_text("kind: simulate\n")
    monkeypatch.chdir(tmp_path / "elsewhere")
    return tmp_path


def test_the_shipped_files_are_the_last_resort(project: Path) -> None:
    assert find("robots", "planar3") == shipped_root() / "robots" / "planar3.yaml"
    assert (
        find("rulebases", "bulgarelli2011", project / "runs" / "job.yaml").parent
        == shipped_root() / "rulebases"
    )
    shutil.copy(shipped_root() / "robots" / "planar3.yaml", project / "robots")
    assert find("robots", "planar3", project / "runs" / "job.yaml").samefile(
        project / "robots" / "planar3.yaml"
    )


def test_a_run_finds_the_robots_beside_its_folder(project: Path) -> None:
    job, mine = project / "runs" / "job.yaml", project / "robots" / "mine.yaml"
    assert find("robots", "mine", job).samefile(mine)
    assert find("robots", "mine", job.parent).samefile(mine)
    assert find("robots", "../robots/mine.yaml", job).samefile(mine)
    assert find("robots", str(mine)).samefile(mine)


def test_nearer_places_win(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    job = project / "runs" / "job.yaml"
    places = [
        project / "runs" / "mine.yaml",
        project / "runs" / "robots" / "mine.yaml",
        project / "robots" / "mine.yaml",
        project / "elsewhere" / "robots" / "mine.yaml",
    ]
    for place in places:
        place.parent.mkdir(exist_ok=True)
        place.write_text("kind: robot\n")
    for place in places:
        assert find("robots", "mine", job).samefile(place)
        place.unlink()


def test_a_run_named_like_the_robot_is_not_taken_for_it(project: Path) -> None:
    (project / "runs" / "mine.yaml").write_text("kind: simulate\n")
    found = find("robots", "mine", project / "runs" / "job.yaml")
    assert found.samefile(project / "robots" / "mine.yaml")


def test_a_file_does_not_find_itself(project: Path) -> None:
    (project / "runs" / "mine.yaml").write_text("kind: simulate\n")
    found = find("robots", "mine", project / "runs" / "mine.yaml")
    assert found.samefile(project / "robots" / "mine.yaml")


def test_what_is_not_found_names_the_nearest(project: Path) -> None:
    job = project / "runs" / "job.yaml"
    for name, message in (
        ("min", "no robot named 'min'; did you mean 'mine'?"),
        ("bulgareli4", "no robot named 'bulgareli4'; did you mean 'bulgarelli4'?"),
        ("", "no robot named ''; known: "),
        ("../robots/mne.yaml", "no such file '../robots/mne.yaml'; did you mean 'mine.yaml'?"),
        ("nowhere/at/all.yaml", "no such file 'nowhere/at/all.yaml'"),
    ):
        with pytest.raises(SpecError) as caught:
            find("robots", name, job)
        assert str(caught.value).startswith(message)


def test_names_load(project: Path) -> None:
    assert load_robot("planar3").name == "planar3"
    assert load_rulebase("bulgarelli2011", project / "runs").name == "bulgarelli2011"


def test_the_folder_in_a_wheel_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "fzcli" / "spec").mkdir(parents=True)
    monkeypatch.setattr(library, "__file__", str(tmp_path / "fzcli" / "spec" / "library.py"))
    assert shipped_root() == tmp_path
    (tmp_path / "fzcli" / "shipped").mkdir()
    assert shipped_root() == tmp_path / "fzcli" / "shipped"


def test_init_copies_what_is_shipped_and_never_overwrites(tmp_path: Path) -> None:
    target = tmp_path / "project"
    written = init(target, {"run": {"title": "a run"}})
    assert target / "robots" / "bulgarelli4.yaml" in written
    assert target / "rulebases" / "bulgarelli2011.yaml" in written
    assert (target / "schemas" / "run.json").read_text() == '{\n "title": "a run"\n}\n'
    assert (target / "robots" / "planar3.yaml").read_bytes() == (
        shipped_root() / "robots" / "planar3.yaml"
    ).read_bytes()
    for robot in (target / "robots").glob("*.yaml"):
        schema = robot.read_text().split("\n")[0].partition("$schema=")[2]
        assert (robot.parent / schema).is_file()
    (target / "robots" / "planar3.yaml").write_text("mine")
    shutil.rmtree(target / "rulebases")
    with pytest.raises(UsageError, match="exist already; nothing was written, name another directory"):
        init(target)
    assert (target / "robots" / "planar3.yaml").read_text() == "mine"
    assert not (target / "rulebases").exists()


def test_init_into_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot write to"):
        init(tmp_path / "file")
