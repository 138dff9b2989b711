"""Actions of several numbers: their space, their distribution, the networks that choose them."""

from itertools import product

import numpy as np
import odd_envs
import pytest
import torch
from gymnasium.spaces import Box, Dict, MultiDiscrete
from small_runs import add_teacher

from repaint_cli.envs.compound_space import CompoundSpace
from repaint_cli.errors import CardError, CheckpointError
from repaint_cli.learn.rollout.storage import RolloutBuilder
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.compound import Compound
from repaint_cli.policies.distributions import concat_policies, concat_samples, mixture
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo.teacher_card import read_card

SIZES = (3, 4, 2)
USES = ((True, True), (False, False), (True, False))
"""Of three commands: one with both further numbers, one with none, one with the first alone."""


def compound(seed=0, shape=(2, 5), uses=USES, available=None):
    logits = torch.from_numpy(np.random.default_rng(seed).normal(size=(*shape, sum(SIZES))))
    return Compound.from_logits(logits, SIZES, torch.tensor(uses, dtype=torch.float64), available)


def outcomes():
    """Every action that differs: numbers that do not count are 0."""
    for command, row in enumerate(USES):
        ranges = [range(n) if used else (0,) for n, used in zip(SIZES[1:], row, strict=True)]
        yield from ((command, *rest) for rest in product(*ranges))


def chances(policy):
    """The probability of each outcome, (outcomes, S, B)."""
    shape = policy.log_probs.shape[:2]
    return torch.stack(
        [torch.exp(policy.log_prob(torch.tensor(one).expand(*shape, 3))) for one in outcomes()]
    )


def test_probabilities_of_all_different_actions_sum_to_one():
    torch.testing.assert_close(chances(compound()).sum(0), torch.ones(2, 5, dtype=torch.float64))


def test_entropies_and_divergences_are_those_of_the_different_actions():
    one, other = compound(0), compound(1)
    p, q = chances(one), chances(other)
    torch.testing.assert_close(one.entropy(), -(p * p.log()).sum(0))
    torch.testing.assert_close(one.cross_entropy(other), -(p * q.log()).sum(0))
    torch.testing.assert_close(one.kl(other), (p * (p / q).log()).sum(0))


def test_numbers_that_a_command_does_not_use_change_no_probability():
    policy = compound()
    actions = torch.tensor([1, 0, 0]).expand(2, 5, 3)
    others = torch.tensor([1, 3, 1]).expand(2, 5, 3)
    assert torch.equal(policy.log_prob(actions), policy.log_prob(others))
    counted = compound(uses=((True, True),) * 3)
    assert not torch.equal(counted.log_prob(actions), counted.log_prob(others))


def test_samples_are_as_frequent_as_they_are_likely():
    policy = compound(shape=(1, 1))
    many = Compound(policy.log_probs.expand(1, 40_000, -1), SIZES, policy.uses)
    noise = Compound.noise(np.random.default_rng(0), (1, 40_000, sum(SIZES)))
    actions = many.sample(torch.from_numpy(noise))[0]
    used = many.uses[actions[:, 0]].long()
    drawn = torch.cat([actions[:, :1], actions[:, 1:] * used], 1)
    frequencies = torch.stack(
        [(drawn == torch.tensor(one)).all(1).double().mean() for one in outcomes()]
    )
    torch.testing.assert_close(frequencies, chances(policy)[:, 0, 0], atol=0.01, rtol=0)


def test_the_mode_has_the_most_likely_command_and_the_most_likely_numbers():
    logits = torch.zeros(1, 1, sum(SIZES))
    logits[0, 0, [2, 3 + 1, 3 + 4 + 1]] = 1.0
    policy = Compound.from_logits(logits, SIZES, torch.tensor(USES, dtype=torch.float32))
    assert policy.mode()[0, 0].tolist() == [2, 1, 1]


def test_a_temperature_softens_every_number():
    policy = compound()
    assert policy.soften(0.4, 1) is policy
    soft = policy.soften(0, 3.0)
    for part, own in zip(soft.factors, policy.factors, strict=True):
        torch.testing.assert_close(part, torch.log_softmax(own / 3, -1))


def test_commands_that_are_not_available_are_never_chosen_and_gradients_stay_finite():
    available = torch.ones(2, 5, 3)
    available[:, :, 0] = 0
    logits = torch.randn(2, 5, sum(SIZES), requires_grad=True)
    policy = Compound.from_logits(logits, SIZES, torch.tensor(USES).float(), available)
    assert (torch.exp(policy.factors[0])[..., 0] == 0).all()
    assert (policy.mode()[..., 0] != 0).all()
    (policy.entropy().sum() + policy.kl(compound(shape=(2, 5))).sum()).backward()
    assert torch.isfinite(logits.grad).all()
    assert (logits.grad[..., 0] == 0).all()


