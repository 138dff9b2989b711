"""TrainingMetrics.json, which grows by an entry per episode and is JSON after every append."""

import json
from collections.abc import Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from repaint_cli.errors import CheckpointError
from repaint_cli.files.atomic import write_errors, write_from, write_text

HEAD = '{"version": 2.0, "best_model_metric": "progress", "metrics": [\n'
TAIL = "\n]}\n"
"""Between them stands an entry a line."""


class TrainingMetrics:
    """The file, and how many entries it has."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.count = 0
        """Entries on disk; a file that was there before counts once `cut` has read it."""

    def append(self, entries: Sequence[Mapping[str, Any]]) -> None:
        """Add entries, one per episode; the first make the file, in place of any earlier one.

        Raises:
            StoreError: the file cannot be written.
        """
        text = ",\n".join(map(json.dumps, entries)) + TAIL
        if self.count:
            with write_errors(self._path):
                end = self._path.stat().st_size - len(TAIL)
            write_from(self._path, end, ",\n" + text)
        else:
            write_text(self._path, HEAD + text)
        self.count += len(entries)

    def cut(self, n: int) -> None:
        """Leave the first n entries, after which others may stand, the last of them half written.

        Raises:
            CheckpointError: the file is damaged or has fewer entries.
            StoreError: the file cannot be written.
        """
        self.count = n
        if n:  # else the next entries make the file anew
            write_from(self._path, self._end(n), TAIL)

    def _end(self, n: int) -> int:
        """Return after how many bytes the nth entry ends.

        Raises:
            CheckpointError: the file is damaged or has fewer entries.
        """
        size, entries, end = len(HEAD), 0, 0
        try:
            with self._path.open("rb") as file:
                if file.readline() != HEAD.encode():
                    raise ValueError("expected its first line to be of ours")
                for line in islice(file, n):
                    entry = line.rstrip(b",\n")
                    json.loads(entry)
                    size, entries, end = size + len(line), entries + 1, size + len(entry)
        except (OSError, ValueError) as error:
            raise CheckpointError(f"{self._path} is damaged: {error}") from error
        if entries < n:
            raise CheckpointError(
                f"{self._path} is damaged: expected {n} episodes, found {entries}"
            )
        return end
