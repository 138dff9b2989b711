"""A run's teachers: checked and loaded; and a student that starts from one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np
import torch

from repaint_cli.errors import CardError, CheckpointError, TeacherMismatch
from repaint_cli.files.atomic import sha256
from repaint_cli.learn.transfer.teachers import Teacher
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.record_parts import TeacherRecord
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import TeacherCard, read_card
from repaint_cli.zoo.view_names import TeacherFile
from repaint_cli.zoo.views import View, view_of


@dataclass(frozen=True)
class RunTeachers:
    """The teachers of a run, and the task that they are loaded for."""

    target: TaskCard
    """The target task, which names the teachers' terms, too, where their rewards are needed."""
    cards: tuple[TeacherCard, ...]
    """What their files say of them, (M,)."""
    teachers: tuple[Teacher, ...]
    """What the student learns from, (M,)."""
    networks: tuple[ActorCritic, ...]
    """What a student may start from, (M,)."""
    records: tuple[TeacherRecord, ...]
    """What run.json says of them, (M,)."""

    def to(self, device: str) -> "RunTeachers":
        """Return them with what acts and advises on a device."""
        moved = [replace(one, network=one.network.to(device)) for one in self.teachers]
        return replace(self, teachers=tuple(moved))


def load_teachers(
    files: Sequence[TeacherFile],
    acting: Sequence[TeacherFile] | None,
    task: TaskCard,
    spaces: Spaces,
    seeds: int,
    student_acts: bool = False,
) -> RunTeachers:
    """Load teachers for a task.

    Args:
        files: their files, with views.
        acting: those whose own samples are used; all of them where absent.
        task: the target task, with what the method leaves of its transfer settings.
        spaces: what its policies read and write.
        seeds: S.
        student_acts: whether the student acts in the teachers' iterations, and shares their steps.

    Raises:
        TeacherMismatch: a teacher does not fit the task, with a line for each.
        CardError: the number of teachers and the settings do not go together.
        NotFound: the task has no such view of a teacher.
        CheckpointError: a file is damaged.
    """
    cards = [read_card(file.path) for file in files]
    store.check_fits(cards, task, spaces)
    acts = [acting is None or file in acting for file in files]
    _check_numbers(task, len(files), sum(acts))
    _check_shares(task, sum(acts), student_acts)
    _check_relevance(task, spaces)
    _check_distillation(task)
    task = _with_terms_of(cards, task)
    views = [
        view_of(store.read_teacher(file.path, seeds)[0], card, file, task)
        for file, card in zip(files, cards, strict=True)
    ]
    each = list(zip(files, cards, acts, views, strict=True))
    return RunTeachers(
        task, tuple(cards),
        teachers=tuple(_teacher(card, view, act, task) for _, card, act, view in each),
        networks=tuple(view.network for view in views),
        records=tuple(_record(file, card, act) for file, card, act, _ in each),
    )  # fmt: skip


def _teacher(card: TeacherCard, view: View, acts: bool, task: TaskCard) -> Teacher:
    """Return what the student learns from; its weights are those of its view."""
    own = card.task.in_mirror(view.symmetry)
    if own is None:
        return Teacher(view.policy, acts)
    return Teacher(view.policy, acts, _weights(own, task))


def _record(file: TeacherFile, card: TeacherCard, acts: bool) -> TeacherRecord:
    """Return what run.json says of a teacher."""
    return TeacherRecord(
        name=store.name_of(file.path, card), view=file.view, sha256=sha256(file.path),
        instances=acts, file=str(file.path.absolute()),
    )  # fmt: skip


def _check_numbers(task: TaskCard, n_teachers: int, n_acting: int) -> None:
    betas, episodes = task.transfer.kickstart_coef, task.transfer.teacher_episodes
    if isinstance(betas, tuple) and len(betas) != n_teachers:
        raise CardError(
            f"expected one --beta, or one for each --teacher ({n_teachers}), found {len(betas)}"
        )
    if task.transfer.instance and not n_acting:
        raise CardError("expected at least one teacher to take instances from, found none")
    if task.transfer.instance and task.ppo.n_episodes and episodes < n_acting:
        raise CardError(
            f"expected transfer.teacher_episodes of at least {n_acting}, one for each teacher that "
            f"gives instances, found {episodes}; try --set transfer.teacher_episodes={n_acting}"
        )


