"""Which teacher of the zoo, seen in which view, is worth learning a task from: played, untrained.

The paper compares tasks by the weights of their rewards, and leaves open how to learn similarity
"before actually starting the transfer". Here every teacher that fits plays the task under its
reward by its most likely actions, and so do untrained policies. **E** episodes, **F** untrained.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from repaint_cli.errors import CheckpointError, NotFound
from repaint_cli.learn.evaluation import play, spaces_of
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.report.pairs import welch
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.similarity import cosine
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard, read_card
from repaint_cli.zoo.view_names import BOTH, TeacherFile, with_view
from repaint_cli.zoo.views import view_of

N_EPISODES = 20
"""Episodes of each view."""

N_UNTRAINED = 5
"""Untrained policies that share the episodes of one view, where each has two or more."""


@dataclass(frozen=True)
class Played:
    """What a policy did in a task."""

    name: str
    """As it is typed."""
    returns: np.ndarray
    """(E,)."""
    lengths: np.ndarray
    """Steps, (E,)."""
    progress: np.ndarray | None
    """Of a lap, %, (E,), in a race."""
    reverse: np.ndarray
    """Which episodes went the other way round, (E,) bool."""
    better: float
    """Share of its steps that a fresh critic calls better than an untrained policy's, in pairs."""
    file: TeacherFile | None = None
    """A teacher's file, and its view."""
    cosine: float | None = None
    """Of its task's weights, as seen, and the target's; None where there is none."""
    same_networks: bool = False
    """Whether a student can start from its weights."""


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
        return best if self.lead(best)[1] > 0 else None

    @property
    def comparison(self) -> str:
        """How much more the best earns than untrained policies, for people."""
        gap, low, high = self.lead(self.teachers[0])
        return f"{gap:+.4g} [{low:+.4g}, {high:+.4g}] against an untrained policy"


OnPlayed = Callable[[Played], object]
"""Is called with each policy that has played."""


def rank(
    task: TaskCard, seed: int, n_episodes: int = N_EPISODES, on_played: OnPlayed | None = None,
    among: Sequence[Path] | None = None,
) -> Ranking:  # fmt: skip
    """Let all teachers that fit a task play it, in every view.

    Args:
        task: the task.
        seed: of the episodes, and of the untrained policies.
        n_episodes: E.
        on_played: see `OnPlayed`.
        among: the files of those that play; all that fit where absent.

    Raises:
        NotFound: no teacher fits.
        CardError: the task cannot be played.
    """
    spaces = spaces_of(task)
    task.check_symmetry(spaces)
    if among is not None:
        store.check_fits([read_card(path) for path in among], task, spaces)
    paths = store.teachers().values() if among is None else among
    fitting = list(candidates(task, spaces, paths))
    if not fitting:
        raise NotFound(
            f"no teacher in the zoo fits task '{task.name}' ({spaces}); train one: "
            "repaint train-teacher --task TASK"
        )
    player, played = _Player.of(task, spaces, seed, n_episodes), []
    for file, card in fitting:
        one = player.play_teacher(file, card)
        played.append(one)
        if on_played:
            on_played(one)
    played.sort(key=lambda one: -one.returns.mean())
    return Ranking(task, player.untrained, tuple(played))


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


@dataclass(frozen=True)
class _Player:
    """Plays policies, and compares their steps with those of untrained ones by one fresh critic."""

    task: TaskCard
    seed: int
    n_episodes: int
    critic: ActorCritic
    untrained: Played
    advantages: np.ndarray
    """Of the untrained policies' steps, sorted."""

    @classmethod
    def of(cls, task: TaskCard, spaces: Spaces, seed: int, n_episodes: int) -> "_Player":
        seeds = [seed + i for i in range(max(1, min(N_UNTRAINED, n_episodes // 2)))]
        fresh = Learner.fresh(ActorCritic(spaces, task.net, len(seeds)), seeds, 1.0).student
        each = -(-n_episodes // len(seeds))
        rollout, episodes = play(fresh, task, seeds, each, purpose=Purpose.SCORE)
        fresh.storage.copy_(fresh.storage[:1].clone())  # one critic judges all
        critic = fresh.alone(0)
        samples = to_samples(rollout, fresh.value, task.ppo)
        advantages = np.sort(np.concatenate([
            own[:n].numpy()
            for own, n in zip(samples.advantages, samples.counts.tolist(), strict=True)
        ]))  # fmt: skip
        progress = None if episodes.progress is None else episodes.progress.ravel()
        reverse = np.tile(_reverse(task, each), len(seeds))
        untrained = Played(
            "untrained", episodes.returns.ravel(), episodes.lengths.ravel(), progress, reverse, 0.5
        )
        return cls(task, seed, n_episodes, critic, untrained, advantages)

    def play_teacher(self, file: TeacherFile, card: TeacherCard) -> Played:
        """Let a teacher play, as it is looked at."""
        network, _ = store.read_teacher(file.path)
        view = view_of(network, card, file, self.task)
        rollout, episodes = play(
            view.policy, self.task, [self.seed], self.n_episodes, purpose=Purpose.SCORE
        )
        own = card.task.in_mirror(view.symmetry)
        return Played(
            with_view(store.to_type(file.path, card), file.view),
            episodes.returns[0], episodes.lengths[0],
            None if episodes.progress is None else episodes.progress[0],
            _reverse(self.task, self.n_episodes), self._better(rollout), file,
            None if own is None else cosine(own, self.task),
            same_networks=file.view != BOTH and card.task.net.alike(self.task.net),
        )  # fmt: skip

    def _better(self, rollout: Rollout) -> float:
        """Return P(Â′ > Â) of a step of a rollout and one of the untrained policies'."""
        samples = to_samples(rollout, self.critic.value, self.task.ppo)
        own = samples.advantages[0, : int(samples.counts[0])].numpy()
        below = np.searchsorted(self.advantages, own, side="left")
        equal = np.searchsorted(self.advantages, own, side="right") - below
        return float((below + 0.5 * equal).mean() / len(self.advantages))


def _reverse(task: TaskCard, n_episodes: int) -> np.ndarray:
    """Return which of an evaluation's episodes go the other way round, (E,) bool."""
    options = task.start_options(1, n_episodes, None) or {}
    return np.array(options.get("reverse", [False] * n_episodes), bool)
