"""Random numbers that are counted, not drawn in turn: the same for one environment and for many at once.

A number belongs to (key, episode, step, stream, index). So no state is kept, the order of asking does not matter, and
an environment among 4096 has the bits of one alone. Hashed with the finaliser of SplitMix64 (Steele, Lea and Flood
2014; as Salmon et al. 2011 argue for counters), one round per part.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from armtempo.robots import njit

# What a number is for.
MASTER_LATE, FAMILY, LATE, SPEED, STOPS, BEGIN, LENGTH, PHASE, NOISE = range(9)


@njit
def _mixed(z: np.uint64, part: int) -> np.uint64:
    """One round: a 64-bit integer from two, every bit of it depending on every bit of them."""
    z = z + np.uint64(0x9E3779B97F4A7C15) * (np.uint64(part) + np.uint64(1))
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@njit
def uniform(key: int, episode: int, step: int, stream: int, index: int) -> float:
    """A number in [0, 1); the parts are not negative, ``key`` has 64 bits."""
    z = _mixed(_mixed(_mixed(_mixed(np.uint64(key), episode), step), stream), index)
    return float(np.float64(z >> np.uint64(11)) * 2.0**-53)


@njit
def normal(key: int, episode: int, step: int, stream: int, index: int) -> float:
    """A number from the standard normal distribution (Box and Muller), of the indices 2 ``index`` and the next."""
    near = 1.0 - uniform(key, episode, step, stream, 2 * index)
    angle = 2.0 * np.pi * uniform(key, episode, step, stream, 2 * index + 1)
    return float(np.sqrt(-2.0 * np.log(near)) * np.cos(angle))


def key_from(generator: Generator) -> int:
    """A key of an environment, from its seeded generator."""
    return int(generator.integers(0, 2**64, dtype=np.uint64))
