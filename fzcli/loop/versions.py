"""Versions of everything that numbers depend on."""

import platform
import sys
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version


@cache
def versions() -> Mapping[str, str]:
    """Versions of everything that the numbers depend on."""
    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in ("fzcli", "casadi", "numpy"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "source tree"
    return found
