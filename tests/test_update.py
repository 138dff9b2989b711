from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from small_learners import learn_from_instances, learn_on_policy, spec_of
from torch.testing import assert_close

from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.batches import front
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.update import epochs
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.compiled import update as compiled
from repaint_cli.learn.update.epochs import minibatch, shuffle
from repaint_cli.learn.update.means import Means
from repaint_cli.learn.update.objectives import instance_loss, masked_mean, representation_loss
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.distributions import Gaussian
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import PPOConfig

PPO = PPOConfig(
    compiled=False, n_epochs=2, minibatch_size=4, learning_rate=1e-2, ent_coef=0.03, vf_coef=0.7
)
NAN = float("nan")


def drawn(n_seeds=1):
    student = ActorCritic(Spaces((3,), 2, discrete=False), NetConfig(hidden=(8,)), n_seeds)
    student.initialize([np.random.default_rng(s) for s in range(n_seeds)])
    return student


def optimizer_of(student):
    return RowAdam(student, PPO.learning_rate)


def joint_optimizer(student):
    return RowAdam(student, PPO.learning_rate, joint=True)


def generators(n=1):
    return [np.random.default_rng(s) for s in range(n)]


def samples_of(*counts, seed=0):
    """Samples of S seeds; observation i of each seed starts with the number i / 10."""
    rng, longest = np.random.default_rng(seed), max(counts)

    def draw(*shape):
        return torch.from_numpy(rng.normal(size=(len(counts), longest, *shape)).astype(np.float32))

    obs = draw(3)
    obs[..., 0] = torch.arange(longest) / 10
    return Samples(
        observations=Observations(list(obs)),
        rows=torch.arange(longest).repeat(len(counts), 1),
        actions=draw(2),
        behavior_log_probs=draw() / 5 - 3,
        advantages=draw(),
        returns=draw(),
        rewards=draw(),
        counts=torch.tensor(counts),
    )


def teacher_at(samples, seed=7):
    torch.manual_seed(seed)
    return Gaussian(torch.randn(*samples.rows.shape, 2), torch.randn(len(samples.rows), 1, 2) / 3)


def everything(student, optimizer):
    """Weights, moments and step counts, copied."""
    state = {name: part.clone() for name, part in optimizer.state().items()}
    return {"weights": student.storage.clone()} | state


def visited(batches, s):
    """Which samples of a seed each batch held."""
    return [batch.rows[s, : batch.counts[s]].tolist() for batch in batches]


def test_masked_mean_by_hand():
    numbers = torch.tensor([[1.0, 3.0, 5.0], [2.0, 4.0, 99.0], [99.0, 99.0, 99.0]])
    means = masked_mean(numbers, torch.tensor([3, 2, 0]))
    assert_close(means, torch.tensor([3.0, 3.0, 0.0]))
    assert_close(masked_mean(torch.zeros(2, 0), torch.tensor([0, 0])), torch.zeros(2))


def test_row_adam_is_adam():
    student, twin = drawn(), drawn()
    ours = optimizer_of(student)
    theirs = torch.optim.Adam([*twin.weights.values()], PPO.learning_rate, eps=1e-5)
    for seed in range(5):
        obs = torch.from_numpy(np.random.default_rng(seed).normal(size=(1, 6, 3))).float()
        for network in (student, twin):
            network.gradients.zero_()
            policy = network.policy(obs)
            (policy.mean**2 + network.value(obs).unsqueeze(-1) + policy.log_std).sum().backward()
        ours.step([True], [True])
        theirs.step()
    assert_close(student.storage, twin.storage)
    assert not torch.equal(student.storage, drawn().storage)


