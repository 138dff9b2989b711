"""Actions of several numbers, of which some count only with some values of the first.

A command with a point on a screen is one: `(command, x, y)`, where x and y count for commands that
need a point. **C** values of the first number, **P** numbers of an action.
"""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np


class CompoundSpace(gymnasium.spaces.MultiDiscrete):
    """The actions (P,), each number below its size; `uses` says which of them count when."""

    def __init__(self, sizes: Sequence[int], uses: Sequence[Sequence[bool]]) -> None:
        """Make the space; `sizes` are (P,), and `uses`, (C, P − 1), says which numbers count.

        Raises:
            ValueError: `uses` has no row for each value of the first number, or no column for each
                further one.
        """
        super().__init__(np.array(sizes, np.int64))
        self.uses = tuple(tuple(map(bool, row)) for row in uses)
        widths = [len(row) for row in self.uses]
        if widths != [len(sizes) - 1] * sizes[0]:
            raise ValueError(
                f"expected uses of {sizes[0]} × {len(sizes) - 1}, found rows of {widths}"
            )

    def __eq__(self, other: Any) -> bool:
        return super().__eq__(other) and self.uses == getattr(other, "uses", None)

    __hash__ = None  # type: ignore[assignment]
