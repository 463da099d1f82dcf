"""Generators seeded together are those that NumPy seeds one by one."""

import numpy as np
import pytest

from fzcli.sweep.draws import generator
from fzcli.sweep.seeds import generators

WORD = 2**32


@pytest.mark.parametrize("seed", [0, 1, 2011, WORD - 1, WORD, 2**64 + 7, 2**100 + 3, 2**200 + 5])
@pytest.mark.parametrize("stream", [(), (1,), (0, WORD + 1)])
def test_they_are_numpy_s_own(seed: int, stream: tuple[int, ...]) -> None:
    somewhere = int(np.random.default_rng(1).integers(WORD - 100))
    for indices in (range(3), range(somewhere, somewhere + 20), range(WORD - 2, WORD), range(WORD - 1, WORD + 2)):
        for one, index in zip(generators(seed, indices, *stream), indices, strict=True):
            assert one.bit_generator.state == generator(seed, index, *stream).bit_generator.state


def test_of_no_trajectory_there_is_none() -> None:
    assert generators(3, range(5, 5)) == []
