"""The compiled steps' cache: repaired when damaged, private, complete or absent, and free of foreign names."""

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fzcli.errors import EngineError
from fzcli.loop.assemble import closed_loop, parameter_row
from fzcli.loop.compiler import Compiler, build_library, cache_folder, find_compiler, identify
from fzcli.loop.engine import CompiledEngine, VirtualMachine
from fzcli.loop.events import make_engine
from fzcli.loop.source import c_source
from fzcli.spec.robot import Robot
from tests.loop.cases import run_spec

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler")
SOURCE = '__attribute__((visibility("default"))) int answer(void) { return 42; }\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of the test's own."""
    monkeypatch.setenv("FZCLI_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def _build(source: str = SOURCE) -> ctypes.CDLL:
    compiler = find_compiler()
    assert compiler is not None
    return build_library(source, 1, compiler, "baseline")


def test_a_library_is_built_once(folder: Path) -> None:
    assert _build().answer() == 42
    files = {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}
    assert sorted(Path(name).suffix for name in files) == [".sha256", ".so"], "no scratch files stay"
    assert _build().answer() == 42
    assert {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} == files
    _build(SOURCE + "/* another */\n")
    assert len(list(folder.iterdir())) == 4


@pytest.mark.parametrize("damage", ["truncated", "overwritten", "no checksum", "empty", "gone"])
def test_a_damaged_library_is_built_again(folder: Path, damage: str) -> None:
    """In another process each time: a loaded library must not be overwritten in place."""
    code = (
        "from fzcli.loop.compiler import build_library, find_compiler\n"
        f"print(build_library({SOURCE!r}, 1, find_compiler(), 'baseline').answer())"
    )

    def run() -> str:
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        return done.stdout.strip() or done.stderr

    assert run() == "42"
    library = next(folder.glob("*.so"))
    whole = library.read_bytes()
    if damage == "truncated":
        library.write_bytes(whole[: len(whole) // 2])
    elif damage == "overwritten":
        library.write_bytes(b"x" * len(whole))
    elif damage == "no checksum":
        next(folder.glob("*.sha256")).unlink()
    elif damage == "empty":
        library.write_bytes(b"")
    else:
        library.unlink()
    assert run() == "42"
    assert len(library.read_bytes()) == len(whole)


def test_the_folder_is_private(folder: Path) -> None:
    _build()
    assert folder.stat().st_mode & 0o777 == 0o700
    folder.chmod(0o775)
    with pytest.raises(EngineError, match=r"others may write to the cache; chmod go-w it or set FZCLI_CACHE_DIR$"):
        cache_folder()


@pytest.mark.skipif(os.getuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_somebody_else_is_refused(folder: Path) -> None:
    folder.mkdir()
    os.chown(folder, 12345, 12345)
    with pytest.raises(EngineError, match=r"the cache belongs to another user; set FZCLI_CACHE_DIR"):
        cache_folder()


def test_the_compiler_s_own_words_are_passed_on(folder: Path) -> None:
    with pytest.raises(EngineError) as caught:
        _build("this is not C\n")
    text = str(caught.value)
    assert "step.c failed:" in text
    assert "error" in text
    assert not list(folder.iterdir()), "a failure leaves nothing behind"


def test_a_compiler_that_fails_is_an_error_with_its_words(folder: Path, tmp_path: Path) -> None:
    script = tmp_path / "brokencc"
    script.write_text(
        '#!/bin/sh\n[ "$1" = --version ] && { echo broken 1.0; exit 0; }\necho out of cheese >&2\nexit 3\n'
    )
    script.chmod(0o755)
    compiler = identify((str(script),))
    assert compiler == Compiler((str(script),), "broken 1.0")
    with pytest.raises(EngineError, match="out of cheese"):
        build_library(SOURCE, 1, compiler, "baseline")
    assert not list(folder.iterdir())


def test_the_environment_names_the_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    try:
        find_compiler.cache_clear()
        monkeypatch.setenv("FZCLI_CC", "no-such-compiler-here")
        with pytest.raises(EngineError, match=r"^FZCLI_CC=no-such-compiler-here: this compiler does not run$"):
            find_compiler()
        monkeypatch.setenv("FZCLI_CC", "none")
        find_compiler.cache_clear()
        assert find_compiler() is None
        loop = closed_loop(run_spec(), record=False)
        assert isinstance(make_engine(loop), VirtualMachine)
        with pytest.raises(EngineError, match=r"^no C compiler found \(set FZCLI_CC to name one\)$"):
            CompiledEngine(loop)
    finally:
        monkeypatch.undo()
        find_compiler.cache_clear()


def test_two_processes_may_compile_at_once(folder: Path) -> None:
    code = (
        "from fzcli.loop.assemble import closed_loop, parameter_row, step_counts\n"
        "from fzcli.loop.engine import CompiledEngine\n"
        "from tests.loop.cases import run_spec\n"
        "spec = run_spec(duration=0.2)\n"
        "loop = closed_loop(spec, record=False)\n"
        "row = parameter_row(spec, loop.parameters)[None, :]\n"
        "engine = CompiledEngine(loop, lanes=1, isa='baseline')\n"
        "print(engine.run(row, step_counts(loop, spec, row)).metrics.tobytes().hex())"
    )
    running = [subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = [process.communicate(timeout=120)[0] for process in running]
    assert [process.returncode for process in running] == [0, 0]
    assert said[0] == said[1] != ""
    assert sorted(path.suffix for path in folder.iterdir()) == [".sha256", ".so"]


NASTY = 'x"; system("touch /tmp/owned"); /* \\ ${HOME} % {0} */ # \n#include <x> é'


def _renamed(robot: Robot) -> Robot:
    """The robot with names that would break C text, comments, strings and shells."""

    def nasty(name: str) -> str:
        return name if name == "base" else f"{NASTY}{name}"

    links = tuple(
        link.model_copy(
            update={
                "name": nasty(link.name),
                "parent": nasty(link.parent),
                "joint": link.joint.model_copy(update={"name": nasty(link.joint.name)}),
            }
        )
        for link in robot.links
    )
    tips = {nasty(name): tip.model_copy(update={"link": nasty(tip.link)}) for name, tip in robot.tips.items()}
    return robot.model_copy(update={"name": NASTY, "links": links, "tips": tips})


def test_names_from_a_file_never_reach_c() -> None:
    spec = run_spec(controller__kind="fuzzy_clik")
    odd = spec.model_copy(update={"robot": _renamed(spec.robot), "about": NASTY})
    plain, strange = (c_source(closed_loop(one, record=True)) for one in (spec, odd))
    assert plain == strange
    assert strange.isascii()
    for word in ("owned", "link7", "q1", "hand", "oscillating", "bulgarelli"):
        assert word not in strange
    loop = closed_loop(odd, record=True)
    row = parameter_row(odd, loop.parameters)[None, :]
    batch = CompiledEngine(loop, lanes=1).run(row, np.array([20]), record=True)
    assert batch.stops[0] == 0
    assert next(s for s in loop.signals if s.name == "q").components[0].startswith(NASTY)
