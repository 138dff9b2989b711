"""Teachers that are chosen by what they earn in the task, untrained: `auto`, and NAME:auto."""

from collections.abc import Sequence
from typing import NamedTuple

from repaint_cli.errors import NotFound, UsageError
from repaint_cli.report.statistics import mean_ci
from repaint_cli.runs.record_parts import RankedRecord
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo.ranking import N_EPISODES, Ranking, rank
from repaint_cli.zoo.view_names import AUTO, find, split, with_view

EACH_VIEW = 5
"""Episodes of each view, where only the view of a teacher is open."""


class Chosen(NamedTuple):
    """Teachers as they are typed, and among whom they were chosen."""

    teachers: list[str]
    ranked: tuple[RankedRecord, ...] = ()


def chosen(card: TaskCard, teachers: Sequence[str], seed: int) -> Chosen:
    """Return teachers with the best in place of `auto`, and the best view in place of NAME:auto.

    Args:
        card: the task that they play, where something is open.
        teachers: as they are typed.
        seed: of the episodes.

    Raises:
        UsageError: `auto` is not alone.
        NotFound: there is no such teacher, none fits, or none earns more than an untrained policy.
    """
    if list(teachers) == [AUTO]:
        ranking = rank(card, seed, N_EPISODES)
        if ranking.best is None:
            raise NotFound(_nobody(ranking))
        return Chosen([ranking.best.name], _records(ranking))
    if AUTO in teachers:
        others = ", ".join(name for name in teachers if name != AUTO) or AUTO
        raise UsageError(f"--teacher auto stands alone, found {others} beside it")
    bases = {name: split(name)[0] for name in teachers if split(name)[1] == AUTO}
    if not bases:
        return Chosen(list(teachers))
    files = {name: find(base).path for name, base in bases.items()}
    ranking = rank(card, seed, EACH_VIEW, among=list(files.values()))
    order = [one.file for one in reversed(ranking.teachers) if one.file]
    best = {file.path: file.view for file in order}  # of each the best comes last, and stays
    names = [
        with_view(bases[name], best[files[name]]) if name in files else name for name in teachers
    ]
    return Chosen(names, _records(ranking))


def _nobody(ranking: Ranking) -> str:
    return (
        f"--teacher auto: nobody earns more on '{ranking.task.name}' than chance (the best, "
        f"{ranking.teachers[0].name}: {ranking.comparison}); try --method scratch"
    )


def _records(ranking: Ranking) -> tuple[RankedRecord, ...]:
    """Return what run.json keeps of a ranking, untrained policies last."""
    return tuple(
        RankedRecord(
            name=one.name, better=one.better, cosine=one.cosine, steps=int(one.lengths.sum()),
            **dict(zip(("mean", "low", "high"), mean_ci(one.returns), strict=True)),
        )
        for one in (*ranking.teachers, ranking.untrained)
    )  # fmt: skip
