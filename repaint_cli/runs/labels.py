"""Labels that tell runs apart by what differs: method and teachers, settings, seeds, folder."""

from collections.abc import Mapping, Sequence
from typing import Any

from repaint_cli.runs.reader import RecordedRun
from repaint_cli.tasks.card_settings import differing, setting_text, settings_of

MOST = 3
"""Settings that a label names, unless more are needed to tell runs apart."""

LONGEST = 24
"""Letters of a setting's value in a label."""

SAME = ("env", "reward", "reward_code")
"""Sections that are the same in all runs of one task."""


def labels_of(runs: Sequence[RecordedRun]) -> list[str]:
    """Return a label for each run, no two alike: its method and teachers, and what differs.

    Runs with the same method and teachers are told apart by settings and seeds; those with the
    same of these, too, by the ends of their folders' paths.
    """
    labels = [run.label for run in runs]
    for label in {label for label in labels if labels.count(label) > 1}:
        alike = [i for i, other in enumerate(labels) if other == label]
        for i, words in zip(alike, _differing([runs[i] for i in alike]), strict=True):
            labels[i] += f" ({', '.join(words)})"
    return labels


def _differing(runs: Sequence[RecordedRun]) -> list[list[str]]:
    """Return, run by run, texts about what differs between them; no two runs have the same."""
    each = [settings_of(run.task, SAME) for run in runs]
    texts = [
        [f"{_short_name(name, each)} {setting_text(own, name, LONGEST)}" for own in each]
        for name in differing(*each)
    ]
    columns = sorted(
        (column for column in ([_seeds(run) for run in runs], *texts) if len(set(column)) > 1),
        key=lambda column: -len(set(column)),
    )
    folders = _ends([str(run.folder).rstrip("/").split("/") for run in runs])
    words: list[list[str]] = [[] for _ in runs]
    for n, column in enumerate([*columns, folders]):
        alone = len({tuple(own) for own in words}) == len(runs)
        if alone and (n >= MOST or column is folders):
            break
        for own, text in zip(words, column, strict=True):
            own.append(text)
    return words


def _seeds(run: RecordedRun) -> str:
    first, last = run.seeds[0], run.seeds[-1]
    if len(run.seeds) == 1:
        return f"seed {first}"
    in_a_row = run.seeds == list(range(first, last + 1))
    return f"seeds {first}-{last}" if in_a_row else f"seeds {' '.join(map(str, run.seeds))}"


def _short_name(name: str, each: Sequence[Mapping[str, Any]]) -> str:
    """Return a setting's key, with its section where another section has the same."""
    key = name.rpartition(".")[2]
    same = {other for settings in each for other in settings if other.rpartition(".")[2] == key}
    return key if len(same) == 1 else name


def _ends(paths: Sequence[Sequence[str]]) -> list[str]:
    """Return the ends of paths, as short as they may be and differ."""
    for n in range(1, max(map(len, paths)) + 1):
        ends = ["/".join(parts[-n:]) for parts in paths]
        if len(set(ends)) == len(paths):
            return ends
    return [f"{'/'.join(parts)} #{n}" for n, parts in enumerate(paths, 1)]