def test_what_is_left_out_of_a_step_does_not_move_nor_do_its_moments():
    student = drawn(n_seeds=2)
    optimizer, cut = optimizer_of(student), student.n_policy
    student.gradients.fill_(1.0)
    optimizer.step([True, True], [True, True])
    before = everything(student, optimizer)
    optimizer.step([False, True], [True, False])
    after = everything(student, optimizer)
    moved = after["weights"] != before["weights"]
    assert not moved[0, :cut].any()
    assert not moved[1, cut:].any()
    assert moved[0, cut:].all()
    assert moved[1, :cut].all()
    for name in ("first", "second"):
        assert torch.equal(before[name] != after[name], moved), name
    assert (after["steps"] - before["steps"]).tolist() == [[0, 1], [1, 0]]


def test_a_row_that_waited_goes_on_as_if_it_had_not():
    students = drawn(n_seeds=2), drawn(n_seeds=2)
    for student, waits in zip(students, ([], [0, 0, 0]), strict=True):
        optimizer = optimizer_of(student)
        for gradient in (1.0, *waits, -0.3, 2.0):
            student.gradients.fill_(gradient or 5.0)
            optimizer.step([bool(gradient), True], [True, True])
    cut = students[0].n_policy
    assert torch.equal(students[0].storage[0, :cut], students[1].storage[0, :cut])


def test_scale_scales_the_policys_step_and_only_that_step():
    moves, critics = [], []
    for scale in (1.0, 0.25):
        student = drawn()
        optimizer, cut = optimizer_of(student), student.n_policy
        student.gradients.fill_(1.0)
        for scaled in (scale, 1.0):
            before = student.storage.clone()
            optimizer.step([True], [True], scaled)
            moved = (student.storage - before)[0]
            moves.append(moved[:cut].mean().item())
            critics.append(moved[cut:].mean().item())
    assert moves == pytest.approx([-1e-2, -1e-2, -0.25e-2, -1e-2], rel=1e-3)
    assert critics == pytest.approx([-1e-2] * 4, rel=1e-3)


def test_a_gradient_of_3_and_4_is_scaled_down_and_what_does_not_move_is_left_alone():
    student = drawn(n_seeds=2)
    optimizer, cut, gradients = optimizer_of(student), student.n_policy, student.gradients
    gradients[:, [0, 1]] = torch.tensor([[3.0, 4.0], [0.3, 0.4]])  # policies: 5 and 0.5 long
    gradients[:, [cut, cut + 1]] = torch.tensor([[30.0, 40.0], [30.0, 40.0]])  # critics: 50 long
    optimizer.step([True, True], [True, False], 1.0, 2.0)
    assert_close(gradients[:, [0, 1]], torch.tensor([[1.2, 1.6], [0.3, 0.4]]))
    assert_close(gradients[:, [cut, cut + 1]], torch.tensor([[1.2, 1.6], [30.0, 40.0]]))
    assert_close(optimizer.first[0, [0, cut]], torch.tensor([0.12, 0.12]))  # (1 − β₁)·g


def test_a_loaded_optimiser_goes_on_where_the_saved_one_was():
    student, twin = drawn(2), drawn(2)
    first, second = optimizer_of(student), optimizer_of(twin)
    student.gradients.normal_(generator=torch.manual_seed(0))
    first.step([True, True], [True, False])
    twin.storage.copy_(student.storage)
    twin.gradients.copy_(student.gradients)
    second.load({name: value.clone() for name, value in first.state().items()})
    for optimizer in (first, second):
        optimizer.step([True, True], [True, True])
    assert torch.equal(student.storage, twin.storage)


def test_means_are_each_seeds_own_over_the_steps_it_took():
    means = Means()
    means.add(torch.tensor([4, 2, 0]), {"loss": torch.tensor([1.0, 5.0, 9.0])})
    means.add(torch.tensor([1, 0, 0]), {"loss": torch.tensor([2.0, 9.0, 9.0])})
    np.testing.assert_array_equal(means.numpy()["loss"], [1.5, 5.0, NAN])


