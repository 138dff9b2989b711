from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_learners import learner_of, trained, training, untrained_teacher, with_transfer
from small_tasks import guess, reach

from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.seeding import Purpose, env_seeds, generator
from repaint_cli.tasks.transfer_settings import TransferConfig

SEEDS = [0, 1, 2, 3, 4]
TASKS = {
    "steps": reach(n_iterations=3, select={"threshold": 0.5}),
    "episodes": guess(n_iterations=3, select={"threshold": 0.5}),
    "images": guess(image=True, n_iterations=3, select={"threshold": 0.5}),
}


def learned(task, seeds, joint=False):
    """Train with a teacher; return the weights, the evaluated returns and all numbers."""
    learner, stats = trained(task, seeds, untrained_teacher(task, len(seeds)), joint=joint)
    played = evaluate(learner.student, task, list(seeds), 5, iteration=3)
    return learner.student.storage.numpy(), played.returns, [stat.metrics for stat in stats]


@pytest.mark.parametrize("joint", [False, True], ids=["alternating", "joint"])
@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_a_seed_learns_the_same_alone_and_among_others(task, joint):
    together, returns, numbers = learned(task, SEEDS, joint)
    alone, alone_returns, alone_numbers = learned(task, [2], joint)
    assert_allclose(together[2], alone[0], rtol=0, atol=1e-5)
    assert_allclose(returns[2], alone_returns[0], atol=1e-4)
    for one, other in zip(numbers, alone_numbers, strict=True):
        assert one.keys() == other.keys()
        for name in one.keys() - {"steps_per_second"}:
            assert_allclose(one[name][2], other[name][0], rtol=1e-4, atol=1e-5, err_msg=name)


@pytest.mark.parametrize("kind", ["episodes", "images"])
def test_those_seeds_had_unequal_numbers_of_samples(kind):
    _, _, numbers = learned(TASKS[kind], SEEDS)
    for k in range(3):
        assert len(set(numbers[k]["env_steps"])) > 1
    kept = numbers[1]["kept_fraction"] * (numbers[1]["env_steps"] - numbers[0]["env_steps"])
    assert len(set(kept.round())) > 1


def test_seeds_differ():
    weights, returns, _ = learned(TASKS["steps"], SEEDS)
    for s in range(1, len(SEEDS)):
        assert (weights[s] != weights[0]).any()
        assert (returns[s] != returns[0]).any()


def test_a_generator_is_named_by_seed_purpose_and_iteration():
    names = list(product(SEEDS, Purpose, range(5)))
    first = {generator(*name).random() for name in names}
    assert len(first) == len(names)
    assert first == {generator(*name).random() for name in names}


def test_neighbouring_seeds_purposes_and_iterations_share_no_environment():
    every = [
        env_seed
        for purpose in Purpose
        for iteration in range(5)
        for env_seed in env_seeds(SEEDS, purpose, iteration, 8)
    ]
    assert len(set(every)) == len(every)
    assert all(0 <= env_seed < 2**31 for env_seed in every)


def test_a_seeds_environments_do_not_depend_on_its_neighbours_nor_on_their_number():
    together = np.reshape(env_seeds([3, 4, 5], Purpose.TRAIN, 7, 8), (3, 8))
    assert_array_equal(together[1], env_seeds([4], Purpose.TRAIN, 7, 8))
    assert_array_equal(together[1, :5], env_seeds([4], Purpose.TRAIN, 7, 5))


def test_methods_meet_the_same_evaluation_episodes():
    task = reach()
    scratch, _ = trained(task, [5, 6])
    taught, _ = trained(task, [5, 6], untrained_teacher(task, 2), kickstart_coef=9.0)
    one, other = (evaluate(learner.student, task, [5, 6], 4, 2) for learner in (scratch, taught))
    assert one.env_seeds == other.env_seeds
    assert (one.returns != other.returns).any()
    later = evaluate(scratch.student, task, [5, 6], 4, 3)
    assert not set(later.env_seeds) & set(one.env_seeds)


def test_evaluating_in_between_changes_no_bit_of_training():
    task = reach(n_iterations=3)
    watched = learner_of(task, [0])
    for stat in training(with_transfer(task, TransferConfig()), watched):
        evaluate(watched.student, task, [0], 4, stat.iteration)
    assert_array_equal(watched.student.storage, trained(task, [0])[0].student.storage)
