"""Networks trained once for the tests of this folder."""

import pytest
from learn_cases import ARM, PLANAR, run

from fzcli.learn.network_set import NetworkSet
from fzcli.learn.train import train


@pytest.fixture(scope="session")
def planar() -> NetworkSet:
    """Three small networks of the planar 3-RRR; a fourth branch does not occur."""
    return train(run(PLANAR))


@pytest.fixture(scope="session")
def arm() -> NetworkSet:
    """One small network of the RV-1A in a small range."""
    return train(run(ARM))