@given(st.lists(st.integers(0, 12), min_size=1, max_size=4), st.integers(1, 5))
def test_the_parts_of_an_order_are_each_seeds_samples_once(counts, size):
    samples = samples_of(*counts) if max(counts) else None
    if samples is None:
        return
    order = shuffle(samples, generators(len(counts)))
    visited = [[] for _ in counts]
    for start in range(0, max(counts), size):
        bounds = (samples.counts.clamp(max=start), samples.counts.clamp(max=start + size))
        positions, taken = minibatch(order, *bounds)
        for s, n in enumerate(taken.tolist()):
            visited[s] += positions[s, :n].tolist()
    assert [sorted(visits) for visits in visited] == [list(range(n)) for n in counts]


def test_a_seeds_order_is_its_generators():
    samples = samples_of(9, 5, 9)
    together = shuffle(samples, generators(3))
    alone = shuffle(samples_of(5), generators(3)[1:2])
    assert torch.equal(together[1, :5], alone[0])
    assert not torch.equal(together[0], together[2])


def test_every_epoch_visits_each_sample_once_in_each_seeds_own_minibatches(batches_of):
    batches = batches_of("representation_loss")
    student = drawn(n_seeds=3)
    learn_on_policy(student, optimizer_of(student), samples_of(10, 4, 7), PPO, generators(3))
    assert len(batches) == 6
    for s, (n, sizes) in enumerate([(10, [4, 4, 2]), (4, [4, 0, 0]), (7, [4, 3, 0])]):
        visits = visited(batches, s)
        assert [len(rows) for rows in visits] == 2 * sizes
        epochs = [*chain(*visits[:3])], [*chain(*visits[3:])]
        assert [sorted(epoch) for epoch in epochs] == [list(range(n))] * 2
        assert epochs[0] != epochs[1]


def test_instances_are_visited_once_an_epoch_too(batches_of):
    batches = batches_of("instance_loss")
    student = drawn(n_seeds=2)
    learn_from_instances(student, optimizer_of(student), samples_of(9, 2), PPO, generators(2))
    assert len(batches) == 6
    for s, n in enumerate((9, 2)):
        visits = visited(batches, s)
        for epoch in (visits[:3], visits[3:]):
            assert sorted(chain(*epoch)) == list(range(n))


@pytest.mark.parametrize("kept", [(9, 2), (1, 3), (0, 5), (30, 0)])
def test_a_joint_update_spreads_the_instances_evenly_over_the_minibatches(batches_of, kept):
    own, taught = batches_of("representation_loss"), batches_of("instance_loss")
    student, samples, instances = drawn(n_seeds=2), samples_of(12, 7), samples_of(*kept, seed=1)
    rngs = generators(2)
    learn_on_policy(student, joint_optimizer(student), samples, PPO, rngs, instances=instances)
    assert len(own) == len(taught) == 6
    for s, steps in enumerate((3, 2)):
        visits = visited(taught, s)
        for epoch in (visits[:3], visits[3:]):
            sizes = [len(rows) for rows in epoch]
            assert sorted(chain(*epoch)) == list(range(kept[s]))
            assert max(sizes[:steps]) - min(sizes[:steps]) <= 1
            assert not any(sizes[steps:])


@pytest.mark.parametrize("beta", [0.0, 0.4])
def test_representation_loss_by_hand(beta):
    student, samples = drawn(n_seeds=2), samples_of(6, 6)
    teacher = teacher_at(samples)
    obs = samples.observations.take(samples.rows)
    policy, values = student.policy(obs), student.value(obs)
    ratio = (policy.log_prob(samples.actions) - samples.behavior_log_probs).exp()
    surrogate = torch.minimum(
        ratio * samples.advantages, ratio.clamp(0.8, 1.2) * samples.advantages
    )
    expected = (
        -surrogate.mean(1)
        + 0.7 * ((values - samples.returns) ** 2).mean(1)
        - 0.03 * policy.entropy().squeeze(1)
        + beta * teacher.cross_entropy(policy).mean(1)
    )
    loss, numbers = representation_loss(student, samples, teacher, spec_of(PPO, beta=beta))
    assert_close(loss, expected)
    assert_close(numbers["clip_fraction"], ((ratio - 1).abs() > 0.2).float().mean(1))
    assert_close(numbers["approx_kl"], (ratio - 1 - ratio.log()).mean(1))
    assert "cross_entropy" in numbers


