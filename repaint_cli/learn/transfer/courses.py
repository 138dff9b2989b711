"""The two courses of a transfer: by the numbers on the card, or by what is measured."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from torch import Tensor

from repaint_cli.learn.rollout.batches import front
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.states import below, with_prefix
from repaint_cli.learn.transfer import schedules
from repaint_cli.learn.transfer.course import Course, Evaluate
from repaint_cli.learn.transfer.measurements import Measurements
from repaint_cli.learn.transfer.schedules import Phase
from repaint_cli.learn.transfer.selection import Selection, on_loss_scale, rescale, top_share
from repaint_cli.learn.transfer.teachers import Teacher
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card import TaskCard


def course_of(card: TaskCard, teachers: Sequence[Teacher], n_seeds: int) -> Course:
    """Return the course that a card asks for; without teachers it is plain PPO."""
    kind = Measured if card.automatic and teachers else Scheduled
    return kind(card, teachers, n_seeds)


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

    def __init__(self, card: TaskCard, teachers: Sequence[Teacher], n_seeds: int) -> None:
        super().__init__(card, teachers, n_seeds)
        self.measurements: Measurements | None = None
        """What was measured; None before `begin`."""

    @property
    def _measured(self) -> Measurements:
        assert self.measurements is not None, "Measured.begin comes before the first iteration"
        return self.measurements

    def _lasts(self, k: int) -> bool:
        return k <= self.card.transfer.iterations and not self.ended

    def phase(self, k: int) -> Phase:
        """Return what iteration k is to do: by R and I, or by what was gained per step."""
        phase, transfer = super().phase(k), self.card.transfer
        if phase == "critic" or k > transfer.iterations:
            return phase
        if self.ended:
            return "ppo"
        if transfer.phases == "auto" and phase != "joint":
            may = k > 1 + transfer.critic_warmup and not self.after_instance
            pays = may and self._measured.instances_pay()
            return "instance" if pays and self.actors() else "representation"
        if phase == "instance" and not self.actors():
            return "representation"
        return phase

    def betas(self, k: int) -> Tensor:
        """Return β_k of each teacher for each seed, (M, S), by the schedule or by the lead."""
        if not self._lasts(k):
            return torch.zeros(len(self.teachers), self.n_seeds, dtype=torch.float64)
        if self.card.transfer.kickstart_schedule == "auto":
            return torch.from_numpy(self._measured.betas(self._cosines))
        return super().betas(k)

    @property
    def _cosines(self) -> list[float | None]:
        return [teacher.cosine for teacher in self.teachers]

    @property
    def ended(self) -> bool:
        """Whether no teacher has been ahead of any student for some iterations."""
        return self._measured.ended

    def leading(self) -> np.ndarray:
        """Return which seeds learn from which teacher, (M, S): where it decides, those behind."""
        by_lead = self.card.select.rule == "auto"
        return self._measured.leading if by_lead else super().leading()

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
        shares = self._measured.shares(samples)  # which the next phase depends on in any case
        if self.card.select.rule != "auto":
            return super().choose(k, samples, rngs, relevance)
        own = self.last.moments
        scaled = rescale(samples, "student-batch", own)
        learned = on_loss_scale(samples, scaled, self.card.select.loss_scale, own)
        return Selection(*front(top_share(scaled, shares))), learned

    def begin(self, student: ActorCritic, evaluate: Evaluate) -> None:
        """Evaluate the students and the teachers, unless a checkpoint holds their returns."""
        if self.measurements is None:
            of_students = evaluate(student)
            of_teachers = [evaluate(teacher.network) for teacher in self.teachers]
            self.measurements = Measurements(of_students, of_teachers)

    def before_own_iteration(self, k: int) -> None:
        """Note who leads whom, while the transfer lasts."""
        if self._lasts(k):
            self._measured.add_betas(self._measured.betas(self._cosines))

    def keep_batch(self, rollout: Rollout, samples: Samples) -> None:
        """Keep the students' own batch; in a joint transfer teachers act before it is over."""
        super().keep_batch(rollout, samples)
        if self.card.transfer.joint:
            self._measured.add_advantages(samples)

    @property
    def needs_fitted_critic(self) -> bool:
        """Whether Â of the students' batch matters after the critic's fit."""
        return not self.ended or super().needs_fitted_critic

    def keep_advantages(self, samples: Samples) -> None:
        """Keep what Â of the students' batch is after the critic's fit."""
        super().keep_advantages(samples)
        self._measured.add_advantages(samples)

    def after_evaluation(self, k: int, phase: Phase, steps: float, returns: np.ndarray) -> bool:
        """Add the returns of the students after iteration k; see `Course.after_evaluation`."""
        used = k < self.card.transfer.iterations and not self.ended
        if used:
            self._measured.add_evaluation(returns, steps, phase)
        return used

    def state(self) -> dict[str, Tensor]:
        """Return what a checkpoint needs to go on, as tensors."""
        return super().state() | with_prefix("measured/", self._measured.state())

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Go on from a state; see `Course.load`."""
        super().load(state)
        measured = below("measured/", state)
        self.measurements = Measurements.of_state(measured) if measured else None
