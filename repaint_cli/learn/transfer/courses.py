"""The two courses of a transfer: by the numbers on the card, or by what is measured."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.episodes import Episodes
from repaint_cli.learn.rollout.batches import front
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.states import below, with_prefix
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.measurements import Measurements
from repaint_cli.learn.transfer.schedules import Phase
from repaint_cli.learn.transfer.selection import Selection, on_loss_scale, rescale, top_share
from repaint_cli.learn.transfer.teachers import Teacher
from repaint_cli.tasks.card import TaskCard

SHARE, LEAST = 0.05, 1500
"""What measuring may cost: this share of a run's environment steps, or so many of them."""


def affordable(card: TaskCard, episode: float) -> float:
    """Return how many of a seed's steps may be spent on measuring teachers, and on students.

    Args:
        card: the target task.
        episode: mean length of an episode, steps.
    """
    ppo = card.ppo
    each = ppo.n_episodes * episode if ppo.n_episodes else ppo.n_steps or 0
    return max(LEAST, SHARE * min(each, ppo.max_steps or each) * ppo.n_iterations)


def course_of(
    card: TaskCard,
    teachers: Sequence[Teacher],
    n_seeds: int,
    measurements: Measurements | None = None,
) -> Course:
    """Return the course that a card asks for; without teachers it is plain PPO.

    Args:
        card: the target task.
        teachers: M of them.
        n_seeds: S.
        measurements: what teachers and untrained policies earned, where something is automatic.
    """
    if not (card.automatic and teachers):
        return Scheduled(card, teachers, n_seeds)
    assert measurements is not None, "an automatic transfer begins with what teachers earn"
    return Measured(card, teachers, n_seeds, measurements)


class Scheduled(Course):
    """The ratio R:I, the schedule of β, and ζ, as the card has them (paper, algorithms 1 and 2)."""

    def phase(self, k: int) -> Phase:
        """Return what iteration k is to do, by R and I."""
        return schedules.phase(k, self.card.transfer) if self.teachers else "ppo"

    def betas(self, k: int) -> Tensor:
        """Return β_k of each teacher for each seed, (M, S), by the schedule."""
        if not self.teachers:
            return torch.zeros(0, self.n_seeds, dtype=torch.float64)
        coefs = schedules.kickstart_coefs(k, self.card.transfer, len(self.teachers))
        return torch.tensor(coefs, dtype=torch.float64).unsqueeze(1).repeat(1, self.n_seeds)


class Measured(Scheduled):
    """The next phase, β, and what is kept, each as measured where the card says "auto".

    See `measurements` for the rules. Seeds that train side by side share the phase and the end.
    """

    def __init__(
        self,
        card: TaskCard,
        teachers: Sequence[Teacher],
        n_seeds: int,
        measurements: Measurements,
    ) -> None:
        super().__init__(card, teachers, n_seeds)
        self.measurements = measurements
        """What was measured."""
        self.by_rollouts = False
        """Whether the students' own rollouts say what they earn: those with numbered actions."""

    def _lasts(self, k: int) -> bool:
        return k <= self.card.transfer.iterations and not self.ended

    def phase(self, k: int) -> Phase:
        """Return what iteration k is to do: by R and I, or as long as instances are kept."""
        phase, transfer = super().phase(k), self.card.transfer
        if phase == "critic" or k > transfer.iterations:
            return phase
        if self.ended:
            return "ppo"
        if transfer.phases == "auto" and phase != "joint":
            may = k > 1 + transfer.critic_warmup and not self.after_instance
            pays = may and self.measurements.instances_pay()
            return "instance" if pays and self.actors() else "representation"
        if phase == "instance" and not self.actors():
            return "representation"
        return phase

    def betas(self, k: int) -> Tensor:
        """Return β_k of each teacher for each seed, (M, S), by the schedule or by the lead."""
        if not self._lasts(k):
            return torch.zeros(len(self.teachers), self.n_seeds, dtype=torch.float64)
        if self.card.transfer.kickstart_schedule == "auto":
            return torch.from_numpy(self.measurements.betas())
        return super().betas(k)

    @property
    def ended(self) -> bool:
        """Whether no teacher has been ahead for some iterations, or measuring cost too much."""
        return self.measurements.ended

    def leading(self) -> np.ndarray:
        """Return which seeds learn from which teacher, (M, S): where it decides, those behind."""
        by_lead = self.card.select.rule == "auto"
        return self.measurements.leading if by_lead else super().leading()

    def choose(
        self,
        k: int,
        samples: Samples,
        rngs: Sequence[np.random.Generator],
        relevance: Tensor | None = None,
    ) -> tuple[Selection, Samples]:
        """Choose by the card's rule, or the more, the more teachers' samples surpass the students'.

        See `Course.choose`.
        """
        shares = self.measurements.shares(samples)  # which the next phase depends on in any case
        if self.card.select.rule != "auto":
            return super().choose(k, samples, rngs, relevance)
        own = self.last.moments
        scaled = rescale(samples, "student-batch", own)
        learned = on_loss_scale(samples, scaled, self.card.select.loss_scale, own)
        return Selection(*front(top_share(scaled, shares))), learned

    def before_own_iteration(self, k: int) -> None:
        """Note who leads whom, while the transfer lasts."""
        if self._lasts(k):
            self.measurements.add_betas(self.measurements.betas())

    def keep_batch(self, rollout: Rollout, samples: Samples) -> None:
        """Keep the students' own batch; in a joint transfer teachers act before it is over."""
        super().keep_batch(rollout, samples)
        self.by_rollouts = not samples.actions.is_floating_point()
        if self.by_rollouts:
            seeds, returns, _ = rollout.episodes()
            self.measurements.add_rollout(seeds, returns)
        if self.card.transfer.joint:
            self.measurements.add_advantages(samples)

    @property
    def needs_fitted_critic(self) -> bool:
        """Whether Â of the students' batch matters after the critic's fit."""
        return not self.ended or super().needs_fitted_critic

    def keep_advantages(self, samples: Samples) -> None:
        """Keep what Â of the students' batch is after the critic's fit."""
        super().keep_advantages(samples)
        self.measurements.add_advantages(samples)

    def after_evaluation(self, k: int, steps: float, evaluation: Episodes) -> int:
        """Add what the students earn by their likeliest actions; see `Course.after_evaluation`.

        As many episodes count as cost a twentieth of the iteration's steps, but at least 2.
        """
        if self.by_rollouts or k >= self.card.transfer.iterations or self.ended:
            return 0
        length = float(evaluation.lengths.mean())
        n = max(2, int(SHARE * steps / length))
        used = float(evaluation.lengths[:, :n].sum(1).mean())
        self.measurements.add_evaluation(evaluation.returns[:, :n], used)
        if self.measurements.steps > affordable(self.card, length):
            self.measurements.end()
        return n

    def state(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on, as tensors."""
        by = {"by_rollouts": torch.tensor(self.by_rollouts)}
        return super().state() | by | with_prefix("measured/", self.measurements.state())

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Go on from a state; see `Course.load`."""
        super().load(state)
        self.by_rollouts = bool(state["by_rollouts"].numpy().item())
        self.measurements = Measurements.of_state(below("measured/", state))