def test_instance_loss_is_the_surrogate_alone():
    student, samples = drawn(), samples_of(6)
    ppo = PPO.model_copy(update={"ent_coef": 0.0})
    loss, numbers = instance_loss(student, samples, spec_of(PPO))
    _, others = representation_loss(student, samples, None, spec_of(ppo))
    assert_close(loss, others["policy_loss"])
    log_probs = student.policy(samples.observations.take(samples.rows)).log_prob(samples.actions)
    assert_close(numbers["log_ratio"], (log_probs - samples.behavior_log_probs).mean(1))
    loss.sum().backward()
    assert student.gradients[:, : student.n_policy].any()
    assert not student.gradients[:, student.n_policy :].any()


def losses_and_gradients(samples):
    student, numbers = drawn(n_seeds=2), []
    teacher = teacher_at(samples)
    for loss, _ in (
        representation_loss(student, samples, teacher, spec_of(PPO, beta=0.4)),
        instance_loss(student, samples, spec_of(PPO)),
    ):
        student.gradients.zero_()
        loss.sum().backward()
        numbers += [loss.detach(), student.gradients.clone()]
    return numbers


@given(st.integers(0, 2**32 - 1))
def test_a_seeds_padding_changes_neither_its_loss_nor_its_gradient(seed):
    samples, garbage = samples_of(6, 4), samples_of(6, 6, seed=seed)
    parts = {}
    for name in ("rows", "actions", "behavior_log_probs", "advantages", "returns", "rewards"):
        parts[name] = getattr(samples, name).clone()
        parts[name][1, 4:] = getattr(garbage, name)[1, :2] * (1 if name == "rows" else 9)
    other = replace(samples, **parts)
    for one, two in zip(losses_and_gradients(samples), losses_and_gradients(other), strict=True):
        assert torch.equal(one, two)


def test_a_seed_with_fewer_samples_stops_earlier_and_ends_where_it_would_alone():
    many, few = samples_of(12, 12), samples_of(12, 3)
    ends = []
    for samples in (many, few):
        student = drawn(n_seeds=2)
        optimizer = optimizer_of(student)
        learn_on_policy(student, optimizer, samples, PPO, generators(2))
        ends.append(everything(student, optimizer))
    assert torch.equal(ends[0]["weights"][0], ends[1]["weights"][0])
    assert [end["steps"].tolist() for end in ends] == [[[6, 6], [6, 6]], [[6, 2], [6, 2]]]


def test_a_seed_without_instances_stays_while_its_neighbour_learns():
    student = drawn(n_seeds=2)
    optimizer, samples = optimizer_of(student), samples_of(5, 0)
    learn_on_policy(student, optimizer, samples_of(4, 4), PPO, generators(2))
    before = everything(student, optimizer)
    numbers = learn_from_instances(student, optimizer, samples, PPO, generators(2))
    after = everything(student, optimizer)
    assert torch.equal(after["weights"][1], before["weights"][1])
    assert not torch.equal(after["weights"][0], before["weights"][0])
    assert torch.equal(after["first"][1], before["first"][1])
    assert np.isnan(numbers["policy_loss"]).tolist() == [False, True]


def test_instances_never_touch_the_critic():
    student = drawn(n_seeds=2)
    optimizer, cut = optimizer_of(student), student.n_policy
    learn_on_policy(student, optimizer, samples_of(4, 4), PPO, generators(2))
    before = everything(student, optimizer)
    learn_from_instances(student, optimizer, samples_of(9, 5), PPO, generators(2))
    after = everything(student, optimizer)
    assert torch.equal(after["weights"][:, cut:], before["weights"][:, cut:])
    assert (after["weights"][:, :cut] != before["weights"][:, :cut]).any(1).all()
    for name in ("first", "second"):
        assert torch.equal(after[name][:, cut:], before[name][:, cut:])
    assert (after["steps"] - before["steps"]).tolist() == [[6, 4], [0, 0]]


