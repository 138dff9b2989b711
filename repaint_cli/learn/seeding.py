"""Where randomness comes from: a run's seed, a purpose and an iteration name every generator.

Neighbouring integer seeds share streams in most simulators (environment 1 of seed 3 is environment
0 of seed 4), so they are never used. And as every iteration has its own generators, a resumed
run draws what the uninterrupted one drew.
"""

from enum import IntEnum

import numpy as np


class Purpose(IntEnum):
    """What a generator is for."""

    INITIALIZE = 0
    TRAIN = 1
    TEACHER = 2
    EVALUATE = 3
    ACT = 4
    ACT_AS_TEACHER = 5
    SHUFFLE = 6
    SELECT = 7
    SCORE = 8


def generator(
    seed: int, purpose: Purpose, iteration: int = 0, stream: int = 0
) -> np.random.Generator:
    """Return the generator of one seed, purpose, iteration and stream, such as a teacher."""
    return np.random.default_rng(_sequence(seed, purpose, iteration, stream))


def env_seeds(
    seeds: list[int], purpose: Purpose, iteration: int, n_envs: int, stream: int = 0
) -> list[int]:
    """Return seeds for S × N environments, seed by seed, each in [0, 2³¹)."""
    return [
        int(word) >> 1
        for seed in seeds
        for word in _sequence(seed, purpose, iteration, stream).generate_state(n_envs)
    ]


def _sequence(*names: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(names)  # in which a last 0 makes no difference
