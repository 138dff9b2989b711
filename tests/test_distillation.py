"""Epochs of the cross-entropy alone, after the first update with a teacher."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from small_learners import (
    learner_of,
    teachers_of,
    training,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_symmetries import GUESS, GUESS_PICTURES, REACH
from small_tasks import guess, reach

from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.errors import CardError
from repaint_cli.learn.rollout.gae import describe, to_samples
from repaint_cli.learn.transfer.courses import Scheduled
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.learn.update.update import update
from repaint_cli.policies.parameters import orthogonal
from repaint_cli.runs.teachers import _check_distillation

TASKS = {
    "reach": (reach, REACH),
    "guess": (guess, GUESS),
    "pictures": (partial(guess, image=True), GUESS_PICTURES),
    "as written": (partial(reach, compiled=False), REACH),
}
KICKSTART = {"kickstart_coef": 0.2, "instance": 0, "iterations": 1}
SEEDS = (0, 1)


def decided_teacher(task):
    """A teacher that does different things in different states."""
    teacher = untrained_teacher(task, len(SEEDS))
    rng = np.random.default_rng(3)
    head = teacher.weights["policy.head.weight"]
    head.data.copy_(torch.from_numpy(orthogonal(rng, head.shape[1:], 2.0)).expand_as(head))
    return teacher


def learned(task, teacher, n_iterations=1, **transfer):
    """Train with a teacher; return the learner and the statistics of each iteration."""
    task = with_transfer(task, transfer_config(**KICKSTART | transfer))
    task = task.with_settings([f"ppo.n_iterations={n_iterations}"])
    learner = learner_of(task, SEEDS)
    return learner, list(training(task, learner, teachers_of(teacher)))


def gap(learner, teacher, obs):
    """KL(T‖π) at observations, each seed's mean."""
    with torch.no_grad():
        own, advice = (network.policy(obs) for network in (learner.student, teacher))
        return (advice.cross_entropy(own) - advice.entropy()).mean(1)


def seen(task):
    """Observations of a task, (S, B, *O), as networks read them."""
    env = task.make_env(40)
    obs = torch.from_numpy(env.reset(seed=list(range(40)))[0])
    return torch.stack([obs if obs.dtype == torch.uint8 else obs.float()] * len(SEEDS))


@pytest.mark.parametrize("name", TASKS)
def test_a_student_comes_near_its_teacher_and_its_critic_stays(name):
    task = TASKS[name][0]()
    teacher, obs = decided_teacher(task), seen(task)
    plain, _ = learned(task, teacher)
    distilled, (stats,) = learned(task, teacher, distill_epochs=60, distill_minibatch=16)
    assert (gap(distilled, teacher, obs) < 0.5 * gap(plain, teacher, obs)).all()
    cut = plain.student.n_policy
    assert torch.equal(plain.student.storage[:, cut:], distilled.student.storage[:, cut:])
    assert (stats.metrics["distill_cross_entropy"] > 0).all()


def test_it_happens_once():
    task, teacher = reach(), decided_teacher(reach())
    _, every = learned(task, teacher, 3, iterations=3, distill_epochs=2)
    assert ["distill_cross_entropy" in stats.metrics for stats in every] == [True, False, False]
    _, every = learned(task, teacher, 3, iterations=3, distill_epochs=2, critic_warmup=1)
    assert ["distill_cross_entropy" in stats.metrics for stats in every] == [False, True, False]


def test_without_epochs_or_advice_nothing_changes():
    task, teacher = reach(), decided_teacher(reach())
    plain, _ = learned(task, teacher)
    none, _ = learned(task, teacher, distill_epochs=0)
    assert torch.equal(plain.student.storage, none.student.storage)
    alone, _ = learned(task, teacher, kickstart_coef=0.0)
    silent, (stats,) = learned(task, teacher, kickstart_coef=0.0, distill_epochs=9)
    assert torch.equal(alone.student.storage, silent.student.storage)
    assert "distill_cross_entropy" not in stats.metrics