def test_the_policy_step_does_not_depend_on_the_critics():
    ends = []
    for vf_coef in (0.1, 9.0):
        student, ppo = drawn(), PPO.model_copy(update={"vf_coef": vf_coef})
        learn_on_policy(student, optimizer_of(student), samples_of(8), ppo, generators())
        ends.append(student.storage[:, : student.n_policy].clone())
    assert torch.equal(*ends)


def test_learning_makes_good_actions_likelier_and_the_critic_truer():
    student, samples = drawn(), samples_of(32)
    obs = samples.observations.take(samples.rows)
    samples = replace(
        samples, behavior_log_probs=student.policy(obs).log_prob(samples.actions).detach()
    )

    def measures():
        gain = (student.policy(obs).log_prob(samples.actions) * samples.advantages).mean()
        return gain.item(), ((student.value(obs) - samples.returns) ** 2).mean().item()

    before = measures()
    ppo = PPO.model_copy(update={"n_epochs": 20, "minibatch_size": 32})
    learn_on_policy(student, optimizer_of(student), samples, ppo, generators())
    after = measures()
    assert after[0] > before[0]
    assert after[1] < 0.95 * before[1]


def test_kickstarting_comes_closer_to_the_teacher():
    student, samples = drawn(), samples_of(32)
    teacher = teacher_at(samples)
    obs = samples.observations.take(samples.rows)
    before = teacher.cross_entropy(student.policy(obs)).mean()
    ppo = PPO.model_copy(update={"n_epochs": 20, "minibatch_size": 32})
    optimizer = optimizer_of(student)
    learn_on_policy(student, optimizer, samples, ppo, generators(), teacher=teacher, beta=5.0)
    assert teacher.cross_entropy(student.policy(obs)).mean() < before - 0.1


def test_each_sample_meets_the_teacher_at_its_own_observation(monkeypatch):
    # the teacher's mean at sample i is i; whatever the order, row and mean belong together
    samples = samples_of(9, 6)
    means = samples.rows.float().unsqueeze(-1).expand(2, 9, 2)
    pairs, loss = [], epochs.representation_loss

    def spy(student, batch, teacher, *rest):
        pairs.append((batch.rows.float(), teacher.mean[..., 0]))
        return loss(student, batch, teacher, *rest)

    monkeypatch.setattr(epochs, "representation_loss", spy)
    student, teacher = drawn(2), Gaussian(means, torch.zeros(2, 1, 2))
    optimizer = optimizer_of(student)
    learn_on_policy(student, optimizer, samples, PPO, generators(2), teacher=teacher, beta=1.0)
    assert len(pairs) == 6
    for rows, mean in pairs:
        assert torch.equal(rows, mean)


def moved(samples, learn, **coefficients):
    """How far one step moves the policy."""
    student = drawn(len(samples.counts))
    before, ppo = student.storage.clone(), PPO.model_copy(update={"n_epochs": 1})
    rngs = generators(len(samples.counts))
    learn(student, optimizer_of(student), samples, ppo, rngs, **coefficients)
    return (student.storage - before)[:, : student.n_policy]


def test_alpha_scales_the_learning_rate_of_an_iteration():
    samples = samples_of(4)
    for learn in (learn_on_policy, learn_from_instances):
        whole, half = moved(samples, learn), moved(samples, learn, policy_scale=0.5)
        assert_close(half, whole / 2, rtol=1e-4, atol=1e-7)


def moved_jointly(alpha_1, alpha_2, **settings):
    """How far a joint step moves the policy and the critic."""
    student, one = drawn(), PPO.model_copy(update={"n_epochs": 1} | settings)
    learn_on_policy(
        student, joint_optimizer(student), samples_of(4), one, generators(),
        instances=samples_of(4, seed=1), policy_scale=alpha_1, instance_scale=alpha_2,
    )  # fmt: skip
    change = student.storage - drawn().storage
    return change[:, : student.n_policy], change[:, student.n_policy :]