def _check_shares(task: TaskCard, n_acting: int, student_acts: bool) -> None:
    """Check that each share of an iteration's steps is longer than an episode.

    Raises:
        CardError: a share is too short, and rollouts begin afresh.
    """
    if task.ppo.n_steps is None or task.ppo.n_episodes or not (task.transfer.instance and n_acting):
        return
    if task.continues_episodes:
        return
    sharing, need = n_acting + student_acts, task.env.longest_episode() + 1
    if task.ppo.n_steps // sharing < need:
        raise CardError(
            f"expected ppo.n_steps of at least {sharing * need}, which {sharing} share, each with "
            f"an episode of {need - 1} and a step; found {task.ppo.n_steps}"
        )


def _check_relevance(task: TaskCard, spaces: Spaces) -> None:
    """Check that there are distances between observations, by which relevance is judged.

    Raises:
        CardError: the observations are images.
    """
    if task.select.rule != "rbt" or not task.transfer.instance:
        return
    if spaces.image:
        raise CardError(f"expected vectors to observe with --select rbt, found {spaces}")


def _check_distillation(task: TaskCard) -> None:
    """Check that the policy alone can move, and mirror images of samples are as good as these.

    Raises:
        CardError: policy and critic share layers; or the task has no symmetry, or a reward term
            that changes sign in the mirror.
    """
    if not task.transfer.distill_epochs:
        return
    if task.net.shared:
        raise CardError(
            "transfer.distill_epochs moves the policy alone, and net.shared gives the critic its "
            "layers; leave out one of them"
        )
    if not task.transfer.distill_mirrored:
        return
    if not task.symmetries:
        raise CardError(
            f"transfer.distill_mirrored needs a symmetry, and task '{task.name}' has none; leave "
            "it out"
        )
    if changing := task.changing_terms(task.symmetries[0]):
        raise CardError(
            "transfer.distill_mirrored needs reward terms that stay the same in the mirror, and "
            f"{', '.join(changing)} of task '{task.name}' changes; leave it out"
        )


def _with_terms_of(cards: Sequence[TeacherCard], task: TaskCard) -> TaskCard:
    """Return the target with the teachers' terms too, where their own rewards are needed.

    That is for selection by relevance; terms that the target does not name weigh 0 in it.
    """
    if task.select.rule != "rbt" or not task.transfer.instance or task.reward_code:
        return task
    terms = {name for card in cards if not card.task.reward_code for name in card.task.reward}
    return task.naming(terms)


def _weights(own: TaskCard, task: TaskCard) -> np.ndarray | None:
    """Return w of a teacher's own task in the order of the target's terms, or None without one."""
    if own.reward_code or task.reward_code:
        return None
    return np.array(own.weights(task.reward))


def warm_start(student: ActorCritic, loaded: RunTeachers) -> None:
    """Put the first teacher's weights into every seed of the student.

    Raises:
        TeacherMismatch: the teacher's networks are others than the student's.
        CardError: log σ is to be set anew, and the actions are discrete.
    """
    task = loaded.target
    _check_same_networks(loaded.cards[0], task)
    name, log_std = loaded.cards[0].name, task.transfer.warm_start_log_std
    least = task.transfer.warm_start_min_std
    leaves = dict(weights.policy_tensors(loaded.networks[0], 0))
    own = weights.policy_tensors(student)
    if task.transfer.warm_start == "policy":
        leaves = {n: leaf for n, leaf in leaves.items() if not n.startswith("value.")}
        leaves |= {n: leaf.clone() for n, leaf in own.items() if n.startswith("value.")}
    if log_std is not None:
        if "policy.log_std" not in own:
            raise CardError("transfer.warm_start_log_std is for continuous actions; leave it out")
        leaves["policy.log_std"] = torch.full_like(own["policy.log_std"][0], log_std)
    if least and "policy.log_std" in own:
        leaves["policy.log_std"] = leaves["policy.log_std"].clamp(min=log(least))
    try:
        weights.load_policy(student, leaves, f"teacher '{name}'")
    except CheckpointError as error:
        raise TeacherMismatch(f"a warm start needs equal networks: {error}") from error


def _check_same_networks(card: TeacherCard, task: TaskCard) -> None:
    """Check what leaves of equal shapes do not show: activations, and how inputs are scaled.

    Raises:
        TeacherMismatch: such a setting differs.
    """
    if key := task.net.other_scaling(card.task.net):
        taught, wanted = (str(getattr(net, key)).lower() for net in (card.task.net, task.net))
        raise TeacherMismatch(
            f"a warm start needs equal networks: teacher '{card.name}' has net.{key} {taught}, "
            f"task '{task.name}' has {wanted}; try --set net.{key}={taught}"
        )
