"""Everything that may be chosen about teachers and their samples, on tiny tasks."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal
from small_learners import (
    course_for,
    instances_from,
    learner_of,
    spec_of,
    teachers_of,
    trained,
    training,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach
from torch.testing import assert_close

from repaint_cli.learn import ppo as ppo_module
from repaint_cli.learn.rollout.batches import even_share
from repaint_cli.learn.rollout.gae import describe, to_samples
from repaint_cli.learn.transfer import instances as instances_module
from repaint_cli.learn.transfer.teachers import Teacher, advise
from repaint_cli.learn.update.objectives import instance_loss, representation_loss
from repaint_cli.policies.distributions import Gaussian
from repaint_cli.tasks.transfer_settings import SelectConfig

TASKS = pytest.mark.parametrize("make", [reach, guess])


def learned(task, teachers, seeds=(0, 1), **transfer):
    """Train to the end with teachers; return the weights and the numbers of each iteration."""
    task = with_transfer(task, transfer_config(**transfer))
    learner = learner_of(task, seeds)
    stats = list(training(task, learner, teachers))
    return learner.student.storage, [stat.metrics for stat in stats]


@TASKS
def test_two_teachers_that_are_one_are_one_teacher(make):
    task, teacher = make(n_iterations=1), untrained_teacher(make(), 2)
    one, _ = learned(task, teachers_of(teacher), kickstart_coef=0.4)
    two, _ = learned(task, teachers_of(teacher, teacher), kickstart_coef=(0.1, 0.3))
    assert_close(one, two, rtol=1e-4, atol=1e-6)
    even, _ = learned(task, teachers_of(teacher, teacher), kickstart_coef=0.4)
    assert_close(one, even, rtol=1e-4, atol=1e-6)


@TASKS
def test_a_teacher_with_beta_0_is_not_asked_for_advice(make):
    task = make(n_iterations=1)
    teacher, dumb = untrained_teacher(task, 2), untrained_teacher(task, 2)
    dumb.policy = None  # to be asked would be an error
    one, _ = learned(task, teachers_of(teacher), kickstart_coef=0.4)
    two, _ = learned(task, teachers_of(teacher, dumb), kickstart_coef=(0.4, 0.0))
    assert torch.equal(one, two)


@TASKS
@pytest.mark.parametrize("compiled", [True, False])
def test_several_teachers_are_their_weighted_cross_entropies(make, compiled):
    task = make(n_epochs=1, minibatch_size=1000, compiled=compiled)
    learner, teachers = (
        learner_of(task, [0]),
        [untrained_teacher(task, seed=seed) for seed in (5, 6)],
    )
    rollout = learner.collect(task, 1)
    samples = to_samples(rollout, learner.student.value, task.ppo)
    target = advise(teachers_of(*teachers), torch.tensor([[0.1], [0.3]]), samples, task.transfer)
    parts = [describe(teacher.policy, samples) for teacher in teachers]
    student = describe(learner.student.policy, samples)
    expected = sum(
        beta * part.cross_entropy(student) for beta, part in zip((0.1, 0.3), parts, strict=True)
    )
    assert_close(0.4 * target.cross_entropy(student), expected, rtol=1e-4, atol=1e-5)


@TASKS
def test_teachers_share_the_steps_or_episodes_of_one_and_act_apart(make):
    task = make(n_iterations=2, select={"rule": "all"})
    alone, _ = trained(task, [0], untrained_teacher(task), teacher_episodes=4)
    learner = learner_of(task, [0])
    settings = transfer_config(teacher_episodes=4)
    list(
        training(
            with_transfer(task, settings), learner, teachers_of(*[untrained_teacher(task)] * 2)
        )
    )
    if task.ppo.n_steps:
        assert_array_equal(learner.env_steps, alone.env_steps)
    two, _ = instances_from(
        with_transfer(task, settings), learner, teachers_of(*[untrained_teacher(task)] * 2), 2
    )
    seen = two.observations.take(two.rows)[0]
    half = len(seen) // 2
    assert not torch.equal(seen[:half], seen[half : 2 * half])
    assert not torch.equal(two.actions[0, :half], two.actions[0, half : 2 * half])


def test_what_is_shared_is_shared_evenly():
    assert [even_share(2048, i, 3) for i in range(3)] == [683, 683, 682]
    assert [even_share(2, i, 1) for i in range(1)] == [2]


def test_samples_of_several_teachers_are_scaled_together():
    task = reach(select={"rule": "all", "scale": "teacher-batch"})
    teachers = teachers_of(untrained_teacher(task, seed=1), untrained_teacher(task, seed=2))
    found, _ = instances_from(task, learner_of(task, [0]), teachers, 2)
    assert_close(found.advantages.mean(), torch.tensor(0.0), atol=1e-5, rtol=0)
    assert_close(found.advantages.std(correction=0), torch.tensor(1.0))
    halves = found.advantages[0].chunk(2)
    assert abs(halves[0].mean() - halves[1].mean()) > 1e-3


def test_only_those_who_act_give_instances():
    task = reach(select={"rule": "all"})
    loud, silent = untrained_teacher(task, seed=1), untrained_teacher(task, seed=2)
    both = [Teacher(loud), Teacher(silent, acts=False)]
    found, _ = instances_from(task, learner_of(task, [0]), both, 2)
    expected, _ = instances_from(task, learner_of(task, [0]), [Teacher(loud)], 2)
    assert torch.equal(found.actions, expected.actions)


def test_teachers_statistics_enter_the_students_normaliser_only_if_asked():
    task, counts = reach(), []
    for asked in (False, True):
        learner = learner_of(task, [0])
        taught = with_transfer(task, transfer_config(teacher_statistics=asked))
        kept, _ = instances_from(taught, learner, teachers_of(untrained_teacher(task)), 2)
        counts.append(int(learner.student.normalizer.count))
    assert counts == [0, kept.observations.sizes]


@TASKS
@pytest.mark.parametrize("rule", ["zeta", "abs", "top", "per", "all"])
def test_every_rule_trains(make, rule):
    task = make(select={"rule": rule, "threshold": 0.3, "share": 0.3})
    weights, numbers = learned(task, teachers_of(untrained_teacher(task, 2)))
    assert torch.isfinite(weights).all()
    kept = {"top": 0.3, "per": 0.3, "all": 1.0}.get(rule)
    if kept:
        assert numbers[1]["kept_fraction"] == pytest.approx(kept, abs=0.15)
    again, _ = learned(task, teachers_of(untrained_teacher(task, 2)))
    assert torch.equal(weights, again)


def test_relevance_needs_both_tasks_rewards_and_is_each_seeds_own():
    task = reach(n_iterations=3, select={"rule": "rbt", "share": 0.3})
    own, other = (np.array(weights) for weights in ((1.0, 0.0), (-1.0, 5.0)))
    runs = [
        learned(task, [Teacher(untrained_teacher(task, 2), weights=weights)], iterations=3)[0]
        for weights in (own, other)
    ]
    assert torch.isfinite(runs[0]).all()
    assert not torch.equal(*runs)
    alone, _ = learned(task, [Teacher(untrained_teacher(task, 1), weights=own)], [1], iterations=3)
    assert_close(alone[0], runs[0][1], rtol=1e-4, atol=1e-5)


@TASKS
@pytest.mark.parametrize("objective", ["clipped", "a2c", "trpo", "reinforce"])
@pytest.mark.parametrize("joint", [False, True])
def test_every_objective_trains(make, objective, joint):
    task = make(n_epochs=1, objective=objective)
    weights, numbers = learned(task, teachers_of(untrained_teacher(task, 2)), joint=joint)
    assert torch.isfinite(weights).all()
    assert np.isfinite(numbers[0]["policy_loss"]).all()
    usual, _ = learned(make(n_epochs=1), teachers_of(untrained_teacher(task, 2)), joint=joint)
    assert torch.allclose(weights, usual, atol=1e-6) == (objective == "clipped")


def test_trpos_instances_are_penalised_by_the_divergence_from_who_acted():
    task = reach(objective="trpo", kl_coef=2.0, kl_over="mean", select={"rule": "all"})
    learner, teachers = (
        learner_of(task, [0]),
        [untrained_teacher(task, seed=seed) for seed in (5, 6)],
    )
    kept, _ = instances_from(task, learner, teachers_of(*teachers), 2)
    loss, _ = instance_loss(learner.student, kept, spec_of(task.ppo))
    policy = learner.student.policy(kept.observations.take(kept.rows))
    half = int(kept.counts) // 2
    kl = []
    for teacher, own in zip(teachers, (slice(0, half), slice(half, None)), strict=True):
        theirs = teacher.policy(kept.observations.take(kept.rows))
        here = Gaussian(theirs.mean[:, own], theirs.log_std)
        ours = Gaussian(policy.mean[:, own], policy.log_std)
        both = [torch.distributions.Normal(g.mean, g.log_std.exp()) for g in (here, ours)]
        kl.append(torch.distributions.kl_divergence(*both).sum(-1))
    ratio = (policy.log_prob(kept.actions) - kept.behavior_log_probs).exp()
    expected = -(ratio * kept.advantages - 2 * torch.cat(kl, 1)).mean()
    assert_close(loss[0], expected, rtol=1e-4, atol=1e-5)


def test_instances_are_learned_on_the_scale_of_the_students_own():
    kept = {}
    for scale in ("selected", "raw", "student"):
        select = {"rule": "all", "scale": "teacher-batch", "loss_scale": scale}
        task = reach(select=select)
        learner = learner_of(task, [0])
        teachers = teachers_of(untrained_teacher(task))
        course = course_for(task, learner, teachers)
        course.last = replace(
            course.last, moments=(torch.full((1, 1), 3.0), torch.full((1, 1), 4.0))
        )
        kept[scale] = instances_from(task, learner, teachers, 2, course)[0].advantages
    assert_close(kept["student"], kept["raw"] / 4)
    centred = kept["raw"] - kept["raw"].mean()
    assert_close(kept["selected"], centred / centred.std(correction=0), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(("least", "learns"), [(72, True), (73, False)])
def test_on_fewer_samples_than_the_least_no_step_is_taken(least, learns):
    task = reach(n_epochs=1, n_iterations=2, select={"rule": "all", "min_samples": least})
    learner, teachers = learner_of(task, [0]), teachers_of(untrained_teacher(task))
    steps = [learner.optimizer.steps[0].item() for _ in training(task, learner, teachers)]
    assert (steps[1] > steps[0]) == learns


def test_at_the_old_policy_every_objective_has_ppos_gradient():
    slopes = []
    for objective in ("clipped", "a2c", "trpo"):
        task = reach(objective=objective)
        learner = learner_of(task, [0])
        rollout = learner.collect(task, 1)
        samples = to_samples(rollout, learner.student.value, task.ppo)
        samples = replace(samples, behavior=describe(learner.student.policy, samples))
        learner.student.gradients.zero_()
        loss, _ = representation_loss(learner.student, samples, None, spec_of(task.ppo))
        loss.sum().backward()
        slopes.append(learner.student.gradients.clone())
    assert_close(slopes[0], slopes[1], rtol=1e-4, atol=1e-6)
    assert_close(slopes[0], slopes[2], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("compiled", [True, False])
@TASKS
def test_while_the_critic_learns_alone_no_policy_moves(make, compiled):
    task = make(n_iterations=1, compiled=compiled)
    learner = learner_of(task, [0, 1])
    before, cut = learner.student.storage.clone(), learner.student.n_policy
    taught = with_transfer(task, transfer_config(critic_warmup=1))
    (stat,) = training(taught, learner, teachers_of(untrained_teacher(task, 2)))
    after = learner.student.storage
    assert stat.phase == "critic"
    assert torch.equal(before[:, :cut], after[:, :cut])
    assert not torch.equal(before[:, cut:], after[:, cut:])
    assert "value_loss" in stat.metrics
    assert "policy_loss" not in stat.metrics


@TASKS
def test_by_hand_and_as_written_agree_on_the_critic_first(make):
    ends = [
        learned(
            make(n_iterations=1, compiled=compiled, advantages="after"),
            teachers_of(untrained_teacher(make(), 2)),
        )
        for compiled in (True, False)
    ]
    (fast, compiled), (plain, as_written) = ends
    assert_close(fast, plain, rtol=1e-3, atol=1e-5)
    assert compiled[0].keys() == as_written[0].keys()


def test_advantages_after_the_critics_fit_are_other_advantages():
    both = [learned(reach(n_iterations=1, advantages=when), ())[0] for when in ("before", "after")]
    cut = learner_of(reach(), [0]).student.n_policy
    assert not torch.equal(both[0][:, :cut], both[1][:, :cut])
    assert_close(both[0][:, cut:], both[1][:, cut:])  # the critic's fit is the same


def test_whole_episodes_are_cut_to_the_steps_asked_for_once_advantages_are_known(monkeypatch):
    batches, update = [], ppo_module.update

    def spy(student, optimizer, batch, *args, **kwargs):
        batches.append(batch)
        return update(student, optimizer, batch, *args, **kwargs)

    monkeypatch.setattr(ppo_module, "update", spy)
    task = reach(n_iterations=1, n_steps=70, n_envs=1, whole_episodes=True, minibatch_size=1000)
    learner = learner_of(task, [0])
    (stat,) = training(task, learner)
    assert learner.env_steps == 72  # nine episodes of eight
    assert stat.rollout.truncations[stat.rollout.valid].sum() == 9
    assert batches[0].counts.tolist() == [70]
    assert abs(batches[0].advantages.mean()) > 1e-6  # standardised over all 72
    kept, _ = instances_from(
        task.model_copy(update={"select": SelectConfig(rule="all")}), learner,
        teachers_of(untrained_teacher(task)), 2,
    )  # fmt: skip
    assert kept.counts.tolist() == [70]


def test_where_episodes_are_counted_nothing_is_cut():
    ends = [
        learned(guess(n_iterations=1, n_episodes=9, n_steps=10, whole_episodes=whole), ())[0]
        for whole in (False, True)
    ]
    assert torch.equal(*ends)


def test_a_joint_update_after_the_critics_fit_judges_everybody_by_the_fitted_critic(monkeypatch):
    judged, estimate = [], instances_module.to_samples

    def spy(rollout, value, ppo):
        judged.append(value.__self__.storage.clone())
        return estimate(rollout, value, ppo)

    monkeypatch.setattr(instances_module, "to_samples", spy)
    task = reach(n_iterations=1, advantages="after", compiled=False, select={"rule": "all"})
    taught = with_transfer(task, transfer_config(joint=True))
    learner = learner_of(taught, [0])
    before, cut = learner.student.storage.clone(), learner.student.n_policy
    list(training(taught, learner, teachers_of(untrained_teacher(task))))
    (at,) = judged
    assert torch.equal(at[:, :cut], before[:, :cut])
    assert not torch.equal(at[:, cut:], before[:, cut:])
    assert torch.equal(at[:, cut:], learner.student.storage[:, cut:])


@pytest.mark.parametrize("compiled", [True, False])
def test_alphas_are_the_policies_own_and_leave_critics_their_rate(compiled):
    task = reach(n_iterations=1, compiled=compiled)
    ends = [
        learned(task, teachers_of(untrained_teacher(task, 2)), alpha_1=alpha, kickstart_coef=0.0)[0]
        for alpha in (1.0, 0.1)
    ]
    cut = learner_of(task, [0]).student.n_policy
    assert not torch.equal(ends[0][:, :cut], ends[1][:, :cut])
    assert torch.equal(ends[0][:, cut:], ends[1][:, cut:])


def test_epsilon_and_the_learning_rate_fall_during_training():
    task = reach(n_iterations=3, clip_decay=2, learning_rate_decay=2)
    learner = learner_of(task, [0])
    ends = [learner.student.storage.clone() for _ in training(task, learner)]
    assert not torch.equal(ends[0], ends[1])
    assert torch.equal(ends[1], ends[2])  # at a step size of 0