def test_a_joint_step_adds_adams_steps_along_both_gradients_at_one_point():
    student, samples, instances = drawn(), samples_of(4), samples_of(4, seed=1)
    steps = []
    for loss, _ in (
        representation_loss(student, samples, None, spec_of(PPO)),
        instance_loss(student, instances, spec_of(PPO)),
    ):
        student.gradients.zero_()
        loss.sum().backward()
        gradient = student.gradients[:, : student.n_policy]
        steps.append(-PPO.learning_rate * gradient / (gradient.abs() + 1e-5))  # Adam's first
    moved, _ = moved_jointly(0.3, 2.0)
    assert_close(moved, 0.3 * steps[0] + 2.0 * steps[1], rtol=1e-3, atol=2e-7)


def test_alphas_of_a_joint_update_are_step_sizes():
    (whole, critic), (tenth, same) = moved_jointly(1, 1), moved_jointly(0.1, 0.1)
    assert_close(tenth, whole / 10, rtol=1e-3, atol=2e-7)
    assert torch.equal(critic, same)
    (clipped, _), (tenth, _) = (moved_jointly(a, a, max_grad_norm=0.01) for a in (1, 0.1))
    assert_close(tenth, clipped / 10, rtol=1e-3, atol=2e-7)


@pytest.mark.parametrize("teaches", [True, False])
def test_a_joint_update_without_alpha_2_is_kickstarting_bit_for_bit(teaches):
    teacher = Gaussian(torch.zeros(2, 70, 2), torch.zeros(2, 1, 2)) if teaches else None
    ends = []
    for options in ({}, {"instances": samples_of(70, 9, seed=1), "instance_scale": 0.0}):
        student = drawn(2)
        optimizer = joint_optimizer(student)
        for _ in range(2):
            learn_on_policy(
                student, optimizer, samples_of(70, 33), PPO, generators(2),
                teacher=teacher, beta=0.2, **options,
            )  # fmt: skip
        ends.append((student.storage.clone(), optimizer.first.clone()))
    assert torch.equal(ends[0][0], ends[1][0])
    assert torch.equal(ends[0][1], ends[1][1])


def test_moments_of_a_joint_update_are_kept_and_brought_back():
    student = drawn()
    optimizer = joint_optimizer(student)
    options = {"instances": samples_of(4, seed=1)}
    learn_on_policy(student, optimizer, samples_of(4), PPO, generators(), **options)
    other = drawn()
    other.storage.copy_(student.storage)
    again = joint_optimizer(other)
    again.load({name: tensor.clone() for name, tensor in optimizer.state().items()})
    for who, moments in ((student, optimizer), (other, again)):
        learn_on_policy(who, moments, samples_of(4), PPO, generators(), **options)
    assert torch.equal(student.storage, other.storage)
    assert optimizer.state()["instances/steps"].item() > 1
    joint_optimizer(other).load(optimizer_of(student).state())  # of a run before they were kept


def test_weight_decay_adds_the_gradient_of_the_weights_squared_norm():
    samples, ppo = samples_of(4), PPO.model_copy(update={"n_epochs": 1, "weight_decay": 0.5})
    student = drawn()
    with torch.no_grad():
        student.storage += 0.1  # biases and log σ too
    start = student.storage.clone()
    loss, _ = representation_loss(student, samples, None, spec_of(ppo))
    squares = sum((w**2).sum() for n, w in student.weights.items() if n.endswith(".weight"))
    student.gradients.zero_()
    (loss.sum() + 0.25 * squares).backward()
    expected = student.gradients.clone()
    assert not compiled.applies_to(student, spec_of(ppo))
    for learn in (learn_on_policy, learn_from_instances):
        student.storage.copy_(start)
        learn(student, optimizer_of(student), samples, ppo, generators())
        if learn is learn_on_policy:
            assert_close(student.gradients, expected)
        else:
            assert torch.equal(student.storage[:, student.n_policy :], start[:, student.n_policy :])


