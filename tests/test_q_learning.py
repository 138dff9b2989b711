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
from torch.testing import assert_close

from repaint_cli.errors import CardError
from repaint_cli.learn.evaluation import evaluate
from repaint_cli.learn.q_learning import (
    Experience,
    _experience,
    epsilon,
    epsilon_greedy,
    extended,
    q_loss,
    train,
)
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.tasks.transfer_settings import QLearningConfig

Q = {"memory": 500, "gradient_steps": 20, "epsilon_iterations": 2}


def learning(task, **settings):
    return task.model_copy(update={"q_learning": QLearningConfig(**Q | settings)})


def learn(task, learner, teachers=()):
    return train(task, learner, course_for(task, learner, teachers))


class Table:
    """Q by the number of the state, (states, actions), as a network would tell it."""

    def __init__(self, *rows):
        self.values = torch.tensor(rows, requires_grad=True)

    def q_values(self, obs, counts):
        return self.values[obs[..., 0].long()]


def experience(*rows, teacher=()):
    """Of (s, a, r, s′, terminated), one seed."""
    s, a, r, after, over = zip(*rows, strict=True)
    states = torch.arange(9.0).unsqueeze(1)
    who = torch.tensor([[i in teacher for i in range(len(rows))]])
    return Experience(
        Observations([states]), torch.tensor([s]), torch.tensor([after]), torch.tensor([a]),
        torch.tensor([r]), torch.tensor([over]), torch.tensor([len(rows)]), who,
    )  # fmt: skip


ROWS = [(0, 1, 1.0, 1, False), (1, 0, 2.0, 0, True)]
ONLINE, TARGET = ((1.0, 2.0), (3.0, 4.0)), ((5.0, 6.0), (7.0, 8.0))


def test_the_loss_by_hand():
    # y = 1 + 0.5·8 = 5 and 2; Q = 2 and 3: ½·(9 + 1)/2
    student = Table(*ONLINE)
    loss, kept, numbers = q_loss(student, Table(*TARGET), experience(*ROWS), 0.5, None)
    assert_close(loss.detach(), torch.tensor([2.5]))
    assert kept.tolist() == [2]
    assert_close(numbers["q_value"].detach(), torch.tensor([2.5]))
    loss.sum().backward()
    assert_close(student.values.grad, torch.tensor([[0.0, -1.5], [0.5, 0.0]]))


@pytest.mark.parametrize(
    ("teacher", "threshold", "loss", "kept"),
    [
        ((0, 1), 0.0, 4.5, 1),  # y − Q = 3 and −1
        ((0, 1), 3.0, 0.0, 0),  # not more than ζ
        ((1,), 0.0, 4.5, 1),
        ((0,), 0.0, 2.5, 2),  # the student's own are never left out
        ((0, 1), None, 2.5, 2),  # nor anybody's once the teacher has gone
    ],
)
def test_of_a_teachers_samples_those_above_zeta_count(teacher, threshold, loss, kept):
    batch = experience(*ROWS, teacher=teacher)
    found, counted, _ = q_loss(Table(*ONLINE), Table(*TARGET), batch, 0.5, threshold)
    assert_close(found.detach(), torch.tensor([loss]))
    assert counted.tolist() == [kept]


def test_epsilon_falls_in_a_straight_line_and_stays():
    config = QLearningConfig(first_epsilon=1.0, last_epsilon=0.2, epsilon_iterations=4)
    found = [epsilon(k, config) for k in range(1, 7)]
    assert found == pytest.approx([1.0, 0.8, 0.6, 0.4, 0.2, 0.2])


def test_epsilon_greedy_takes_the_best_and_otherwise_any():
    student = Table((1.0, 3.0, 2.0))
    obs = torch.zeros(1, 1, 1)
    chances = epsilon_greedy(student, 0.3)(obs, [1]).log_probs.exp()
    assert_close(chances.detach(), torch.tensor([[[0.1, 0.8, 0.1]]]))
    greedy = epsilon_greedy(student, 0.0)(obs, [1])
    noise = torch.from_numpy(greedy.noise(np.random.default_rng(0), (1, 1, 3)))
    assert greedy.sample(noise).item() == 1


