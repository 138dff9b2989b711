"""Logged episodes and what another reward pays for them, for people and as JSON."""

import json
from collections.abc import Sequence
from math import ceil

import numpy as np

from repaint_cli.cli.console import columns, plain
from repaint_cli.envs.logs import Replay, ReplayedEpisode
from repaint_cli.report.replay import correlation, correlation_text

MOST_ROWS = 40
"""Of a table; more episodes are summed up in so many rows."""
LONGEST = 20
"""Letters of a log's name in a table."""
SAME = 5e-4
"""Of a reward, or of 1: texts have four digits, also of what a reward is computed from."""

Row = Sequence[str]


def print_json(replay: Replay) -> None:
    """Print every episode, the correlations and the notes."""
    record = {
        "episodes": [one._asdict() for one in replay.episodes],
        "steps": len(replay.logged),
        "steps_paid_as_logged": _n_same(replay),
        "correlation_over_episodes": correlation(*replay.returns),
        "correlation_over_steps": correlation(replay.logged, replay.new),
        "notes": replay.notes,
    }
    print(json.dumps(record, indent=2))


def print_replay(payer: str, replay: Replay) -> None:
    """Print a row an episode, or a group of many, and how the two rewards relate.

    Args:
        payer: what pays now.
        replay: what came of it.
    """
    few = len(replay.episodes) <= MOST_ROWS
    print(_table(_rows(replay.episodes) if few else _groups(replay.episodes)))
    first, second = replay.returns
    n, n_steps = len(first), len(replay.logged)
    old, new = replay.logged, replay.new
    over_steps = correlation_text(old, new)
    print(
        f"\n{plain(payer)} over {n:,} episode{'s' * (n != 1)} of {n_steps:,} steps:\n"
        f"  reward an episode  {first.mean():.4g} logged, {second.mean():.4g} new\n"
        f"  reward a step      {old.min():.4g} to {old.max():.4g} logged, "
        f"{new.min():.4g} to {new.max():.4g} new\n"
        f"  correlation        {correlation_text(first, second)} over episodes, {over_steps} over "
        f"steps\n  paid as logged     {_n_same(replay):,} of {n_steps:,} steps"
    )
    for note in replay.notes:
        print(f"note: {plain(note)}")


def _n_same(replay: Replay) -> int:
    """Return how many steps are paid as they were, to the digits of a log."""
    gaps = np.abs(replay.new - replay.logged)
    return int((gaps <= SAME * np.maximum(1, np.abs(replay.logged))).sum())


def _rows(episodes: Sequence[ReplayedEpisode]) -> list[Row]:
    """Return a table's head and a row an episode; logs are named where there are several."""
    rows: list[Row] = [("log", "ended", "episode", "steps", "progress", "logged", "new")]
    rows += [
        (
            _short(one.log), one.ended, str(one.number), str(one.steps), f"{one.progress:.1f} %",
            f"{one.logged:.4g}", f"{one.new:.4g}",
        )
        for one in episodes
    ]  # fmt: skip
    return rows if len({one.log for one in episodes}) > 1 else [row[1:] for row in rows]


def _groups(episodes: Sequence[ReplayedEpisode]) -> list[Row]:
    """Return a table's head and a row for each group of neighbours, with their means."""
    rows: list[Row] = [("from", "to", "episodes", "laps", "progress", "logged", "new")]
    size = ceil(len(episodes) / MOST_ROWS)
    for first in range(0, len(episodes), size):
        group = episodes[first : first + size]
        progress, logged, new = (
            np.mean([getattr(one, name) for one in group]) for name in ("progress", "logged", "new")
        )
        ends = (f"{_short(one.log)}: {one.number}" for one in (group[0], group[-1]))
        laps = str(sum(one.whole for one in group))
        rows.append((
            *ends, str(len(group)), laps, f"{progress:.1f} %", f"{logged:.4g}", f"{new:.4g}",
        ))  # fmt: skip
    return rows


def _table(rows: Sequence[Row]) -> str:
    """Return a table whose numbers stand at the right of their columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    aligned = [
        [
            cell.ljust(width) if name in ("log", "ended", "from", "to") else cell.rjust(width)
            for name, cell, width in zip(rows[0], row, widths, strict=True)
        ]
        for row in rows
    ]
    return columns(aligned[0], aligned[1:])


def _short(name: str) -> str:
    return name if len(name) <= LONGEST else f"…{name[1 - LONGEST :]}"
