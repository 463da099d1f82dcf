"""Generators of many trajectories at once: seeded one by one by NumPy, they take a tenth of the time of a short run."""

from typing import Any

import numpy as np
from numpy.random.bit_generator import ISeedSequence
from numpy.typing import NDArray

Words = NDArray[np.uint32]
POOL = 4  # words
FIRST = (0x43B0D7E5, 0x931E8875)  # the hash of what comes in: first constant, and its factor from use to use
LAST = (0x8B51F9DD, 0x58F38DED)  # of what goes out
LEFT, RIGHT = np.uint32(0xCA01F9DD), np.uint32(0x4973F715)
WORD = 0xFFFFFFFF
HALF = np.uint32(16)  # bits


def generators(seed: int, indices: range, *stream: int) -> list[np.random.Generator]:
    """Each the one of SeedSequence((seed, index, *stream)), bit for bit."""
    if indices and indices[-1] > WORD:
        return [_generator(np.random.SeedSequence((seed, index, *stream))) for index in indices]
    count = len(indices)
    parts = [[_repeated(word, count) for word in _words(number)] for number in (seed, *stream)]
    own = np.arange(indices.start, indices.stop, dtype=np.uint32)
    return [_generator(_Seeded(state)) for state in _states([*parts[0], own, *(w for part in parts[1:] for w in part)])]


class _Seeded(ISeedSequence):
    """A seed sequence whose numbers are known."""

    def __init__(self, state: NDArray[np.uint64]) -> None:
        self._state = state

    def generate_state(self, n_words: int, dtype: Any = np.uint32) -> NDArray[np.uint64]:
        """The four numbers that a PCG64 asks for."""
        return self._state


def _generator(seeds: Any) -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(seeds))


def _words(number: int) -> list[int]:
    """Of 32 bits, the lowest first; at least one."""
    return [number & WORD, *(_words(number >> 32) if number > WORD else [])]


def _repeated(word: int, count: int) -> Words:
    return np.full(count, word, dtype=np.uint32)


class _Hash:
    """The hash of O'Neill's seed sequence: its constant changes with every use."""

    def __init__(self, first: int, factor: int) -> None:
        self._constant, self._factor = first, factor

    def of(self, words: Words) -> Words:
        mixed = words ^ np.uint32(self._constant)
        self._constant = self._constant * self._factor & WORD
        mixed = mixed * np.uint32(self._constant)
        return np.asarray(mixed ^ (mixed >> HALF))


def _states(entropy: list[Words]) -> NDArray[np.uint64]:
    """What `numpy.random.SeedSequence` gives for a PCG64, (n, 4); ``entropy``: words of all n, one array after another.

    Source: M. E. O'Neill, "Developing a seed_seq alternative", 2015, as NumPy has it and keeps it.
    """
    none = np.zeros_like(entropy[0])
    coming = _Hash(*FIRST)
    pool = [coming.of(words) for words in [*entropy, *[none] * POOL][:POOL]]
    for source in range(POOL):
        for place in range(POOL):
            if source != place:
                pool[place] = _mixed(pool[place], coming.of(pool[source]))
    for words in entropy[POOL:]:
        for place in range(POOL):
            pool[place] = _mixed(pool[place], coming.of(words))
    going = _Hash(*LAST)
    found = [going.of(pool[i % POOL]).astype(np.uint64) for i in range(8)]
    return np.stack([found[i] | found[i + 1] << np.uint64(32) for i in range(0, 8, 2)], axis=1)


def _mixed(a: Words, b: Words) -> Words:
    mixed = LEFT * a - RIGHT * b
    return np.asarray(mixed ^ (mixed >> HALF))
