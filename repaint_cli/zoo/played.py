"""How teachers and untrained policies play a task, and whose steps a fresh critic calls better.

**E** episodes, **F** untrained.
"""

from dataclasses import dataclass, replace

import numpy as np

from repaint_cli.kernels import training_clock
from repaint_cli.learn.evaluation import play
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.rollout.gae import to_samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.similarity import cosine
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard
from repaint_cli.zoo.view_names import BOTH, TeacherFile, with_view
from repaint_cli.zoo.views import view_of

N_UNTRAINED = 5
"""Untrained policies that share the episodes of one view, where each has two or more."""


@dataclass(frozen=True, eq=False)
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
    seconds: float = 0.0
    """How long it played."""

    def joined(self, other: "Played") -> "Played":
        """Return it with more episodes of the same policy."""
        steps = self.lengths.sum(), other.lengths.sum()
        progress = None
        if self.progress is not None and other.progress is not None:
            progress = np.concatenate([self.progress, other.progress])
        return replace(
            self, progress=progress,
            returns=np.concatenate([self.returns, other.returns]),
            lengths=np.concatenate([self.lengths, other.lengths]),
            reverse=np.concatenate([self.reverse, other.reverse]),
            better=float(np.average([self.better, other.better], weights=steps)),
            seconds=self.seconds + other.seconds,
        )  # fmt: skip


@dataclass(frozen=True)
class Player:
    """Plays policies, and compares their steps with those of untrained ones by one fresh critic."""

    task: TaskCard
    seed: int
    critic: ActorCritic
    untrained: Played
    advantages: np.ndarray
    """Of the untrained policies' steps, sorted."""

    @classmethod
    def of(cls, task: TaskCard, spaces: Spaces, seed: int, n_episodes: int) -> "Player":
        """Let untrained policies play so many episodes in all, or a few more."""
        started = training_clock()
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
            "untrained", episodes.returns.ravel(), episodes.lengths.ravel(), progress, reverse, 0.5,
            seconds=training_clock() - started,
        )  # fmt: skip
        return cls(task, seed, critic, untrained, advantages)

    def play_teacher(
        self, file: TeacherFile, card: TeacherCard, n_episodes: int, turn: int = 0
    ) -> Played:
        """Let a teacher play, as it is looked at; each turn has episodes of its own."""
        started = training_clock()
        network, _ = store.read_teacher(file.path)
        view = view_of(network, card, file, self.task)
        rollout, episodes = play(
            view.policy, self.task, [self.seed], n_episodes, turn, purpose=Purpose.SCORE
        )
        own = card.task.in_mirror(view.symmetry)
        return Played(
            with_view(store.to_type(file.path, card), file.view),
            episodes.returns[0], episodes.lengths[0],
            None if episodes.progress is None else episodes.progress[0],
            _reverse(self.task, n_episodes), self._better(rollout), file,
            None if own is None else cosine(own, self.task),
            same_networks=file.view != BOTH and card.task.net.alike(self.task.net),
            seconds=training_clock() - started,
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
    n_episodes = task.env.even_episodes(n_episodes)
    options = task.start_options(1, n_episodes, None) or {}
    return np.array(options.get("reverse", [False] * n_episodes), bool)
