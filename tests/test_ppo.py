from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch
from small_learners import (
    course_for,
    instances_from,
    learner_of,
    spaces_of,
    teachers_of,
    trained,
    training,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach
from torch.testing import assert_close

from repaint_cli.errors import CardError, DivergedError
from repaint_cli.learn import learner as learner_module
from repaint_cli.learn.ppo import train
from repaint_cli.learn.rollout.gae import describe, to_samples
from repaint_cli.learn.transfer import course as course_module
from repaint_cli.learn.transfer.selection import moments
from repaint_cli.learn.transfer.teachers import soften
from repaint_cli.learn.update import epochs
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import TransferConfig

TASKS = pytest.mark.parametrize("make", [reach, guess])
NOTHING = 1e9
EVERYTHING = -1e9
TIMING = {"steps_per_second"}


def keeps(threshold, scale="teacher-batch"):
    return {"threshold": threshold, "scale": scale}


def whole(learner):
    """All that a learner is, copied."""
    parts = {"weights": learner.student.storage.clone()} | {
        name: part.clone() for name, part in learner.optimizer.state().items()
    }
    if learner.student.normalizer:
        parts["mean"] = learner.student.normalizer.mean.clone()
        parts["var"] = learner.student.normalizer.var.clone()
    return parts


def same(one, other):
    return one.keys() == other.keys() and all(torch.equal(one[k], other[k]) for k in one)


def stages(task, seeds=(0, 1), teacher=None, **transfer):
    """The learner at the start and after each iteration, and what was yielded."""
    task = with_transfer(task, transfer_config(**transfer))
    learner = learner_of(task, seeds)
    states, stats = [whole(learner)], []
    for stat in training(task, learner, teachers_of(teacher)):
        states.append(whole(learner))
        stats.append(stat)
    return states, stats


@TASKS
def test_a_teacher_that_contributes_nothing_is_ppo_bit_for_bit(make):
    task = make()
    alone, stats = trained(task)
    with_teacher, others = trained(
        task, teacher=untrained_teacher(task), kickstart_coef=0, instance=0
    )
    assert same(whole(alone), whole(with_teacher))
    for stat, other in zip(stats, others, strict=True):
        assert stat.phase == other.phase == "ppo"
        assert stat.metrics.keys() == other.metrics.keys()
        for name in stat.metrics.keys() - TIMING:
            np.testing.assert_array_equal(stat.metrics[name], other.metrics[name])


@TASKS
def test_repaint_without_instances_is_kickstart_bit_for_bit(make):
    task, transfer = make(), TransferConfig()
    ends = []
    for settings in (
        METHODS["kickstart"].apply(transfer),
        METHODS["repaint"].apply(transfer.model_copy(update={"instance": 0})),
    ):
        learner, _ = trained(task, teacher=untrained_teacher(task), **settings.model_dump())
        ends.append(whole(learner))
    assert same(*ends)
    assert not same(ends[0], whole(trained(task)[0]))


@TASKS
def test_a_threshold_nothing_reaches_takes_no_instance_step(make):
    task = make(select=keeps(NOTHING))
    (_, first, second), stats = stages(task, teacher=untrained_teacher(task, 2), kickstart_coef=0.2)
    assert [stat.phase for stat in stats] == ["representation", "instance"]
    assert same(first, second)
    np.testing.assert_array_equal(stats[1].metrics["kept_fraction"], [0, 0])
    assert np.isnan(stats[1].metrics["kept_reward"]).all()


@TASKS
def test_a_joint_update_that_kept_nothing_is_kickstart_bit_for_bit(make):
    task = make(select=keeps(NOTHING), compiled=False)
    joint, stats = trained(task, teacher=untrained_teacher(task), joint=True)
    assert stats[0].phase == "joint"
    kickstart = whole(trained(task, teacher=untrained_teacher(task), instance=0)[0])
    assert same({name: part for name, part in whole(joint).items() if name in kickstart}, kickstart)


@pytest.mark.parametrize("joint", [False, True])
def test_after_k_iterations_the_teacher_is_not_asked(joint):
    task, teacher = reach(n_iterations=4), untrained_teacher(reach())
    task = with_transfer(task, transfer_config(iterations=2, joint=joint))
    learner, phases = learner_of(task, [0]), []
    for stat in training(task, learner, teachers_of(teacher)):
        phases.append(stat.phase)
        if stat.iteration == 2:
            teacher.policy = None  # to be asked would be an error
            steps = learner.env_steps.copy()
    assert phases[2:] == ["ppo", "ppo"]
    assert learner.env_steps == steps + 2 * 72


@TASKS
@pytest.mark.parametrize("joint", [False, True])
def test_training_moves_the_student_and_leaves_the_teacher_alone(make, joint):
    task = make(select=keeps(EVERYTHING))
    teacher, twin = untrained_teacher(task), untrained_teacher(task)
    states, _ = stages(task, seeds=[0], teacher=teacher, joint=joint)
    for before, after in pairwise(states):
        assert not torch.equal(before["weights"], after["weights"])
    assert torch.equal(teacher.storage, twin.storage)
    assert not teacher.gradients.any()
    for name in ("mean", "var", "count"):
        assert torch.equal(getattr(teacher.normalizer, name), getattr(twin.normalizer, name))


@TASKS
def test_an_instance_iteration_moves_the_policy_and_neither_critic_nor_statistics(make):
    task = make(select=keeps(EVERYTHING))
    (_, before, after), stats = stages(task, teacher=untrained_teacher(task, 2))
    cut = learner_of(task, [0]).student.n_policy
    assert stats[1].phase == "instance"
    assert torch.equal(after["weights"][:, cut:], before["weights"][:, cut:])
    assert (after["weights"][:, :cut] != before["weights"][:, :cut]).any(1).all()
    assert torch.equal(after["mean"], before["mean"])
    assert torch.equal(after["var"], before["var"])


@TASKS
def test_an_instance_iteration_says_how_far_it_moved_the_policy(make):
    task = make(select=keeps(EVERYTHING))
    teacher = untrained_teacher(task, 2)
    moved = []
    for alpha_2 in (1.0, 0.1, 0.0):
        _, stats = trained(task, (0, 1), teacher, kickstart_coef=0.0, alpha_2=alpha_2)
        assert "instance_kl" not in stats[0].metrics
        moved.append(stats[1].metrics["instance_kl"])
    assert (moved[0] > 3 * moved[1]).all()
    assert (moved[1] > 0).all()
    assert (abs(moved[2]) < 1e-6).all()


def test_a_joint_iteration_takes_only_the_students_own_observations_into_its_statistics():
    task = reach(n_iterations=1, select=keeps(EVERYTHING))
    joint, _ = trained(task, teacher=untrained_teacher(task), joint=True)
    alone, _ = trained(task)
    assert torch.equal(joint.student.normalizer.mean, alone.student.normalizer.mean)
    assert torch.equal(joint.student.normalizer.count, alone.student.normalizer.count)


def folded(teacher):
    """The same teacher with its statistics folded into its first layer."""
    twin = ActorCritic(teacher.spaces, teacher.net, teacher.n_seeds)
    twin.storage.copy_(teacher.storage)
    mean, std = teacher.normalizer.mean.float(), teacher.normalizer.var.sqrt().float()
    weight = twin.weights["policy.0.weight"].data / std.unsqueeze(-1)
    twin.weights["policy.0.weight"].data.copy_(weight)
    twin.weights["policy.0.bias"].data -= (mean.unsqueeze(1) @ weight).squeeze(1)
    return twin


@pytest.mark.parametrize("joint", [False, True])
def test_the_teacher_reads_raw_observations_through_its_own_statistics(joint):
    task = reach(select=keeps(0.0))
    teacher = untrained_teacher(task)
    assert not torch.equal(folded(teacher).storage, teacher.storage)
    plain, other = (
        trained(task, teacher=t, joint=joint, kickstart_coef=3.0)[0].student.storage
        for t in (teacher, folded(teacher))
    )
    assert_close(plain, other, rtol=1e-4, atol=1e-5)


@TASKS
def test_the_same_seed_gives_the_same_bits_and_another_others(make):
    task = make(select=keeps(0.5))
    ends = [whole(trained(task, [seed], untrained_teacher(task))[0]) for seed in (3, 3, 4)]
    assert same(ends[0], ends[1])
    assert not torch.equal(ends[0]["weights"], ends[2]["weights"])


@TASKS
def test_training_in_two_sittings_is_training_in_one(make):
    teacher, transfer = untrained_teacher(make()), TransferConfig()
    once, _ = trained(make(n_iterations=4), teacher=teacher)
    twice = learner_of(make(), [0])
    for n_iterations, expected in ((2, [1, 2]), (4, [3, 4])):
        task = with_transfer(make(n_iterations=n_iterations), transfer)
        sitting = training(task, twice, teachers_of(teacher))
        assert [stat.iteration for stat in sitting] == expected
    assert same(whole(once), whole(twice))


def test_a_joint_iteration_learns_from_what_it_kept(batches_of):
    taught = batches_of("instance_loss")
    task = reach(n_iterations=1, n_epochs=1, select=keeps(0.5))
    learner, (stat,) = trained(task, teacher=untrained_teacher(task), joint=True)
    assert sum(int(batch.counts) for batch in taught) == round(
        72 * stat.metrics["kept_fraction"][0]
    )
    assert learner.env_steps == 2 * 72


@pytest.fixture
def collected(monkeypatch):
    """Have every rollout of the trainer noted."""
    rollouts, collect = [], learner_module.collect

    def spy(*args, **kwargs):
        rollouts.append(collect(*args, **kwargs))
        return rollouts[-1]

    monkeypatch.setattr(learner_module, "collect", spy)
    return rollouts


def test_the_critic_that_judges_the_teacher_has_judged_the_students_batch_too(collected):
    task = reach(n_iterations=1, learning_rate=0.05, select=keeps(0.5, "student-batch"))
    learner, teachers = learner_of(task, [0]), teachers_of(untrained_teacher(task))
    course = course_for(task, learner, teachers)
    list(train(task, learner, course))
    anew = to_samples(collected[0], learner.student.value, task.ppo)
    assert_close(course.last.moments, moments(anew))
    stale = to_samples(collected[0], learner_of(task, [0]).student.value, task.ppo)
    assert abs(course.last.moments[0] - moments(stale)[0]) > 0.1


def test_a_joint_iteration_judges_the_teacher_against_the_students_own_batch(monkeypatch):
    task, scales, rescale = reach(n_iterations=1), [], course_module.rescale

    def spy(samples, scale, student):
        scales.append(student)
        return rescale(samples, scale, student)

    monkeypatch.setattr(course_module, "rescale", spy)
    _, (stat,) = trained(task, teacher=untrained_teacher(task), joint=True)
    assert scales[0][0] != 0
    assert scales[0][1] != 1
    assert stat.metrics["student_reward"][0] < 0


@pytest.mark.parametrize("method", ["scratch", "warm-start"])
def test_alpha_1_leaves_methods_without_transfer_alone(method):
    assert METHODS[method].apply(TransferConfig(alpha_1=0.1)).alpha_1 == 1


def test_alphas_scale_the_learning_rates_of_their_own_iterations_until_k():
    task, scales = reach(n_iterations=4, n_epochs=1, minibatch_size=1000, compiled=False), []
    learner = learner_of(task, [0])
    step = learner.optimizer.step

    def note(policies, critics, scale, max_grad_norm):
        scales.append(scale)
        step(policies, critics, scale, max_grad_norm)

    learner.optimizer.step = note
    list(
        training(
            with_transfer(task, TransferConfig(iterations=3, alpha_1=3, alpha_2=5)),
            learner,
            teachers_of(untrained_teacher(task)),
        )
    )
    assert scales == [3, 5, 3, 1]


def test_every_iteration_draws_noise_and_orders_of_its_own(batches_of):
    batches = batches_of("representation_loss")
    trained(reach(n_epochs=1, minibatch_size=1000, learning_rate=1e-9, compiled=False))
    first, second = (batch.rows[0] for batch in batches)
    assert not torch.equal(first, second)
    noise = [batch.actions[0, batch.rows[0].argsort()] for batch in batches]  # the means are ≈ 0
    assert not torch.allclose(*noise, atol=0.1)


def test_the_first_ratio_is_one_and_advantages_have_mean_0_and_std_1(batches_of):
    batches = batches_of("representation_loss")
    task = reach(
        n_iterations=3, n_epochs=1, minibatch_size=1000, learning_rate=0.05, compiled=False
    )
    _, stats = trained(task, seeds=(0, 1))
    for stat, batch in zip(stats, batches, strict=True):
        assert_close(torch.from_numpy(stat.metrics["approx_kl"]), torch.zeros(2), atol=1e-6, rtol=0)
        np.testing.assert_array_equal(stat.metrics["clip_fraction"], [0, 0])
        assert_close(batch.advantages.mean(1), torch.zeros(2), atol=1e-6, rtol=0)
        assert_close(batch.advantages.std(1, correction=0), torch.ones(2))


def instances_of(task, teacher, learner=None, course=None, **transfer):
    task = with_transfer(task, TransferConfig(**transfer))
    learner = learner or learner_of(task, [0])
    found = instances_from(task, learner, teachers_of(teacher), 2, course)
    return *found, soften(teacher, task.transfer)


@pytest.mark.parametrize(
    ("make", "spread"), [(reach, {"teacher_min_std": 2.0}), (guess, {"teacher_temperature": 3.0})]
)
def test_teacher_samples_carry_the_softened_teachers_log_probs(make, spread):
    task = make(select=keeps(EVERYTHING))
    teacher = untrained_teacher(task)
    teacher.weights["policy.head.weight"].data *= 100  # so that a temperature matters
    kept, _, guide = instances_of(task, teacher, **spread)
    real = kept.mask
    expected = describe(guide, kept).log_prob(kept.actions)
    assert_close(kept.behavior_log_probs[real], expected[real])
    other = describe(teacher.policy, kept).log_prob(kept.actions)
    assert not torch.allclose(kept.behavior_log_probs[real], other[real], atol=0.01)


def test_the_softened_teacher_is_what_is_imitated(monkeypatch):
    task, seen, loss = reach(n_iterations=1, compiled=False), [], epochs.representation_loss

    def spy(student, batch, teacher, *rest):
        seen.append(teacher)
        return loss(student, batch, teacher, *rest)

    monkeypatch.setattr(epochs, "representation_loss", spy)
    trained(task, teacher=untrained_teacher(task), teacher_min_std=2.0)
    assert seen
    for teacher in seen:
        assert_close(teacher.log_std.exp(), torch.full((1, 1, 1), 2.0))


def test_teacher_samples_are_paid_by_the_target_task():
    cards = [reach(distance=w, select=keeps(EVERYTHING, "none")) for w in (1.0, -2.0)]
    (one, _, _), (other, _, _) = (instances_of(task, untrained_teacher(task)) for task in cards)
    assert torch.equal(one.actions, other.actions)
    assert_close(other.rewards, -2 * one.rewards)


def test_teacher_advantages_are_the_students_critics():
    # λ = 0, γ = 1, no terminations: a critic that says 1 more everywhere has the same TD errors
    task = reach(gamma=1.0, gae_lambda=0.0, select=keeps(EVERYTHING, "none"))
    learner, teacher = learner_of(task, [0]), untrained_teacher(task)
    teacher.weights["value.head.bias"].data += 50
    before, _, _ = instances_of(task, teacher, learner)
    learner.student.weights["value.head.bias"].data += 1.0
    after, _, _ = instances_of(task, teacher, learner)
    assert_close(after.advantages, before.advantages, atol=1e-5, rtol=0)
    assert_close(after.returns, before.returns + 1.0)


def test_what_was_kept_is_what_reaches_the_threshold():
    raw, _, _ = instances_of(
        task := reach(select=keeps(EVERYTHING, "none")), untrained_teacher(task)
    )
    zeta = raw.advantages.median().item()
    task = reach(select=keeps(zeta, "none"))
    kept, numbers, _ = instances_of(task, untrained_teacher(task))
    chosen = raw.advantages >= zeta
    assert torch.equal(kept.advantages[0], raw.advantages[chosen])
    assert numbers["kept_fraction"] == pytest.approx(chosen.float().mean().item())
    assert numbers["kept_advantage"] == pytest.approx(raw.advantages[chosen].mean().item())
    assert numbers["kept_reward"] == pytest.approx(raw.rewards[chosen].mean().item())


def test_kept_advantages_stay_on_the_scale_they_were_judged_on(batches_of):
    batches = batches_of("instance_loss")
    task = reach(select=keeps(0.5), n_epochs=1, minibatch_size=1000, compiled=False)
    trained(task, teacher=untrained_teacher(task))
    (batch,) = batches
    assert (batch.advantages >= 0.5).all()
    assert batch.advantages.mean() > 0.6


def test_the_students_batch_is_the_scale_where_the_card_says_so():
    task = reach(select=keeps(EVERYTHING, "student-batch"))
    learner, teacher = learner_of(task, [0]), untrained_teacher(task)
    raw, _, _ = instances_of(reach(select=keeps(EVERYTHING, "none")), teacher)
    course = course_for(task, learner, teachers_of(teacher))
    course.last = replace(course.last, moments=(torch.tensor([[1.0]]), torch.tensor([[4.0]])))
    scaled, _, _ = instances_of(task, teacher, learner, course)
    assert_close(scaled.advantages, (raw.advantages - 1) / 4)


def test_the_moments_remembered_are_those_of_the_students_last_own_batch():
    task = reach(n_iterations=2, select=keeps(EVERYTHING))
    learner = learner_of(task, [0])
    task = with_transfer(task, TransferConfig())
    course = course_for(task, learner, teachers_of(untrained_teacher(task)))
    remembered = [torch.cat(course.last.moments) for _ in train(task, learner, course)]
    assert torch.equal(remembered[0], remembered[1])
    assert not torch.equal(remembered[0], torch.tensor([[0.0], [1.0]]))


def test_numbers_of_an_iteration():
    task = reach(n_iterations=3, n_steps=64, select=keeps(0.5))
    _, stats = trained(task, seeds=(0, 1), teacher=untrained_teacher(task, 2), kickstart_decay=0.5)
    own, taught, again = (stat.metrics for stat in stats)
    for numbers in (own, taught, again):
        assert all(number.shape == (2,) for number in numbers.values())
    assert [stat.iteration for stat in stats] == [1, 2, 3]
    assert [numbers["env_steps"].tolist() for numbers in (own, taught, again)] == [
        [64, 64], [128, 128], [192, 192]
    ]  # fmt: skip
    np.testing.assert_allclose(own["kickstart_coef"], 0.2)
    np.testing.assert_allclose(again["kickstart_coef"], 0.05)
    np.testing.assert_array_equal(own["episode_length"], 8)
    assert (own["explained_variance"] <= 1).all()
    assert {"cross_entropy", "value_loss", "entropy"} <= own.keys() - taught.keys()
    assert {"kept_fraction", "kept_reward", "log_ratio"} <= taught.keys() - own.keys()
    per_step = own["episode_return"] / 8  # sixteen steps an environment are two whole episodes
    np.testing.assert_allclose(taught["student_reward"], per_step, rtol=1e-5)


def test_a_constant_critic_explains_nothing():
    task = guess(n_iterations=1, gamma=1e-6, gae_lambda=0.0, learning_rate=1e-12)
    learner = learner_of(task, [0])
    learner.student.weights["value.head.weight"].data.zero_()
    (stat,) = training(with_transfer(task, TransferConfig()), learner)
    assert stat.metrics["explained_variance"] == pytest.approx(0, abs=1e-4)


def test_teacher_episodes_are_a_number_of_their_own():
    task = guess(n_episodes=4)
    learner = learner_of(task, [0])
    steps = []
    for episodes in (1, 3):
        teach = task.with_settings([f"transfer.teacher_episodes={episodes}"])
        instances_from(teach, learner, teachers_of(untrained_teacher(task)), 2)
        steps.append(int(learner.env_steps[0]))
    assert steps[1] - steps[0] > steps[0]


def test_a_rollout_in_which_no_episode_can_end_is_refused():
    task = reach(n_steps=32, n_envs=4, continue_episodes=False)
    with pytest.raises(CardError, match=r"at least 9 .* found 32 / 4; try --set ppo.n_envs=3"):
        next(training(with_transfer(task, TransferConfig()), learner_of(task, [0])))


def test_weights_that_are_not_finite_name_their_seed():
    task = reach(n_epochs=1, minibatch_size=1000, compiled=False)
    learner = learner_of(task, [4, 7])
    learner.optimizer.step = lambda *args: learner.student.storage[1].fill_(float("inf"))
    with pytest.raises(DivergedError, match=r"iteration 1, seed 7: .* weights"):
        next(training(with_transfer(task, TransferConfig()), learner))


def test_spaces_are_those_of_the_card():
    assert spaces_of(reach()).obs_shape == (2,)
    assert spaces_of(guess(image=True)).image


CLIPPED = [{}, {"compiled": False}, {"stacked": False, "compiled": False}, {"objective": "trpo"}]


@pytest.mark.parametrize("joint", [False, True])
@pytest.mark.parametrize("ppo", CLIPPED, ids=str)
def test_no_gradient_is_longer_than_the_card_says(ppo, joint):
    longest = []
    for limit in (None, 1e-3):
        learner, _ = trained(
            reach(n_iterations=1, max_grad_norm=limit, **ppo), (0, 1),
            untrained_teacher(reach(), 2), joint=joint, instance=1,
        )  # fmt: skip
        cut, gradients = learner.student.n_policy, learner.student.gradients
        longest.append([half.norm(dim=1) for half in (gradients[:, :cut], gradients[:, cut:])])
    for free, scaled in zip(*longest, strict=True):
        assert (free > 1e-3).all()
        assert_close(scaled, torch.full((2,), 1e-3), rtol=0.01, atol=0)


def test_a_policy_that_shares_convolutions_is_scaled_down_with_all_that_it_uses():
    task = guess(image=True, n_iterations=1, max_grad_norm=1e-3)
    task = task.model_copy(update={"net": task.net.model_copy(update={"shared": True})})
    student = trained(task, (0, 1))[0].student
    policies = student.gradients[:, : student.n_policy].norm(dim=1)
    assert_close(policies, torch.full((2,), 1e-3), rtol=0.01, atol=0)


@TASKS
@pytest.mark.parametrize("compiled", [False, True])
def test_without_a_normaliser_networks_read_vectors_as_they_are(make, compiled, batches_of):
    task = make(compiled=compiled)
    net = task.net.model_copy(update={"obs_normalize": False, "obs_clip": 0.01, "obs_min_std": 9.0})
    task = task.model_copy(update={"net": net})
    batches = batches_of("representation_loss")
    learner, stats = trained(task, (0, 1))
    normalizer = learner.student.normalizer
    assert normalizer.mean.eq(0).all()
    assert normalizer.var.eq(1).all()
    assert normalizer.count.tolist() == [0, 0]
    assert normalizer.narrow_features() == {}
    assert torch.isfinite(learner.student.storage).all()
    if not compiled:  # the log-probabilities are of whoever acted: the first ratio is 1
        fresh = learner_of(task, [0, 1]).student
        old, batch = fresh.policy(batches[0].observations.take(batches[0].rows)), batches[0]
        assert_close(old.log_prob(batch.actions), batch.behavior_log_probs, rtol=0, atol=1e-5)
    assert stats[0].metrics["approx_kl"].max() < 0.5
