"""All that changes while seeds learn, and how they act and remember."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from repaint_cli.learn.rollout.batches import share_of
from repaint_cli.learn.rollout.collect import Policy, collect, start
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Frames
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import Experience, Transitions
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.transfer.measured import Measured
from repaint_cli.learn.transfer.selection import Moments, moments
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.objectives import masked_mean
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card import TaskCard


@dataclass
class Learner:
    """All that changes while S seeds learn; what a checkpoint holds."""

    student: ActorCritic
    """The policies and critics."""
    optimizer: RowAdam
    """Their optimiser."""
    seeds: list[int]
    """The run seeds, (S,)."""
    iteration: int
    """Finished iterations."""
    env_steps: np.ndarray
    """Steps taken for training, the teacher's among them, (S,)."""
    last_moments: Moments
    """Mean and standard deviation of Â in each student's last own batch, (S, 1) each; where ζ is
    meant on their scale, by the critic that will judge the teacher's samples."""
    last_reward: torch.Tensor
    """Mean reward of each student's last own batch, (S,)."""
    last_return: np.ndarray
    """Mean return of the episodes of each student's last own rollout, (S,); nan of none."""
    last_batch: Transitions | None = None
    """Each student's last own batch, where teachers' samples are chosen by relevance to it."""
    memory: Experience | None = None
    """The replay buffer of Q-learning: each seed's newest transitions."""
    measured: Measured | None = None
    """What automatic transfer goes by; whoever evaluates keeps it up to date."""
    after_instance: bool = False
    """Whether the last iteration was one of instance transfer."""

    @classmethod
    def fresh(cls, student: ActorCritic, seeds: list[int], learning_rate: float) -> "Learner":
        """Start with newly drawn parameters."""
        n = len(seeds)
        student.initialize([generator(seed, Purpose.INITIALIZE) for seed in seeds])
        optimizer = RowAdam(student, learning_rate)
        nothing = (torch.zeros(n, 1), torch.ones(n, 1))
        return cls(
            student, optimizer, seeds, 0, np.zeros(n, int), nothing, torch.zeros(n),
            np.full(n, np.nan),
        )  # fmt: skip

    def act(
        self, task: TaskCard, k: int, policy: Policy | None = None, *, beside: int = 0
    ) -> Rollout:
        """Let the students act, as many steps or episodes as the card says.

        Args:
            task: the target task.
            k: the iteration.
            policy: how they act; by their policies where absent.
            beside: how many teachers act in the same iteration and share its steps.
        """
        ppo = task.ppo
        return self._roll(
            task, k, policy or self.student.policy, (Purpose.TRAIN, Purpose.ACT),
            n_steps=None if ppo.n_episodes else share_of(ppo.n_steps or 0, 0, 1 + beside),
            n_envs=ppo.n_episodes or max(1, ppo.n_envs // (1 + beside)),
            whole=ppo.whole_episodes, record=task.env.records,
        )  # fmt: skip

    def watch(
        self,
        task: TaskCard,
        k: int,
        policy: Policy,
        *,
        which: int = 0,
        of: int = 1,
        beside: int = 0,
    ) -> Rollout:
        """Let a teacher act, one of several that share an iteration's steps or episodes.

        Args:
            task: the target task.
            k: the iteration.
            policy: the teacher's.
            which: its number, from 0.
            of: how many teachers there are.
            beside: 1 where the student acts in the same iteration.
        """
        ppo, sharing = task.ppo, of + beside
        if ppo.n_episodes:
            n_steps, n_envs = None, share_of(task.transfer.teacher_episodes, which, of)
        else:
            n_steps = share_of(ppo.n_steps or 0, which + beside, sharing)
            n_envs = max(1, ppo.n_envs // sharing)
        return self._roll(
            task, k, policy, (Purpose.TEACHER, Purpose.ACT_AS_TEACHER), stream=which,
            n_steps=n_steps, n_envs=n_envs, whole=ppo.whole_episodes,
        )  # fmt: skip

    def _roll(
        self,
        task: TaskCard,
        k: int,
        policy: Policy,
        purposes: tuple[Purpose, Purpose],
        *,
        n_steps: int | None,
        n_envs: int,
        stream: int = 0,
        **options: Any,
    ) -> Rollout:
        """Roll a policy out in fresh environments; `purposes` name their seeds and the noise."""
        env, obs = start(
            task, self.seeds, n_envs, purposes[0], k, stream=stream, one_episode=n_steps is None
        )
        rngs = [generator(seed, purposes[1], k, stream) for seed in self.seeds]
        rollout = collect(env, obs, policy, rngs, n_steps=n_steps, **options)
        env.close()
        self.env_steps += rollout.valid.sum((0, 2))
        return rollout

    def shuffles(self, k: int) -> list[np.random.Generator]:
        """Return each seed's generator for the order of its samples in iteration k."""
        return [generator(seed, Purpose.SHUFFLE, k) for seed in self.seeds]

    def see(self, rollout: Rollout) -> None:
        """Take what was observed into the statistics of each student's normaliser."""
        if self.student.normalizer:
            for seed, store in enumerate(rollout.frames.stores):
                self.student.normalizer.update(seed, store)

    def remember(self, rollout: Rollout, samples: Samples, batch: Transitions | None) -> None:
        """Keep what teachers' samples will be judged against: the student's own batch."""
        self.last_return, _ = rollout.mean_episodes()
        self.last_moments = moments(samples)
        self.last_reward = masked_mean(samples.rewards, samples.counts)
        self.last_batch = batch


def without_sights(rollout: Rollout) -> Rollout:
    """Return a rollout without its observations, which fill memory and no table."""
    return replace(rollout, frames=Frames([]))
