"""A course of one's own: what each iteration does and how much teachers count, in one class."""

import numpy as np
import pytest
import torch
from small_learners import (
    course_for,
    learner_of,
    teachers_of,
    transfer_config,
    untrained_teacher,
    with_transfer,
)
from small_tasks import guess, reach

from repaint_cli.learn.ppo import train
from repaint_cli.learn.transfer.course import Course
from repaint_cli.learn.transfer.courses import Measured, Scheduled

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
    course = course_for(
        task, learner_of(task, [0]), teachers_of(*[untrained_teacher(task)] * teachers)
    )
    assert type(course) is kind


def test_a_course_without_teachers_is_over_and_asks_for_nothing():
    task = with_transfer(reach(), transfer_config(critic_warmup=3))
    course = course_for(task, learner_of(task, [0]))
    now = course.start(1)
    assert (now.phase, now.policy_scale, now.betas.shape) == ("ppo", 1.0, (0, 1))
    assert course.ended
    assert course.actors() == []


def test_a_measured_course_evaluates_students_and_teachers_once():
    task = with_transfer(reach(), transfer_config(phases="auto"))
    learner, teacher = learner_of(task, [0, 1]), untrained_teacher(task, 2)
    course, played = course_for(task, learner, teachers_of(teacher)), []

    def play(network):
        played.append(network)
        return np.full((2, 3), float(len(played)))

    for _ in range(2):
        course.begin(learner.student, play)
    assert played == [learner.student, teacher]
    assert course.betas(1).shape == (1, 2)


def test_an_evaluation_is_used_while_the_transfer_lasts():
    task = with_transfer(reach(), transfer_config(phases="auto", iterations=3))
    learner = learner_of(task, [0])
    course = course_for(task, learner, teachers_of(untrained_teacher(task)))
    course.begin(learner.student, lambda network: np.zeros((1, 3)))
    used = [course.after_evaluation(k, "ppo", 10.0, np.ones((1, 3))) for k in (1, 2, 3)]
    assert used == [True, True, False]
    assert not Scheduled(task, (), 1).after_evaluation(1, "ppo", 10.0, np.ones((1, 3)))
