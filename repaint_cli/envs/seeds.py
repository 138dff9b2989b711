"""The seeds of environments that step together, as `VectorEnv.reset` is given them."""

from collections.abc import Sequence

import numpy as np


def seeds_of(seed: int | Sequence[int | None] | None, n: int) -> Sequence[int | None]:
    """Return a seed for each of N environments: s stands for s, s + 1, …; None is no new seed.

    Raises:
        ValueError: there are not N seeds.
    """
    if seed is None:
        return [None] * n
    if isinstance(seed, (int, np.integer)):
        return [int(seed) + i for i in range(n)]
    if len(seed) != n:
        raise ValueError(f"expected {n} seeds, found {len(seed)}")
    return seed