@pytest.mark.parametrize("name", TASKS)
def test_mirror_images_of_samples_make_a_student_symmetric(name, monkeypatch):
    make, symmetry = TASKS[name]
    monkeypatch.setattr(GymnasiumSimulator, "symmetries", lambda _: (symmetry,))
    task = make()
    teacher, obs = decided_teacher(task), seen(task)

    def asymmetry(learner):
        with torch.no_grad():
            here = learner.student.policy(obs).mirrored(symmetry.actions)
            there = learner.student.policy(symmetry.observe(obs))
            return (here.cross_entropy(there) - here.entropy()).mean(1)

    epochs = {"distill_epochs": 60, "distill_minibatch": 16}
    as_it_is, _ = learned(task, teacher, **epochs)
    both, _ = learned(task, teacher, **epochs, distill_mirrored=True)
    assert asymmetry(both).mean() < 0.4 * asymmetry(as_it_is).mean()


def test_a_seed_without_advice_is_left_alone(monkeypatch):
    """As where β is measured, and the teacher leads one of the students only."""
    task, teacher = reach(), decided_teacher(reach())
    monkeypatch.setattr(
        Scheduled, "betas", lambda *_: torch.tensor([[0.2, 0.0]], dtype=torch.float64)
    )
    plain, _ = learned(task, teacher)
    one, (stats,) = learned(task, teacher, distill_epochs=5)
    assert np.isnan(stats.metrics["distill_cross_entropy"]).tolist() == [False, True]
    assert torch.equal(plain.student.storage[1], one.student.storage[1])
    assert not torch.equal(plain.student.storage[0], one.student.storage[0])


@pytest.mark.parametrize("objective", ["a2c", "trpo"])
def test_other_objectives_distil_the_same_loss(objective):
    task = reach(objective=objective)
    teacher, obs = decided_teacher(task), seen(task)
    plain, _ = learned(task, teacher)
    distilled, _ = learned(task, teacher, distill_epochs=60, distill_minibatch=16)
    assert (gap(distilled, teacher, obs) < 0.5 * gap(plain, teacher, obs)).all()


def test_the_loss_is_the_cross_entropy_whatever_the_ratio():
    """Its slope stays finite where the student has left the actions of the samples far behind."""
    task, teacher = reach(compiled=False), decided_teacher(reach())
    learner = learner_of(task, SEEDS)
    samples = to_samples(learner.collect(task, 1), learner.student.value, task.ppo)
    samples = replace(samples, behavior_log_probs=samples.behavior_log_probs - 200.0)
    advice = describe(teacher.policy, samples)
    spec = UpdateSpec(task.ppo, 0.2, loss="distillation", networks="policy", teacher=advice)
    metrics = update(learner.student, learner.optimizer, samples, spec, learner.shuffles(1))
    assert list(metrics) == ["cross_entropy"]
    assert np.isfinite(metrics["cross_entropy"]).all()


def test_layers_that_the_critic_shares_are_not_distilled():
    task = with_transfer(guess(image=True), transfer_config(distill_epochs=1))
    task = task.with_settings(["net.shared=true"])
    with pytest.raises(CardError, match=r"net\.shared gives the critic its layers; leave out one"):
        _check_distillation(task)


def test_mirror_images_need_a_symmetry_that_keeps_the_reward(monkeypatch):
    task = reach(effort=0.5)
    task = with_transfer(task, transfer_config(distill_epochs=1, distill_mirrored=True))
    with pytest.raises(CardError, match="needs a symmetry, and task 'reach' has none; leave it"):
        _check_distillation(task)
    odd = replace(REACH, odd=frozenset({"effort", "other"}))
    monkeypatch.setattr(GymnasiumSimulator, "symmetries", lambda _: (odd,))
    with pytest.raises(CardError, match="and effort of task 'reach' changes; leave it out"):
        _check_distillation(task)
    monkeypatch.setattr(GymnasiumSimulator, "symmetries", lambda _: (REACH,))
    _check_distillation(task)
