"""Which teacher of the zoo, seen in which view, is worth learning a task from: played, untrained.

The paper compares tasks by the weights of their rewards, and leaves open how to learn similarity
"before actually starting the transfer". Here every teacher that fits plays the task under its
reward by its most likely actions, and so do untrained policies. **E** episodes, **F** untrained.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy  # whose parts are loaded when first used

from repaint_cli.errors import CheckpointError, NotFound
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.learn.transfer.measurements import rounding
from repaint_cli.policies.spaces import Spaces
from repaint_cli.report.pairs import welch
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.played import Played, Player
from repaint_cli.zoo.teacher_card import TeacherCard, read_card
from repaint_cli.zoo.view_names import AUTO, BOTH, TeacherFile

N_EPISODES = 20
"""Episodes of each view."""

FEWEST = 2
"""Episodes of each view that are played whatever they cost: a standard error needs two."""


@dataclass(frozen=True)
class Ranking:
    """Teachers as they play a task, the best first."""

    task: TaskCard
    untrained: Played
    teachers: tuple[Played, ...]

    def lead(self, teacher: Played) -> tuple[float, float, float]:
        """Return how much more a teacher earns than untrained policies, with Welch's interval.

        All intervals hold together in 95 % of rankings, as the best is one of many (Bonferroni).
        """
        level = 1 - 0.05 / max(1, len(self.teachers))
        return welch(teacher.returns, self.untrained.returns, level)

    @property
    def best(self) -> Played | None:
        """The teacher who earns most, if that is more than untrained policies by chance."""
        best = self.teachers[0]
        return best if self.lead(best)[1] > rounding(self.untrained.returns.mean()) else None

    @property
    def comparison(self) -> str:
        """How much more the best earns than untrained policies, for people."""
        gap, low, high = self.lead(self.teachers[0])
        return f"{gap:+.4g} [{low:+.4g}, {high:+.4g}] against an untrained policy"


def ahead(one: Played, other: Played) -> bool:
    """Return whether one earns more than another by more than both standard errors together."""
    gap = one.returns.mean() - other.returns.mean()
    error = np.hypot(scipy.stats.sem(one.returns), scipy.stats.sem(other.returns))
    return bool(gap > error + rounding(other.returns.mean()))


Affordable = Callable[[float], float]
"""Says how many steps may be played, by the mean length of the best teacher's episodes."""


def rank(
    task: TaskCard, seed: int, n_episodes: int = N_EPISODES,
    among: Sequence[TeacherFile] | None = None, affordable: Affordable | None = None,
) -> Ranking:  # fmt: skip
    """Let all teachers that fit a task play it, in every view.

    Args:
        task: the task.
        seed: of the episodes, and of the untrained policies.
        n_episodes: E.
        among: those that play, as they are looked at; all that fit, in every view, where absent.
        affordable: see `Affordable`; after 2 episodes of each those that may be the best go on.

    Raises:
        NotFound: no teacher fits.
        CardError: the task cannot be played.
    """
    spaces = spaces_of(task)
    task.check_symmetry(spaces)
    if among is None:
        fitting = list(candidates(task, spaces, store.teachers().values()))
    else:
        fitting = [(file, read_card(file.path)) for file in among]
        store.check_fits([*{file.path: card for file, card in fitting}.values()], task, spaces)
    if not fitting:
        raise NotFound(
            f"no teacher in the zoo fits task '{task.name}' ({spaces}); train one: "
            "repaint train-teacher --task TASK"
        )
    player = Player.of(task, spaces, seed, n_episodes)
    first = n_episodes if affordable is None else min(FEWEST, n_episodes)
    played = [player.play_teacher(file, card, first) for file, card in fitting]
    if affordable:
        spent = sum(one.lengths.sum() for one in (*played, player.untrained))
        played = _played_on(player, played, dict(fitting), n_episodes - first, affordable, spent)
    played.sort(key=lambda one: (-len(one.returns), -one.returns.mean()))  # who played on is better
    return Ranking(task, player.untrained, tuple(played))


def _played_on(
    player: Player, played: Sequence[Played], cards: Mapping[TeacherFile, TeacherCard],
    most: int, affordable: Affordable, spent: float,
) -> list[Played]:  # fmt: skip
    """Return what teachers did, with up to `most` more episodes of those that may be the best.

    Others earn less than the best by more than both standard errors.
    """
    best = max(played, key=lambda one: one.returns.mean())
    least = best.returns.mean() - scipy.stats.sem(best.returns)
    standing = [one for one in played if one.returns.mean() + scipy.stats.sem(one.returns) >= least]
    each = sum(one.lengths.mean() for one in standing)
    more = min(most, int((affordable(best.lengths.mean()) - spent) / each))
    if player.task.eval.both_directions:
        more -= more % 2  # as many each way round
    if more < 1:
        return list(played)
    return [
        one.joined(player.play_teacher(one.file, cards[one.file], more, 1))
        if one in standing and one.file
        else one
        for one in played
    ]


def candidates(
    task: TaskCard, spaces: Spaces, paths: Iterable[Path]
) -> Iterator[tuple[TeacherFile, TeacherCard]]:
    """Yield teachers that fit a task, in each view that may differ; damaged files fit none."""
    for path in paths:
        with suppress(CheckpointError):
            card = read_card(path)
            if not store.mismatch(card, task, spaces):
                for view in views_worth_playing(card, task):
                    yield TeacherFile(path, view), card


def views_of(file: TeacherFile, task: TaskCard) -> list[TeacherFile]:
    """Return a teacher in each view that may differ where its view is `AUTO`, else as it is."""
    if file.view != AUTO:
        return [file]
    card = read_card(file.path)
    return [TeacherFile(file.path, view) for view in views_worth_playing(card, task)]


def views_worth_playing(teacher: TeacherCard, task: TaskCard) -> list[str]:
    """Return the views of a teacher that may differ from it in weights or in what they earn."""
    views = [""]
    for symmetry in task.symmetries:
        stays = not (task.changing_terms(symmetry) or teacher.task.changing_terms(symmetry))
        if not (stays and symmetry.same_world):
            views.append(symmetry.name)
        if stays and BOTH not in views:
            views.append(BOTH)
    return views
