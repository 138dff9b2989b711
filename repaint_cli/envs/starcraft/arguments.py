"""Checks of what callers give the games: actions."""

from typing import Any

import numpy as np
from numpy.typing import NDArray


def checked_actions(actions: Any, n: int, sizes: NDArray[np.int64]) -> NDArray[np.int16]:
    """Return actions as an array (N, 3).

    Args:
        actions: command, column and row of each.
        n: N.
        sizes: how many values each of the numbers has, (3,).

    Raises:
        ValueError: the actions are not N × 3 integers, or one is not below its size.
    """
    actions = np.asarray(actions)
    if actions.shape != (n, len(sizes)) or actions.dtype.kind not in "iu":
        raise ValueError(
            f"expected integer actions ({n}, {len(sizes)}), found {actions.shape} of "
            f"{actions.dtype}"
        )
    outside = np.flatnonzero(((actions < 0) | (actions >= sizes)).any(1))
    if len(outside):
        command, column, row = actions[outside[0]].tolist()
        n_commands, width, height = sizes.tolist()
        raise ValueError(
            f"expected a command from 0 to {n_commands - 1}, a column from 0 to {width - 1} and a "
            f"row from 0 to {height - 1}, found {command}, {column} and {row}"
        )
    chosen: NDArray[np.int16] = actions.astype(np.int16)
    return chosen