def test_several_teachers_are_one_whose_cross_entropy_is_the_weighted_sum():
    teachers, student = [compound(1), compound(2), compound(3)], compound(4)
    weights = torch.tensor([[0.1, 0.0], [0.4, 0.5], [0.3, 0.2]])
    both = mixture(teachers, weights)
    wanted = sum(
        w[:, None] * teacher.cross_entropy(student)
        for w, teacher in zip(weights, teachers, strict=True)
    )
    found = weights.sum(0)[:, None] * both.cross_entropy(student)
    torch.testing.assert_close(found, wanted, atol=1e-6, rtol=0)
    torch.testing.assert_close(
        torch.stack([torch.exp(part).sum(-1) for part in both.factors]),
        torch.ones(3, 2, 5, dtype=torch.float64), atol=1e-6, rtol=0,
    )  # fmt: skip


def test_a_number_that_no_teacher_uses_leaves_the_mixture_finite():
    never = ((False, False),) * 3
    both = mixture([compound(1, uses=never), compound(2, uses=never)], torch.ones(2, 2))
    assert torch.isfinite(both.log_probs).all()


def test_parts_of_a_batch_are_parts_of_the_distribution():
    policy = compound()
    rows = torch.arange(2).unsqueeze(1), torch.tensor([[0, 2], [4, 1]])
    assert torch.equal(policy[rows].log_probs, policy.log_probs[rows])
    assert torch.equal(policy.alone(1, 3).log_probs, policy.log_probs[1:, :3])
    for joined in (concat_samples([policy, policy]), concat_policies([policy, policy])):
        assert torch.equal(joined.alone(0, 5).log_probs, policy.log_probs[:1])
        assert joined.sizes == SIZES


def test_a_space_says_which_numbers_count_with_each_command():
    space = CompoundSpace(SIZES, USES)
    assert Spaces.of(Box(-1.0, 1.0, (2,)), space).uses == USES
    assert space.contains(space.sample())
    assert space == CompoundSpace(SIZES, USES)
    assert space != CompoundSpace(SIZES, ((True, True),) * 3)
    assert space != MultiDiscrete(SIZES)
    assert Spaces.of(Box(-1.0, 1.0, (2,)), MultiDiscrete([2, 5])).uses == ((True,), (True,))
    for uses in (USES[:2], ((True,), (True, True), (True,))):
        with pytest.raises(ValueError, match="expected uses of 3 × 2, found rows of"):
            CompoundSpace(SIZES, uses)


SEEN = Dict(
    screen=Box(0, 255, (24, 24, 2), np.uint8), map=Box(0, 255, (12, 12, 1), np.uint8),
    numbers=Box(-1.0, 1.0, (5,)), available=Box(0.0, 1.0, (3,)),
)  # fmt: skip
NET = NetConfig(kind="cnn", conv=((4, 4, 2), (8, 3, 1)), dense=16, vector=6, pool=1)


def observed(n_seeds=2, n=7):
    rng = np.random.default_rng(0)
    seen = {
        "screen": rng.integers(0, 256, (n_seeds, n, 24, 24, 2), np.uint8),
        "map": rng.integers(0, 256, (n_seeds, n, 12, 12, 1), np.uint8),
        "numbers": rng.normal(size=(n_seeds, n, 5)).astype(np.float32),
        "available": np.tile(np.float32([1, 0, 1]), (n_seeds, n, 1)),
    }
    return {name: torch.from_numpy(seen[name]) for name in SEEN}


def networks(net=NET, n_seeds=2):
    student = ActorCritic(Spaces.of(SEEN, CompoundSpace(SIZES, USES)), net, n_seeds)
    student.initialize([np.random.default_rng(seed) for seed in range(n_seeds)])
    return student


def test_several_images_and_vectors_are_read_by_layers_of_their_own():
    student = networks()
    own = {name for name in student.weights if name.startswith("policy.") and "weight" in name}
    assert own == {
        *(f"policy.{image}.conv{layer}.weight" for image in ("screen", "map") for layer in (0, 1)),
        "policy.vector.weight", "policy.dense.weight", "policy.head.weight",
    }  # fmt: skip
    assert student.weights["policy.vector.weight"].shape == (2, 5 + 3, 6)
    policy = student.policy(observed())
    (policy.entropy().sum() + student.value(observed()).sum()).backward()
    for name, weight in student.weights.items():
        assert weight.grad.abs().sum() > 0, name


def test_a_seed_s_policy_does_not_depend_on_its_neighbour():
    student, seen = networks(), observed()
    both = student.policy(seen)
    alone = student.alone(1).policy({name: part[1:] for name, part in seen.items()})
    assert torch.equal(both.log_probs[1:], alone.log_probs)


def test_a_policy_may_leave_out_what_is_not_available_or_only_see_it():
    assert (networks().policy(observed()).factors[0][..., 1] > -10).all()
    masked = networks(NET.model_copy(update={"mask": True})).policy(observed())
    assert (torch.exp(masked.factors[0])[..., 1] == 0).all()


def test_a_teacher_leaves_out_and_counts_what_its_student_s_task_says():
    teacher = networks(NET.model_copy(update={"spatial": "all"}))
    taught = teacher.with_actions_of(NET.model_copy(update={"mask": True})).policy(observed())
    assert (taught.uses == torch.tensor(USES).float()).all()
    assert (torch.exp(taught.factors[0])[..., 1] == 0).all()
    assert (teacher.policy(observed()).uses == 1).all()


