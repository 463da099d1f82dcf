"""Tests compile into a cache of their own, which goes with the session."""

import os
from collections.abc import Iterator

import pytest

from fzcli.loop.compiler import find_compiler


@pytest.fixture(scope="session", autouse=True)
def cache_of_the_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """FZCLI_CACHE_DIR points into pytest's temporary folder, for this process and its children."""
    before = os.environ.get("FZCLI_CACHE_DIR")
    os.environ["FZCLI_CACHE_DIR"] = str(tmp_path_factory.mktemp("fzcli-cache"))
    yield
    if before is None:
        del os.environ["FZCLI_CACHE_DIR"]
    else:
        os.environ["FZCLI_CACHE_DIR"] = before


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Runs go through CasADi's machine: for a single short run, quicker than to compile it."""
    monkeypatch.setenv("FZCLI_CC", "none")
    find_compiler.cache_clear()
    yield
    monkeypatch.undo()
    find_compiler.cache_clear()
