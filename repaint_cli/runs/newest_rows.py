"""The end of metrics.csv: how far a run is, read in a moment however long the file has become."""

import os
from dataclasses import dataclass
from math import isfinite
from pathlib import Path

ITERATIONS = 6
"""How many of the last are read."""
ROW_BYTES = 600
"""That a row takes at most."""


@dataclass(frozen=True)
class NewestRows:
    """The last iterations of a run."""

    iteration: int = 0
    """The last one that all seeds have; 0 before the first."""
    mean_return: float | None = None
    """Its evaluated return, the mean over seeds."""
    seconds: float = 0.0
    """How long the run had taken by then, s."""
    pace: float | None = None
    """How long the last iterations took, the mean of up to five, s."""

    @classmethod
    def read(cls, path: Path, n_seeds: int) -> "NewestRows":
        """Read a metrics.csv; one that is absent or damaged tells nothing."""
        try:
            head, rows = _ends(path, ITERATIONS * n_seeds * ROW_BYTES)
            columns = [head.index(name) for name in ("iteration", "eval_return", "seconds")]
            cells = [[float(row[c]) for c in columns] for row in rows if len(row) == len(head)]
        except (OSError, ValueError):
            return cls()
        by_iteration = dict[int, list[list[float]]]()
        for k, *numbers in cells:
            by_iteration.setdefault(int(k), []).append(numbers)
        whole = {k: own for k, own in by_iteration.items() if len(own) == n_seeds}
        return cls._of(dict(list(sorted(whole.items()))[-ITERATIONS:]))

    @classmethod
    def _of(cls, whole: dict[int, list[list[float]]]) -> "NewestRows":
        """Return what iterations with a row (return, seconds) of each seed tell."""
        if not whole:
            return cls()
        last = max(whole)
        returns = [earned for earned, _ in whole[last]]
        times = [own[0][1] for own in whole.values()]
        n = len(times) - 1
        mean = sum(returns) / len(returns)
        return cls(
            last, mean if isfinite(mean) else None, times[-1],
            (times[-1] - times[0]) / n if n else None,
        )  # fmt: skip


def _ends(path: Path, most: int) -> tuple[list[str], list[list[str]]]:
    """Return a table's head, and the whole rows among its last bytes."""
    with path.open("rb") as file:
        head = file.readline(ROW_BYTES * 4)
        size = file.seek(0, os.SEEK_END)
        start = max(len(head), size - most)
        file.seek(start)
        text = file.read(most).decode("ascii", errors="replace")
    lines = text.split("\n")[:-1]  # what follows the last line's end is half a row
    if start > len(head):
        lines = lines[1:]
    return head.decode("ascii", errors="replace").strip().split(","), [
        line.split(",") for line in lines
    ]