def test_arrays_of_a_dict_are_stored_by_their_names_in_whatever_order():
    builder = RolloutBuilder((1, 1), ())
    for pair in ({"a": 0.0, "b": 1.0}, {"b": 1.0, "a": 0.0}):
        seen = {name: np.full((1, 1, 2), value, np.float32) for name, value in pair.items()}
        builder.add_observations(seen, np.ones((1, 1), bool))
    stores = builder._stores[0]
    assert stores["a"].tensor().unique().tolist() == [0.0]
    assert stores["b"].tensor().unique().tolist() == [1.0]


WRONG = [
    ({"sizes": (2, 2)}, "expected sizes with the sum n_actions, 9"),
    ({"uses": USES[:2]}, "expected a row for each value of the first of sizes"),
    ({"uses": ((True, True), (True,), (True, True))}, "expected a row for each value"),
    ({"uses": ()}, "expected a row for each value"),
    ({"parts": {"map": (12, 12, 1), "odd": (3, 3)}}, "expected vectors and images"),
    ({"parts": {"numbers": (5,)}}, "expected an image of obs_shape among them"),
    ({"n_beams": 4}, "among them, and no lidar beside them"),
]


@pytest.mark.parametrize(("changes", "text"), WRONG)
def test_a_teacher_s_file_with_sizes_that_do_not_go_together_is_refused(tmp_path, changes, text):
    spaces = Spaces.of(SEEN, CompoundSpace(SIZES, USES))
    sizes = {"parts": dict(spaces.parts), "sizes": spaces.sizes, "uses": spaces.uses}
    settings = ["net.conv=[[4,4,2],[8,3,1]]", "net.dense=16", "net.pool=1"]
    path = add_teacher(
        tmp_path, task="racer-inner", spaces=spaces, settings=settings, **sizes | changes
    )
    with pytest.raises(CheckpointError, match=text) as caught:
        read_card(path)
    assert len(str(caught.value)) < 500


def test_all_numbers_may_count_as_in_rl_coach():
    counted = networks(NET.model_copy(update={"spatial": "all"})).policy(observed())
    assert (counted.uses == 1).all()
    assert (networks().policy(observed()).uses == torch.tensor(USES).float()).all()


def test_spaces_of_several_observations_and_numbers_are_named():
    spaces = Spaces.of(SEEN, CompoundSpace(SIZES, USES))
    assert str(spaces).endswith("observations and 3×4×2 discrete actions")
    assert dict(spaces.parts) == spaces.shapes == {n: part.shape for n, part in SEEN.items()}
    vector = Spaces.of(Box(-1.0, 1.0, (4,)), MultiDiscrete([2, 5]))
    assert (vector.sizes, vector.n_actions) == ((2, 5), 7)
    backwards = Dict([(name, SEEN[name]) for name in reversed(list(SEEN))])
    assert Spaces.of(backwards, CompoundSpace(SIZES, USES)) == spaces


def test_a_simulator_with_a_symmetry_has_one_observation_and_one_number():
    spaces = Spaces.of(SEEN, CompoundSpace(SIZES, USES))
    with pytest.raises(CardError, match="expected one observation and one number to mirror"):
        read_task("racer-inner").check_symmetry(spaces)


def test_a_mask_needs_to_know_what_is_available():
    seen = Dict({name: part for name, part in SEEN.items() if name != "available"})
    with pytest.raises(CardError, match=r"net\.mask needs observations .available., a number for"):
        ActorCritic(
            Spaces.of(seen, CompoundSpace(SIZES, USES)), NET.model_copy(update={"mask": True}), 1
        )
    numbers = Dict(one=Box(-1.0, 1.0, (4,)), two=Box(-1.0, 1.0, (4,)))
    for odd in (numbers, Dict(inner=SEEN, screen=SEEN["screen"])):
        with pytest.raises(CardError, match="or in a Dict of these with an image among them"):
            Spaces.of(odd, MultiDiscrete([2]))


@pytest.mark.parametrize("method", ["repaint", "repaint-joint"])
def test_an_environment_of_two_numbers_is_a_task_like_any_other(repaint, home, method):
    (home / "pairs.toml").write_text(odd_envs.card("Pairs", "near"))
    assert "3×2 discrete actions" in repaint("tasks", "check", "pairs.toml").out
    trained = repaint("train-teacher", "--task", "pairs.toml", "--name", "pairs")
    assert trained.code == 0, trained.err
    words = ["--teacher", "pairs", "--method", method, "--iterations", 2, "--run", "run"]
    taught = repaint("transfer", "--task", "pairs.toml", *words)
    assert taught.code == 0, taught.err
    assert repaint("eval", "run").code == 0
    refused = repaint("transfer", "--task", "pairs.toml", "--algorithm", "q-learning", "--method",
                      "scratch")  # fmt: skip
    assert "expected numbered actions for q-learning, found 2 observations and 3×2" in refused.err
