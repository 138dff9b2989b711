"""The course of a transfer: what each iteration does, how much the teachers count, when it ends."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.episodes import Episodes
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.rollout.transitions import Transitions, transitions
from repaint_cli.learn.states import below, with_prefix
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.iteration import Iteration
from repaint_cli.learn.transfer.schedules import Phase
from repaint_cli.learn.transfer.selection import (
    Moments,
    Selection,
    moments,
    on_loss_scale,
    rescale,
    select,
)
from repaint_cli.learn.transfer.teachers import ActingTeacher, Teacher
from repaint_cli.learn.update.objectives import masked_mean
from repaint_cli.tasks.card import TaskCard


@dataclass(frozen=True)
class OwnBatch:
    """What is kept of the students' last own batch: teachers' samples are compared with it."""

    moments: Moments
    """Mean and standard deviation of Â, (S, 1) each."""
    reward: Tensor
    """Mean reward, (S,)."""
    episode_return: np.ndarray
    """Mean return of the episodes that ended in it, (S,); nan of none."""
    transitions: Transitions | None = None
    """Its transitions, where teachers' samples are chosen by relevance to them."""

    @classmethod
    def empty(cls, n_seeds: int) -> "OwnBatch":
        """Return the batch to use before the first iteration."""
        nothing = (torch.zeros(n_seeds, 1), torch.ones(n_seeds, 1))
        return cls(nothing, torch.zeros(n_seeds), np.full(n_seeds, np.nan))

    def state(self) -> dict[str, Tensor]:
        """Return it as tensors, for a checkpoint, which holds finite numbers only."""
        (mean, std), returns = self.moments, torch.from_numpy(self.episode_return)
        tensors = {
            "last/mean": mean, "last/std": std, "last/reward": self.reward,
            "last/return": returns.nan_to_num(0.0), "last/ended": ~returns.isnan(),
        }  # fmt: skip
        return tensors | with_prefix("batch/", self.transitions.state() if self.transitions else {})

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> "OwnBatch":
        """Return the batch that `state` described.

        Raises:
            KeyError: a tensor is missing.
        """
        last, batch = below("last/", state), below("batch/", state)
        return cls(
            moments=(last["mean"], last["std"]),
            reward=last["reward"],
            episode_return=np.where(last["ended"], last["return"], np.nan),
            transitions=Transitions.of_state(batch) if batch else None,
        )