def test_memory_keeps_each_seeds_newest_and_what_they_saw():
    task = guess(n_episodes=6)
    learner, kept, made = learner_of(task, [0, 1]), None, []
    for k in range(1, 6):
        rollout = learner.collect(task, k)
        made.append(_experience(task, rollout, from_teacher=k % 2 == 0))
        kept = extended(kept, [made[-1]], 60)
    whole = Experience.concatenate(made)
    assert kept.counts.tolist() == [60, 60]
    for s, n in enumerate(whole.counts.tolist()):
        for name in ("actions", "rewards", "terminations", "from_teacher"):
            assert torch.equal(getattr(kept, name)[s], getattr(whole, name)[s, n - 60 : n]), name
        for rows in ("rows", "next_rows"):
            seen = kept.observations.stores[s][getattr(kept, rows)[s]]
            expected = whole.observations.stores[s][getattr(whole, rows)[s, n - 60 : n]]
            assert torch.equal(seen, expected)
        assert len(kept.observations.stores[s]) < len(whole.observations.stores[s])


def test_a_time_limit_may_be_terminal():
    ends = []
    for limit in ("bootstrap", "terminal"):
        task = guess(n_episodes=40, time_limit=limit)
        rollout = learner_of(task, [0]).collect(task, 1)
        ends.append(_experience(task, rollout, from_teacher=False).terminations.sum())
        assert rollout.truncations[rollout.valid].any()
    assert ends[0] < ends[1] == 40


@pytest.mark.parametrize("image", [False, True])
def test_a_teacher_fills_the_memory_in_the_first_iterations_only(image):
    task = learning(guess(image=image, n_iterations=3))
    task = with_transfer(task, transfer_config(iterations=2))
    learner = learner_of(task, [0, 1])
    before = learner.student.storage.clone()
    stats = list(learn(task, learner, teachers_of(untrained_teacher(task, 2))))
    assert [stat.phase for stat in stats] == ["instance", "instance", "ppo"]
    assert "kept_fraction" in stats[0].metrics
    assert "kept_fraction" not in stats[2].metrics
    assert [stat.metrics["epsilon"][0] for stat in stats] == pytest.approx([1.0, 0.525, 0.05])
    cut = learner.student.n_policy
    assert not torch.equal(before[:, :cut], learner.student.storage[:, :cut])
    assert torch.equal(before[:, cut:], learner.student.storage[:, cut:])  # no critic is fitted


def test_q_learning_learns_to_guess():
    task = learning(guess(n_iterations=4, n_episodes=20, learning_rate=3e-3), gradient_steps=200)
    learner = learner_of(task, [0])
    list(learn(task, learner))
    played = evaluate(learner.student, task, [0], 20)
    assert played.returns.sum() / played.lengths.sum() > 0.95  # by chance a third


def test_the_same_seed_gives_the_same_bits_and_seeds_do_not_meet():
    task = learning(guess(), memory=20)
    ends = []
    for seeds in ([4, 7], [4, 7], [7]):
        learner = learner_of(task, seeds)
        list(learn(task, learner, teachers_of(untrained_teacher(task, len(seeds)))))
        ends.append(learner.student.storage.clone())
    assert torch.equal(ends[0], ends[1])
    assert_close(ends[0][1], ends[2][0], rtol=1e-4, atol=1e-6)


def test_teachers_share_the_steps_of_an_iteration_with_the_student():
    task = learning(guess().with_settings(["ppo.n_steps=140", "ppo.n_envs=4"]))
    task = task.model_copy(update={"ppo": task.ppo.model_copy(update={"n_episodes": None})})
    task = task.with_settings(["env.kwargs={}"])
    learner = learner_of(task, [0])
    list(learn(task, learner, teachers_of(untrained_teacher(task))))
    assert learner.env_steps == 2 * 140


def test_continuous_actions_are_refused():
    task = learning(reach())
    with pytest.raises(CardError, match="expected numbered actions for q-learning, found 2 obs"):
        next(learn(task, learner_of(task, [0])))


def test_evaluations_that_draw_actions_are_refused():
    task = learning(guess().with_settings(["eval.actions=sampled"]))
    with pytest.raises(CardError, match=r"expected eval\.actions 'likeliest' for q"):
        next(learn(task, learner_of(task, [0])))


def test_no_gradient_is_longer_than_the_card_says():
    norms = []
    for limit in (None, 1e-3):
        task = learning(guess(n_iterations=1, max_grad_norm=limit))
        learner = learner_of(task, [0, 1])
        list(learn(task, learner))
        norms.append(learner.student.gradients.norm(dim=1))
    assert (norms[0] > 1e-3).all()
    assert_close(norms[1], torch.full((2,), 1e-3), rtol=0.01, atol=0)
