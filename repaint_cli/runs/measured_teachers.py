"""What is chosen by what teachers earn in the task, untrained: who, which view, how to start."""

from collections.abc import Sequence
from typing import NamedTuple

from repaint_cli.errors import NotFound, locate_divergence
from repaint_cli.learn.transfer.courses import affordable
from repaint_cli.report.statistics import mean_ci
from repaint_cli.runs.plan import check_automatic
from repaint_cli.runs.record_parts import RankedRecord
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.presets import ENDLESS
from repaint_cli.zoo.ranking import N_EPISODES, Ranking, ahead, rank, views_of
from repaint_cli.zoo.view_names import AUTO, TeacherFile

EACH_VIEW = 5
"""Episodes of each view, at most, where only the view of a teacher is open."""

FEW_STEPS = 750
"""`ppo.max_steps` of students who are taught, where rollouts count episodes."""


class Choice(NamedTuple):
    """What was chosen, and among whom."""

    files: tuple[TeacherFile, ...]
    """The teachers, as they are looked at."""
    ranked: tuple[RankedRecord, ...] = ()
    leads: bool = False
    """Whether one of them earns more than untrained policies."""
    starts: bool = False
    """Whether the first does, and students may start from its weights."""

    def settled(self, card: TaskCard) -> TaskCard:
        """Return a card that says what students start from, if that was open.

        Who starts as its only teacher has nothing to learn from it, and nobody has from teachers
        who lead nobody: PPO alone goes on. Students who are taught learn from rollouts of fewer
        episodes, as their episodes are long.
        """
        transfer, ppo = card.transfer, card.ppo
        if transfer.start != "auto":
            return card
        change: dict[str, object] = {"start": "teacher" if self.starts else "untrained"}
        alone = not self.leads or (self.starts and len(self.files) == 1)
        if alone and transfer.iterations == ENDLESS:
            change["iterations"] = 0
        if self.leads and ppo.n_episodes and ppo.max_steps is None:
            ppo = ppo.model_copy(update={"max_steps": FEW_STEPS})
        return card.model_copy(update={"transfer": transfer.model_copy(update=change), "ppo": ppo})


def best_of_zoo(card: TaskCard, seed: int) -> Choice:
    """Return the teacher of the zoo who earns most in a task, in the view that earns most.

    Raises:
        NotFound: none fits, or none earns more than an untrained policy.
        DivergedError: an observation or a reward is not finite.
    """
    check_automatic(card)
    with locate_divergence([seed], "playing before the first iteration"):
        ranking = rank(card, seed, N_EPISODES)
    if ranking.best is None or ranking.best.file is None:
        raise NotFound(_nobody(ranking))
    path = ranking.best.file.path
    views = [one.file for one in ranking.teachers if one.file and one.file.path == path]
    return _choice(ranking, [_best(ranking, views, weights=card.transfer.start != "untrained")])


def chosen(card: TaskCard, files: Sequence[TeacherFile], seed: int) -> Choice:
    """Return teachers in their best views; they play where something of them is open.

    Args:
        card: the task that they play, as it is carried out.
        files: the teachers; with the view `AUTO`, every view that may differ plays.
        seed: of the episodes.

    Raises:
        NotFound: a teacher has no such view.
        TeacherMismatch: a teacher does not fit.
        CardError: the task cannot be rolled out as its card says.
        DivergedError: an observation or a reward is not finite.
    """
    open_to = {file: views_of(file, card) for file in files if card.automatic or file.view == AUTO}
    if not open_to:
        return Choice(tuple(files))
    card.check_rollout()
    check_automatic(card)
    playing = list(dict.fromkeys(view for views in open_to.values() for view in views))
    taught = Choice(tuple(files), leads=True).settled(card)  # whose run has fewer steps
    with locate_divergence([seed], "playing before the first iteration"):
        ranking = rank(
            card, seed, EACH_VIEW, among=playing,
            affordable=lambda episode: affordable(taught, episode),
        )  # fmt: skip
    weights = card.transfer.start != "untrained"
    best = {file: _best(ranking, views, weights=weights) for file, views in open_to.items()}
    return _choice(ranking, [best.get(file, file) for file in files])


def _best(ranking: Ranking, views: Sequence[TeacherFile], *, weights: bool) -> TeacherFile:
    """Return the view that earns most.

    Where students may start from its weights, one that has such weights is taken instead unless it
    is behind by more than both standard errors.
    """
    played = [one for one in ranking.teachers if one.file in views]
    best = played[0]
    for one in played if weights else ():
        if one.same_networks and not ahead(best, one):
            best = one
            break
    assert best.file is not None
    return best.file


def _choice(ranking: Ranking, files: Sequence[TeacherFile]) -> Choice:
    """Return teachers as those that were chosen; some of them may not have played."""
    played = {one.file: one for one in ranking.teachers}
    taken = [played.get(file) for file in files]
    leads = [one is not None and ahead(one, ranking.untrained) for one in taken]
    first = taken[0]
    starts = first is not None and first.same_networks and leads[0]
    return Choice(tuple(files), _records(ranking, files), any(leads), starts)


def _nobody(ranking: Ranking) -> str:
    return (
        f"--teacher auto: nobody earns more on '{ranking.task.name}' than chance (the best, "
        f"{ranking.teachers[0].name}: {ranking.comparison}); try --method scratch"
    )


def _records(ranking: Ranking, files: Sequence[TeacherFile]) -> tuple[RankedRecord, ...]:
    """Return what run.json keeps of a ranking, untrained policies last."""
    return tuple(
        RankedRecord(
            name=one.name, better=one.better, cosine=one.cosine, steps=int(one.lengths.sum()),
            seconds=round(one.seconds, 2), returns=tuple(one.returns.tolist()),
            teachers=tuple(which for which, file in enumerate(files) if file == one.file),
            **dict(zip(("mean", "low", "high"), mean_ci(one.returns), strict=True)),
        )
        for one in (*ranking.teachers, ranking.untrained)
    )  # fmt: skip