class Course(ABC):
    """How a transfer proceeds; `ppo.train` calls it before and after each iteration.

    A new course defines `phase`, what each iteration does, and `betas`, the weights of the
    cross-entropies to the teachers; the rest may stay as it is here.
    """

    def __init__(self, card: TaskCard, teachers: Sequence[Teacher], n_seeds: int) -> None:
        self.card, self.teachers, self.n_seeds = card, tuple(teachers), n_seeds
        self.last = OwnBatch.empty(n_seeds)
        self.advised = False
        """Whether teachers have advised in an iteration before."""
        self.after_instance = False
        """Whether the last iteration was one of instance transfer."""

    @abstractmethod
    def phase(self, k: int) -> Phase:
        """Return what iteration k is to do."""

    @abstractmethod
    def betas(self, k: int) -> Tensor:
        """Return β_k of each teacher for each seed, (M, S) float64."""

    @property
    def ended(self) -> bool:
        """Whether the transfer is over for good; without teachers it is from the beginning."""
        return not self.teachers

    def leading(self) -> np.ndarray:
        """Return which seeds learn from the samples of which teacher, (M, S) bool."""
        return np.ones((len(self.teachers), self.n_seeds), bool)

    def actors(self) -> list[ActingTeacher]:
        """Return the teachers who act in an instance iteration: those that lead some seed."""
        pairs = zip(self.teachers, self.leading(), strict=True)
        may_act = [(teacher, leads) for teacher, leads in pairs if teacher.acts]
        return [
            ActingTeacher(teacher, which, len(may_act), leads)
            for which, (teacher, leads) in enumerate(may_act)
            if leads.any()
        ]

    def choose(
        self,
        k: int,
        samples: Samples,
        rngs: Sequence[np.random.Generator],
        relevance: Tensor | None = None,
    ) -> tuple[Selection, Samples]:
        """Choose the teachers' samples to learn from in iteration k.

        Args:
            k: the iteration.
            samples: all of them, with Â′ as the student's critic estimates it.
            rngs: one generator per seed, for the rules that draw.
            relevance: of each sample, (S, B), for the rule `rbt`.

        Returns:
            The selection, and all samples on the scale they are learned on.
        """
        config, own = self.card.select, self.last.moments
        scaled = rescale(samples, config.scale, own)
        threshold = schedules.threshold(k, config, self.card.transfer)
        selection = select(scaled, config, threshold, rngs, relevance)
        return selection, on_loss_scale(samples, scaled, config.loss_scale, own)

    def start(self, k: int) -> Iteration:
        """Decide iteration k."""
        phase, betas = self.phase(k), torch.zeros(len(self.teachers), self.n_seeds).double()
        if phase not in ("critic", "instance"):
            betas = self.betas(k)
            self.before_own_iteration(k)
        if phase == "representation" and not betas.any():
            phase = "ppo"  # no teacher advises
        advises = bool(betas.any())
        distils = advises and not self.advised and self.card.transfer.distill_epochs > 0
        self.advised |= advises
        ppo, (_, alpha_2) = self.card.ppo, schedules.alphas(k, self.card.transfer)
        return Iteration(
            k, phase, schedules.learning_rate(k, ppo), self._policy_scale(k, phase), alpha_2,
            schedules.clip_range(k, ppo), betas, distils,
        )  # fmt: skip

    def _policy_scale(self, k: int, phase: Phase) -> float:
        """Return what the policies' step size is multiplied by."""
        alpha_1, alpha_2 = schedules.alphas(k, self.card.transfer)
        if phase == "instance":
            return alpha_2
        return 1.0 if self.ended else alpha_1

    def before_own_iteration(self, k: int) -> None:  # noqa: B027
        """Note that the policies will learn from their own samples in iteration k."""

    def keep_batch(self, rollout: Rollout, samples: Samples) -> None:
        """Keep what the teachers' samples will be compared with: the students' own batch."""
        by_relevance = self.card.transfer.instance and self.card.select.rule == "rbt"
        self.last = OwnBatch(
            moments(samples), masked_mean(samples.rewards, samples.counts),
            rollout.mean_episodes()[0],
            transitions(rollout) if self.teachers and by_relevance else None,
        )  # fmt: skip

    def after_own_iteration(self, k: int, estimate: Callable[[], Samples]) -> None:
        """Compare by the fitted critic, which will judge the teachers' samples, where needed.

        Args:
            k: the iteration.
            estimate: returns the students' batch with Â as the critic estimates it now.
        """
        goes_on = k < self.card.transfer.iterations and not self.card.transfer.joint
        if self.teachers and goes_on and self.needs_fitted_critic:
            self.keep_advantages(estimate())

    @property
    def needs_fitted_critic(self) -> bool:
        """Whether Â of the students' batch matters after the critic's fit."""
        return self.card.select.scale == "student-batch"

    def keep_advantages(self, samples: Samples) -> None:
        """Keep what Â of the students' batch is after the critic's fit."""
        self.last = replace(self.last, moments=moments(samples))

    def finish(self, phase: Phase) -> None:
        """Note what the iteration that has ended did."""
        self.after_instance = phase == "instance"

    def after_evaluation(self, k: int, steps: float, evaluation: Episodes) -> int:
        """Use the evaluation after iteration k, if the course depends on it.

        Args:
            k: the iteration.
            steps: its environment steps of a seed, on average.
            evaluation: the students' episodes.

        Returns:
            How many episodes of each seed were used, which count as steps.
        """
        return 0

    def state(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on, as tensors."""
        state = {"after_instance": self.after_instance, "advised": self.advised}
        return self.last.state() | {name: torch.tensor(value) for name, value in state.items()}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Go on from a state; tensors of others are left alone.

        Raises:
            KeyError: a tensor is missing.
        """
        self.last = OwnBatch.of_state(state)
        self.after_instance = bool(state["after_instance"].numpy().item())
        self.advised = bool(state["advised"].numpy().item())
