"""All that changes while seeds learn, and how they act and remember."""

from dataclasses import dataclass

import numpy as np
import torch

from repaint_cli.learn.advantages import Samples
from repaint_cli.learn.objectives import masked_mean
from repaint_cli.learn.optimizer import RowAdam
from repaint_cli.learn.rollout import Policy, collect, start
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.learn.selection import Moments, moments
from repaint_cli.learn.tape import Rollout
from repaint_cli.learn.transitions import Transitions
from repaint_cli.nets import ActorCritic
from repaint_cli.tasks import TaskCard


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
    last_batch: Transitions | None = None
    """Each student's last own batch, where teachers' samples are chosen by relevance to it."""

    @classmethod
    def fresh(cls, student: ActorCritic, seeds: list[int], learning_rate: float) -> "Learner":
        """Start with newly drawn parameters."""
        n = len(seeds)
        student.initialize([generator(seed, Purpose.INITIALIZE) for seed in seeds])
        optimizer = RowAdam(student, learning_rate)
        nothing = (torch.zeros(n, 1), torch.ones(n, 1))
        return cls(student, optimizer, seeds, 0, np.zeros(n, int), nothing, torch.zeros(n))

    def act(self, task: TaskCard, k: int) -> Rollout:
        """Let the students act, as many steps or episodes as the card says."""
        ppo = task.ppo
        n_envs = ppo.n_episodes or ppo.n_envs
        one_episode = ppo.n_episodes is not None
        env, obs = start(task, self.seeds, n_envs, Purpose.TRAIN, k, one_episode=one_episode)
        rngs = [generator(seed, Purpose.ACT, k) for seed in self.seeds]
        rollout = collect(
            env, obs, self.student.policy, rngs, n_steps=None if one_episode else ppo.n_steps,
            whole=ppo.whole_episodes, record=task.env.records,
        )  # fmt: skip
        env.close()
        self.env_steps += rollout.valid.sum((0, 2))
        return rollout

    def watch(
        self, task: TaskCard, k: int, policy: Policy, *, which: int = 0, of: int = 1
    ) -> Rollout:
        """Let a teacher act, one of several that share an iteration's steps or episodes."""
        n_steps, n_envs = None, task.transfer.teacher_episodes
        if task.ppo.n_episodes is None:
            assert task.ppo.n_steps is not None
            n_steps, n_envs = _part(task.ppo.n_steps, which, of), max(1, task.ppo.n_envs // of)
        else:
            n_envs = _part(n_envs, which, of)
        env, obs = start(
            task, self.seeds, n_envs, Purpose.TEACHER, k,
            stream=which, one_episode=n_steps is None,
        )  # fmt: skip
        rngs = [generator(seed, Purpose.ACT_AS_TEACHER, k, which) for seed in self.seeds]
        rollout = collect(env, obs, policy, rngs, n_steps=n_steps)
        env.close()
        self.env_steps += rollout.valid.sum((0, 2))
        return rollout

    def see(self, rollout: Rollout) -> None:
        """Take what was observed into the statistics of each student's normaliser."""
        if self.student.normalizer:
            for seed, store in enumerate(rollout.frames.stores):
                self.student.normalizer.update(seed, store)

    def remember(self, samples: Samples, batch: Transitions | None) -> None:
        """Keep what teachers' samples will be judged against: the student's own batch."""
        self.last_moments = moments(samples)
        self.last_reward = masked_mean(samples.rewards, samples.counts)
        self.last_batch = batch


def _part(total: int, which: int, of: int) -> int:
    """Return what falls to one of several who share evenly, the first of them first."""
    return total // of + (which < total % of)
