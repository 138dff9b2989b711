from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal
from small_learners import (
    course_for,
    instances_from,
    learner_of,
    teachers_of,
    training,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach
from test_selection import batch

from repaint_cli.learn.ppo import train
from repaint_cli.learn.transfer.measurements import Measurements, mean_and_error
from repaint_cli.runs.plan import Plan
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import TransferConfig


def returns(*means, spread=0.0, n=4):
    """Evaluated returns (S, E) with these means and this standard error."""
    steps = np.array([-1.0, 1.0] * (n // 2))
    return np.array(means)[:, None] + spread * np.sqrt(n - 1) * steps


def measured(own=-10.0, taught=(-4.0,), spread=0.0):
    return Measurements(returns(own, spread=spread), [returns(t, spread=spread) for t in taught])


def after(found, *own, spread=0.0, steps=100.0):
    """Two evaluations alike: the student's return is the mean of the last two."""
    for _ in range(2):
        found.add_evaluation(returns(*own, spread=spread), steps)
    return found


def test_mean_and_error_by_hand():
    assert_allclose(mean_and_error(np.array([[1.0, 3.0], [2.0, 2.0]])), [[2, 2], [1, 0]])
    assert_array_equal(mean_and_error(np.array([[1.0]])), [[1], [1e30]])
    assert_allclose(mean_and_error(returns(5.0, spread=0.3)), [[5], [0.3]])


def test_beta_is_the_share_of_the_lead_over_a_random_policy_that_is_left():
    found = measured(own=-10, taught=(-4,))
    assert_allclose(found.betas(), [[1.0]])
    assert_allclose(after(found, -7.0).betas(), [[0.5]])
    assert_allclose(after(found, -3.0).betas(), [[0.0]])  # the student has passed it
    assert_allclose(after(found, -12.0).betas(), [[1.0]])  # and no more than 1


@pytest.mark.parametrize("shift", [-100.0, 0.0, 100.0])
def test_the_signs_of_returns_do_not_matter(shift):
    found = after(measured(own=shift, taught=(shift + 6,)), shift + 3)
    assert_allclose(found.betas(), [[0.5]])


def test_what_may_be_chance_is_no_lead():
    # J_T − J_S = 6, e_T = 1, e_S = 1: β = (6 − √2)/6
    found = measured(own=-10, taught=(-4,), spread=1.0)
    assert_allclose(found.betas(), [[1 - np.sqrt(2) / 6]])
    assert_allclose(after(found, -5.0, spread=1.0).betas(), [[0.0]])


def test_a_teacher_no_better_than_an_untrained_policy_has_no_beta():
    assert_array_equal(measured(own=-10, taught=(-12,)).betas(), [[0.0]])


def test_who_starts_from_a_teacher_is_as_good_as_it_and_learns_from_others_alone():
    taught = [returns(-4.0), returns(-6.0)]
    found = Measurements(returns(-10.0), taught, start=1)
    assert_allclose(found.betas(), [[(6 - 4) / 6 / 2], [0.0]])
    after(found, -9.0)  # it has become worse than what it began as
    again = Measurements.of_state(found.state())
    assert_allclose(again.betas(), [[5 / 6 / 2], [0.0]])


def test_a_difference_of_rounding_is_no_lead():
    assert_allclose(measured(own=-0.6000000000000003, taught=(-0.6,)).betas(), [[0.0]])


def test_a_teacher_who_leads_by_chance_has_no_beta_however_bad_the_student():
    found = after(measured(own=-10, taught=(-9.0,), spread=1.0), -14.0, spread=1.0)
    assert_array_equal(found.betas(), [[0.0]])
    found = after(measured(own=-10, taught=(-8.0,), spread=1.0), -14.0, spread=1.0)
    assert_array_equal(found.betas(), [[1.0]])


def test_episodes_of_a_rollout_count_where_a_seed_has_two():
    found = Measurements(returns(-10.0, -10.0), [returns(-4.0, -4.0)])
    found.add_rollout(np.array([0, 0, 1]), np.array([-8.0, -6.0, -4.0]))
    # J_S = -7, e_S = 1: (3 - 1)/6; the other seed stays at J_0
    assert_allclose(found.betas(), [[2 / 6, 1.0]])


def test_several_teachers_share_1_each_by_its_own_lead():
    found = after(measured(own=-10, taught=(-4, -7, -20)), -8.0)
    assert_allclose(found.betas(), np.array([[4 / 6], [1 / 3], [0]]) / 3)


def test_the_transfer_ends_when_two_own_iterations_in_a_row_had_no_beta():
    found = measured()
    for betas, ended in ((0, False), (1, False), (0, False), (0, True)):
        found.add_betas(np.array([[betas]]))
        assert found.ended == ended


def test_the_share_that_is_kept_by_hand():
    found = measured()
    found.add_advantages(batch([0.0, 1.0, 2.0, 3.0]))
    for advantages, share in (([5.0, 6.0], 1.0), ([-5.0, -6.0], 0.0), ([1.0, 2.0], 0.0)):
        assert found.shares(batch(advantages)).item() == pytest.approx(share, abs=0.02)
    # of quantiles from 0 to 3, half lie below 1.5: P(Â′ > Â) = (½ + 1)/2
    assert found.shares(batch([1.5, 9.0])).item() == pytest.approx(0.5, abs=0.02)


def test_nothing_is_kept_of_a_teacher_without_a_lead():
    found = measured()
    found.add_advantages(batch([0.0, 1.0]))
    found.add_betas(np.array([[0.0]]))
    assert found.shares(batch([])).item() == 0  # samples of those who do not lead are left out
    assert not found.instances_pay()


def test_instances_follow_while_somebody_leads_and_something_is_kept():
    found = measured()
    assert found.instances_pay()
    found.add_advantages(batch([0.0, 1.0]))
    found.shares(batch([2.0, 3.0]))
    assert found.instances_pay()
    found.shares(batch([-2.0, -3.0]))
    assert not found.instances_pay()


def test_all_that_was_measured_can_be_kept():
    found = after(measured(own=-10, taught=(-4, -5)), -7.0)
    found.add_advantages(batch([0.0, 1.0, 2.0]))
    found.add_betas(np.array([[0.5], [0.0]]))
    for state in (found.state(), (found.shares(batch([1.0])), found.state())[1]):
        again = Measurements.of_state({name: part.clone() for name, part in state.items()})
        assert again.state().keys() == state.keys()
        assert all(torch.equal(again.state()[name], part) for name, part in state.items())
    assert again.instances_pay() == found.instances_pay()


def automatic(task, **more):
    select = task.select.model_copy(update={"rule": "auto"})
    settings = {"kickstart_schedule": "auto", "phases": "auto", "iterations": 99}
    return with_transfer(task, transfer_config(**settings | more)).model_copy(
        update={"select": select}
    )


def course_with(task, learner, teachers, own, *taught):
    """The course of an automatic transfer that begins with these mean returns."""
    measurements = Measurements(returns(*own), [returns(*means) for means in taught])
    return course_for(task, learner, teachers, measurements)


@pytest.mark.parametrize("make", [reach, guess])
def test_a_teacher_in_the_lead_teaches_until_the_student_has_passed_it(make):
    task = automatic(make(n_iterations=9))
    learner = learner_of(task, [0, 1])
    course = course_with(
        task, learner, teachers_of(untrained_teacher(task, 2)), (0.0, 0.0), (6.0, 6.0)
    )
    history = []
    for stat in train(task, learner, course):
        history.append((stat.phase, stat.metrics.get("kickstart_coef", np.zeros(2)).tolist()))
        own = 0.0 if stat.iteration < 4 else 9.0
        course.measurements.add_evaluation(returns(own, own), stat.steps)
    phases = [phase for phase, _ in history]
    assert phases[0] == "representation"
    assert history[0][1] == [1, 1]
    assert "instance" in phases[1:4]
    assert "instance" not in phases[6:]
    assert phases[-1] == "ppo"
    assert history[-1][1] == [0, 0]


def test_a_teacher_that_never_leads_leaves_scratch_bit_for_bit():
    task = reach(n_iterations=4)
    scratch, taught = learner_of(task, [0]), learner_of(task, [0])
    course = course_with(
        automatic(task), taught, teachers_of(untrained_teacher(task)), (0.0,), (-6.0,)
    )
    list(training(task, scratch))
    stats = list(train(automatic(task), taught, course))
    assert torch.equal(scratch.student.storage, taught.student.storage)
    assert [stat.phase for stat in stats] == ["ppo"] * 4


def test_each_seed_has_a_beta_of_its_own_and_seeds_stay_apart():
    task = automatic(reach(n_iterations=1))
    learner, alone = learner_of(task, [0, 1]), learner_of(task, [1])
    course = course_with(
        task, learner, teachers_of(untrained_teacher(task, 2)), (0.0, 3.0), (6.0, 6.0)
    )
    course_alone = course_with(task, alone, teachers_of(untrained_teacher(task)), (3.0,), (6.0,))
    course.measurements.random = mean_and_error(returns(0.0, 0.0))
    course_alone.measurements.random = mean_and_error(returns(0.0))
    (stat,) = train(task, learner, course)
    list(train(task, alone, course_alone))
    assert_allclose(stat.metrics["kickstart_coef"], [1.0, 0.5])
    assert_allclose(learner.student.storage[1], alone.student.storage[0], rtol=1e-4, atol=1e-5)


def test_of_several_teachers_only_those_in_the_lead_give_samples():
    task = automatic(reach(n_iterations=1))
    learner = learner_of(task, [0, 1])
    both = teachers_of(untrained_teacher(task, 2, seed=5), untrained_teacher(task, 2, seed=6))
    course = course_with(task, learner, both, (0.0, 0.0), (6.0, 6.0), (-6.0, 6.0))
    course.measurements.add_betas(course.measurements.betas())
    course.measurements.quantiles[:] = -1e9  # everything surpasses the students'
    kept, _ = instances_from(task, learner, both, 2, course)
    assert kept.counts.tolist() == [36, 72]


@pytest.mark.parametrize("rule", ["zeta", "auto"])
def test_a_part_that_is_automatic_alone_ends_too(rule):
    task = reach(n_iterations=6, select={"rule": rule, "threshold": -1e9})
    task = with_transfer(task, transfer_config(phases="auto", iterations=99))
    learner = learner_of(task, [0])
    course = course_with(task, learner, teachers_of(untrained_teacher(task)), (0.0,), (-6.0,))
    stats = list(train(task, learner, course))
    assert course.ended
    assert {stat.phase for stat in stats[2:]} == {"ppo"}


def test_a_joint_transfer_ends():
    task = automatic(reach(n_iterations=4), joint=True)
    learner = learner_of(task, [0])
    course = course_with(task, learner, teachers_of(untrained_teacher(task)), (0.0,), (-6.0,))
    stats = list(train(task, learner, course))
    assert stats[-1].phase == "ppo"


def test_once_it_has_ended_alpha_1_scales_nothing():
    task = automatic(reach(n_iterations=3), alpha_1=0.1, alpha_power=0.5)
    scratch, taught = learner_of(task, [0]), learner_of(task, [0])
    course = course_with(task, taught, teachers_of(untrained_teacher(task)), (0.0,), (-6.0,))
    course.measurements.idle = 2
    list(training(reach(n_iterations=3), scratch))
    list(train(task, taught, course))
    assert torch.equal(scratch.student.storage, taught.student.storage)


def test_who_acts_and_how_much_depends_on_no_other_seed():
    task = automatic(reach(n_iterations=1))
    both = [untrained_teacher(task, 2, seed=5), untrained_teacher(task, 2, seed=6)]
    kept = []
    for leading in ([[True, False], [False, True]], [[True, False], [False, False]]):
        learner = learner_of(task, [0, 1])
        course = course_with(task, learner, teachers_of(*both), (0.0, 0.0), *[(6.0, 6.0)] * 2)
        course.measurements.leading = np.array(leading)
        course.measurements.quantiles[:] = -1e9
        kept.append(instances_from(task, learner, teachers_of(*both), 2, course)[0])
    assert kept[0].counts.tolist() == [36, 36]
    assert kept[1].counts.tolist() == [36, 0]
    assert torch.equal(kept[0].actions[0], kept[1].actions[0, :36])


@pytest.mark.parametrize(
    ("method", "algorithm", "automatic"),
    [
        ("repaint", "ppo", True),
        ("kickstart", "ppo", False),
        ("warm-start", "ppo", False),
        ("instance", "q-learning", False),
    ],
)
def test_what_is_not_used_is_not_measured(method, algorithm, automatic):
    settings = ["select.rule=auto", "transfer.phases=auto"]
    plan = Plan(reach().with_settings(settings), method, [0], Path(), algorithm=algorithm)
    assert plan.target.automatic == automatic


@pytest.mark.parametrize("method", ["scratch", "warm-start", "kickstart", "instance"])
def test_what_a_method_leaves_out_is_not_decided_either(method):
    auto = TransferConfig(kickstart_schedule="auto", phases="auto", alpha_power=0.5)
    left = METHODS[method].apply(auto)
    kickstart, instance = method == "kickstart", method == "instance"
    assert (left.kickstart_schedule == "auto") == kickstart
    assert (left.phases == "auto") == instance
    assert (left.alpha_power > 0) == (kickstart or instance)
