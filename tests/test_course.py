"""A course of one's own: what each iteration does and how much teachers count, in one class."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from small_learners import (
    course_for,
    learner_of,
    teachers_of,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach

from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.ppo import train
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.courses import LEAST, Measured, Scheduled
from repaint_cli.learn.transfer.measurements import Measurements

TASKS = pytest.mark.parametrize("make", [reach, guess])


class EveryThird(Course):
    """Plain PPO, but every third iteration is of the teachers' samples, and the next is advised."""

    def phase(self, k):
        return ("representation", "ppo", "instance")[(k - 1) % 3]

    def betas(self, k):
        beta = 0.5 if self.after_instance else 0.0
        return torch.full((len(self.teachers), self.n_seeds), beta, dtype=torch.float64)


def courses(task, n_seeds=2):
    return EveryThird(task, teachers_of(untrained_teacher(task, n_seeds)), n_seeds)


@TASKS
def test_a_third_course_is_one_class(make):
    task = make(n_iterations=7, select={"rule": "all"})
    learner = learner_of(task, [0, 1])
    stats = list(train(task, learner, courses(task)))
    assert [stat.phase for stat in stats] == [
        "ppo", "ppo", "instance", "representation", "ppo", "instance", "representation",
    ]  # fmt: skip
    assert stats[3].metrics["kickstart_coef"].tolist() == [0.5, 0.5]
    assert stats[2].metrics["kept_fraction"].tolist() == [1.0, 1.0]
    assert torch.isfinite(learner.student.storage).all()


def test_a_third_course_goes_on_from_its_state_bit_for_bit():
    task, short = reach(n_iterations=6), reach(n_iterations=3)  # which is an instance iteration
    straight, halved = learner_of(task, [0, 1]), learner_of(task, [0, 1])
    list(train(task, straight, courses(task)))
    first, second = courses(task), courses(task)
    list(train(short, halved, first))
    second.load({name: tensor.clone() for name, tensor in first.state().items()})
    list(train(task, halved, second))
    assert torch.equal(straight.student.storage, halved.student.storage)
    np.testing.assert_array_equal(straight.env_steps, halved.env_steps)


@pytest.mark.parametrize(
    ("settings", "teachers", "kind"),
    [
        ({}, 1, Scheduled),
        ({"phases": "auto"}, 1, Measured),
        ({"kickstart_schedule": "auto"}, 2, Measured),
        ({"phases": "auto"}, 0, Scheduled),
    ],
)
def test_the_card_and_the_teachers_pick_the_course(settings, teachers, kind):
    task = with_transfer(reach(), transfer_config(**settings))
    measured = Measurements(np.zeros((1, 2)), [np.ones((1, 2))] * teachers) if teachers else None
    course = course_for(
        task, learner_of(task, [0]), teachers_of(*[untrained_teacher(task)] * teachers), measured
    )
    assert type(course) is kind


def test_a_course_without_teachers_is_over_and_asks_for_nothing():
    task = with_transfer(reach(), transfer_config(critic_warmup=3))
    course = course_for(task, learner_of(task, [0]))
    now = course.start(1)
    assert (now.phase, now.policy_scale, now.betas.shape) == ("ppo", 1.0, (0, 1))
    assert course.ended
    assert course.actors() == []


def measured_course(iterations=9, n_iterations=9):
    """The course of an automatic transfer from a teacher in the lead, and the episodes given it."""
    task = with_transfer(
        reach(n_iterations=n_iterations), transfer_config(phases="auto", iterations=iterations)
    )
    learner = learner_of(task, [0])
    measurements = Measurements(np.zeros((1, 2)), [np.array([[8.0, 9.0]])])
    course = course_for(task, learner, teachers_of(untrained_teacher(task)), measurements)
    return course, evaluate(learner.student, task, [0], 5)


def test_an_evaluation_counts_while_the_transfer_lasts():
    course, evaluation = measured_course(iterations=3)
    assert [course.after_evaluation(k, 10.0, evaluation) for k in (1, 2, 3)] == [2, 2, 0]
    assert not Scheduled(course.card, (), 1).after_evaluation(1, 10.0, evaluation)


def test_an_evaluation_costs_a_twentieth_of_an_iteration_or_two_episodes():
    course, evaluation = measured_course()
    length = evaluation.lengths.mean()
    assert course.after_evaluation(1, 20 * length * 3.5, evaluation) == 3
    assert course.after_evaluation(2, length, evaluation) == 2
    assert course.measurements.steps == pytest.approx(5 * length)


def test_once_measuring_has_cost_what_it_may_the_transfer_is_over():
    course, evaluation = measured_course()
    longer, _ = measured_course(n_iterations=10_000)
    for one in (course, longer):
        one.measurements.steps = LEAST + 1.0  # of the longer run less than a twentieth
        assert one.after_evaluation(1, 10.0, evaluation) == 2
    assert (course.ended, longer.ended) == (True, False)
    assert course.after_evaluation(2, 10.0, evaluation) == 0
    again = Measurements.of_state(course.measurements.state())
    assert again.ended  # also where the run goes on for longer


def test_who_draws_numbered_actions_is_measured_in_its_rollouts():
    task = with_transfer(
        guess(n_iterations=2), transfer_config(kickstart_schedule="auto", instance=0)
    )
    learner = learner_of(task, [0, 1])
    measurements = Measurements(np.zeros((2, 2)), [np.full((2, 2), 99.0)])
    course = course_for(task, learner, teachers_of(untrained_teacher(task, 2)), measurements)
    *_, last = train(task, learner, course)
    assert_allclose(measurements.student[0], last.rollout.mean_episodes()[0])
    assert not course.after_evaluation(1, 10.0, evaluate(learner.student, task, [0, 1], 2))
    again = course_for(task, learner, course.teachers, measurements)
    again.load({name: tensor.clone() for name, tensor in course.state().items()})
    assert again.by_rollouts