@pytest.mark.parametrize("over", ["max", "mean"])
def test_a_kl_penalty_is_of_the_largest_or_the_mean_divergence_over_states(over):
    student, samples = drawn(2), samples_of(4, 2)
    shift = torch.arange(8.0).view(2, 4, 1).expand(2, 4, 2) / 10
    policy = student.policy(samples.observations.take(samples.rows))
    behavior = Gaussian((policy.mean + shift).detach(), policy.log_std.detach() + 0.3)
    samples = replace(samples, behavior=behavior)
    kl = torch.distributions.kl_divergence(
        torch.distributions.Normal(behavior.mean, behavior.log_std.exp()),
        torch.distributions.Normal(policy.mean, policy.log_std.exp()),
    ).sum(-1)  # (S, B)
    wanted = [getattr(kl[s, :n], over)() for s, n in enumerate((4, 2))]
    plain, _ = representation_loss(student, samples, None, spec_of(PPO))
    settings = {"kl_penalty": 0.7, "kl_over": over}
    spec = spec_of(PPO.model_copy(update=settings))
    loss, _ = representation_loss(student, samples, None, spec)
    assert_close(loss - plain, 0.7 * torch.stack(wanted), rtol=1e-4, atol=1e-5)
    assert not compiled.applies_to(student, spec)


def test_a_joint_step_without_instances_has_no_kl_of_theirs():
    student, none = drawn(2), samples_of(0, 0)
    behavior = Gaussian(torch.zeros(2, 0, 2), torch.zeros(2, 1, 2))
    ppo = PPO.model_copy(update={"objective": "trpo"})
    loss, _ = instance_loss(student, replace(none, behavior=behavior), spec_of(ppo))
    assert_close(loss, torch.zeros(2))


@pytest.mark.parametrize("objective", ["a2c", "reinforce"])
def test_a_teachers_samples_are_weighed_by_the_likelihood_ratio(objective):
    student, samples = drawn(), samples_of(6)
    ppo = PPO.model_copy(update={"objective": objective})
    policy = student.policy(samples.observations.take(samples.rows))
    log_probs = policy.log_prob(samples.actions)
    ratio = (log_probs - samples.behavior_log_probs).exp().detach()
    slopes = []
    for weights in (ratio, torch.ones_like(ratio)):
        student.gradients.zero_()
        (-(weights * samples.advantages * log_probs).mean()).backward(retain_graph=True)
        slopes.append(student.gradients.clone())
    for importance, slope in zip((True, False), slopes, strict=True):
        student.gradients.zero_()
        instance_loss(student, samples, spec_of(ppo, importance=importance))[0].sum().backward()
        assert_close(student.gradients, slope, rtol=1e-4, atol=1e-6)
    assert not torch.allclose(*slopes)


def test_what_a_seed_learns_jointly_does_not_depend_on_what_its_neighbour_kept():
    ends = []
    for kept in ((0, 0), (0, 5)):
        student = drawn(2)
        learn_on_policy(
            student, joint_optimizer(student), samples_of(6, 6), PPO, generators(2),
            instances=samples_of(0, 5).pick(*front(torch.arange(5) < torch.tensor(kept)[:, None])),
            policy_scale=0.01,
        )  # fmt: skip
        ends.append(student.storage[0].clone())
    assert torch.equal(*ends)


@pytest.mark.parametrize("learn", [learn_on_policy, learn_from_instances])
def test_a_loss_that_is_not_finite_names_its_seed_and_moves_nothing(learn):
    student, samples = drawn(n_seeds=2), samples_of(4, 4)
    samples.behavior_log_probs[1, 2] = NAN
    before = student.storage.clone()
    with pytest.raises(DivergedError, match="a finite policy_loss, found nan") as caught:
        learn(student, optimizer_of(student), samples, PPO, generators(2))
    assert caught.value.row == 1
    assert torch.equal(student.storage, before)
