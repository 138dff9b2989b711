"""Does it learn? Answered by permutation tests over seeds that train side by side."""

import numpy as np
import pytest
from small_learners import learner_of, teachers_of, training, with_transfer
from small_tasks import reach

from repaint_cli.learn.evaluation import evaluate
from repaint_cli.policies import weights
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.methods import METHODS
from repaint_cli.tasks.transfer_settings import TransferConfig

SEEDS = list(range(8))
TRANSFER = TransferConfig(kickstart_coef=1.0, teacher_min_std=0.4)
LONG = {"n_steps": 288, "n_envs": 8, "n_epochs": 6, "learning_rate": 3e-3}


def permutation_p(better, worse, draws=10_000):
    """How often a random split of the pooled numbers has a mean as much higher as this one."""
    pool, n = np.concatenate([better, worse]), len(better)
    splits = np.random.default_rng(0).permuted(np.tile(pool, (draws, 1)), axis=1)
    gaps = splits[:, :n].mean(1) - splits[:, n:].mean(1)
    return (1 + np.sum(gaps >= np.mean(better) - np.mean(worse) - 1e-12)) / (1 + draws)


def learned(n_iterations, seeds=SEEDS, teacher=None, transfer=TRANSFER, **weights):
    """Train on Reach; return the student, what was yielded, and evaluated returns (k + 1, S)."""
    task = with_transfer(reach(n_iterations=n_iterations, **LONG, **weights), transfer)
    learner = learner_of(task, seeds)
    stats, returns = [], [evaluate(learner.student, task, seeds, 10).returns.mean(1)]
    for stat in training(task, learner, teachers_of(teacher)):
        stats.append(stat)
        returns.append(evaluate(learner.student, task, seeds, 10).returns.mean(1))
    return learner.student, stats, np.array(returns)


@pytest.fixture(scope="module")
def scratch():
    return learned(4)


@pytest.fixture(scope="module")
def teacher():
    """One who learned the same with costs for effort, and stands before each student."""
    student, _, returns = learned(12, seeds=[100], effort=0.2)
    assert returns[-1] > -3
    many = ActorCritic(student.spaces, student.net, len(SEEDS))
    weights.load_policy(many, weights.policy_tensors(student, 0), "the teacher")
    return many


def test_permutation_p_by_hand():
    # one split of twenty is as good; equal numbers are no evidence at all
    assert permutation_p([4, 5, 6], [1, 2, 3]) == pytest.approx(1 / 20, abs=0.01)
    assert permutation_p([1, 1, 1], [1, 1, 1]) == 1


def test_ppo_learns_to_reach(scratch):
    _, _, returns = scratch
    assert permutation_p(returns[-1], returns[0]) < 0.01
    assert returns[-1].mean() - returns[0].mean() > 3  # of −8 for staying and −1.2 for the best


def test_the_critic_learns_what_to_expect(scratch):
    _, stats, _ = scratch
    first, last = (stats[k].metrics["explained_variance"] for k in (0, -1))
    assert permutation_p(last, first) < 0.01
    assert last.mean() > 0.5


@pytest.mark.parametrize("method", ["kickstart", "repaint", "repaint-joint"])
def test_a_good_teacher_saves_iterations(method, scratch, teacher):
    _, _, alone = scratch
    _, _, taught = learned(2, teacher=teacher, transfer=METHODS[method].apply(TRANSFER))
    assert permutation_p(taught[2], alone[2]) < 0.01
    assert taught[2].mean() - alone[2].mean() > 0.5


def test_instances_of_a_good_teacher_help_on_their_own(teacher):
    transfer = METHODS["instance"].apply(TRANSFER)
    _, stats, taught = learned(2, teacher=teacher, transfer=transfer)
    assert [stat.phase for stat in stats] == ["ppo", "instance"]
    assert permutation_p(taught[2], taught[1]) < 0.01
    assert taught[2].mean() - taught[1].mean() > 1
