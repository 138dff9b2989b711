"""How far runs are, as a table of at most 80 columns."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from repaint_cli.cli.console import columns

if TYPE_CHECKING:
    from repaint_cli.runs.status import RunStatus

HEADS = ("state", "iteration", "return", "left", "node", "try", "run")
NODE_WIDTH = 10


def status_table(rows: "Sequence[RunStatus]", root: Path | None) -> str:
    """Return the table; folders are named from `root`."""
    return columns(HEADS, [_cells(row, root) for row in rows], fit=True)


def _cells(row: "RunStatus", root: Path | None) -> tuple[str, ...]:
    from repaint_cli.runs.comparison_words import duration

    name = row.folder if root is None else os.path.relpath(row.folder, root)
    return (
        row.state,
        f"{row.iteration}/{row.iterations}",
        "-" if row.mean_return is None else f"{row.mean_return:.4g}",
        "-" if row.seconds_left is None else duration(row.seconds_left),
        row.node[:NODE_WIDTH] or "-",
        str(row.attempt or "-"),
        row.folder if name == "." else name,
    )
