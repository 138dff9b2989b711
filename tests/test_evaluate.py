"""Evaluation: whole episodes, the same for every method, counted apart from training."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.names import STATUS
from repaint_cli.learn.evaluation import evaluate, play, spaces_of
from repaint_cli.learn.seeding import Purpose, env_seeds
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card_files import read_task

SMALL = ["net.conv=[[4,8,8]]", "net.dense=8"]


def student(task, n_seeds=1, seed=0):
    network = ActorCritic(spaces_of(task), task.net, n_seeds)
    network.storage.normal_(0, 0.3, generator=torch.Generator().manual_seed(seed))
    return network


@pytest.fixture
def reacher():
    return read_task("reacher")


@pytest.fixture
def lap():
    return read_task("racer-inner").with_settings([*SMALL, "env.max_steps=12"])


def test_every_seed_plays_that_many_whole_episodes(reacher):
    played = evaluate(student(reacher, 2), reacher, [0, 1], 3)
    assert_array_equal(played.lengths, np.full((2, 3), 50))
    assert played.rewards.shape == (50, 2, 3)
    assert_allclose(played.returns, played.rewards.sum(0))
    assert_allclose(played.returns, played.terms @ list(reacher.reward.values()))


def test_it_is_deterministic_and_leaves_the_policy_alone(reacher):
    network = student(reacher)
    before = network.storage.clone(), network.normalizer.count.clone()
    one, again = (evaluate(network, reacher, [5], 2, 7) for _ in range(2))
    assert_array_equal(one.returns, again.returns)
    assert_array_equal(one.actions, again.actions)
    assert torch.equal(network.storage, before[0])
    assert torch.equal(network.normalizer.count, before[1])


def test_an_evaluation_keeps_images_only_where_they_are_wanted(lap):
    rollout, played = play(student(lap), lap, [0], 2, keep_images=False)
    whole, same = play(student(lap), lap, [0], 2)
    assert rollout.observations.sizes.tolist() == [0]
    assert whole.observations.sizes.tolist() == [int(same.lengths.sum()) + 2]
    assert_array_equal(played.actions, same.actions)
    assert_array_equal(played.paths, same.paths)
    seen = evaluate(student(lap), lap, [0], 2, keep_observations=True).observations
    assert [len(one) for one in seen[0]] == same.lengths[0].tolist()


def test_all_policies_meet_the_same_episodes(reacher):
    one, other = (evaluate(student(reacher, seed=s), reacher, [5], 4, 7) for s in (1, 2))
    assert_array_equal(one.targets, other.targets)
    assert_array_equal(one.paths[:, :, 0], other.paths[:, :, 0])
    assert not np.array_equal(one.returns, other.returns)


def test_other_iterations_purposes_and_seeds_are_other_episodes(reacher):
    network = student(reacher)
    base = evaluate(network, reacher, [5], 2, 7).targets
    for seed, k, purpose in ((5, 8, Purpose.EVALUATE), (5, 7, Purpose.SCORE), (6, 7, 3)):
        assert not np.array_equal(evaluate(network, reacher, [seed], 2, k, purpose).targets, base)


def test_a_seed_plays_the_episodes_it_would_play_alone(reacher):
    both, alone = student(reacher, 2), student(reacher)
    alone.storage.copy_(both.storage[1:])
    together = evaluate(both, reacher, [3, 4], 2)
    assert_allclose(evaluate(alone, reacher, [4], 2).returns[0], together.returns[1], atol=1e-5)
    assert together.env_seeds[2:] == env_seeds([4], Purpose.EVALUATE, 0, 2)


def test_reachers_paths_end_as_far_from_the_target_as_it_was_paid_for(reacher):
    played = evaluate(student(reacher), reacher, [0], 3)
    gaps = np.linalg.norm(played.paths - played.targets[:, :, None], axis=-1)  # (S, E, T+1)
    assert_allclose(-gaps[:, :, 1:].sum(-1), played.terms[..., 0], atol=1e-4)


def test_racing_episodes_start_all_over_the_lap_and_differ_by_noise(lap):
    network, other = student(lap), lap.with_settings(["eval.noise=none"])
    played, clean = evaluate(network, lap, [0], 5), evaluate(network, other, [0], 5)
    first = played.paths[0, :, 0]
    gaps = np.linalg.norm(first[:, None] - first[None], axis=-1)
    assert gaps[~np.eye(5, dtype=bool)].min() > 1.0  # m
    assert not np.array_equal(played.paths, clean.paths)
    assert_array_equal(evaluate(network, lap, [0], 5).paths, played.paths)


def test_a_racing_episode_knows_how_it_ended(lap):
    played = evaluate(
        student(lap),
        lap,
        [
            0,
        ],
        3,
    )
    assert_array_equal(played.lengths, np.full((1, 3), 12))
    assert_array_equal(played.status, np.full((1, 3), STATUS.index("time_up")))
    assert_array_equal(played.progress, played.records["progress"][-1])


def test_what_the_car_saw_is_kept_when_asked_for(lap):
    network = student(lap)
    assert evaluate(network, lap, [0], 2).observations is None
    (episodes,) = evaluate(network, lap, [0], 2, keep_observations=True).observations
    assert [images.shape for images in episodes] == [(12, 120, 160, 1)] * 2
    assert episodes[0][0].std() > 0


def test_a_sight_is_what_followed_the_step():
    lap = read_task("racer-avoid").with_settings([*SMALL, "env.max_steps=3", "eval.noise=none"])
    network = student(lap)
    ((seen,),) = evaluate(network, lap, [0], 1, keep_observations=True).observations
    assert {name: part.shape for name, part in seen.items()} == {
        "camera": (3, 120, 160, 2), "lidar": (3, 64)
    }  # fmt: skip
    env = lap.make_env(1, one_episode=True)
    env.reset(seed=env_seeds([0], Purpose.EVALUATE, 0, 1), options=lap.start_options(1, 1, None))
    for t, action in enumerate(evaluate(network, lap, [0], 1).actions[:, 0, 0]):
        obs, *_ = env.step(np.array([action]))
        assert_array_equal(obs["camera"][0], seen["camera"][t])
        assert_array_equal(obs["lidar"][0], seen["lidar"][t])


def test_actions_are_drawn_where_the_card_says_so(reacher):
    network, drawn = student(reacher), reacher.with_settings(["eval.actions=sampled"])
    once, again, likeliest = (
        evaluate(network, task, [0], 2).actions for task in (drawn, drawn, reacher)
    )
    assert_array_equal(once, again)
    assert np.std(once - likeliest) > 0.2  # σ is 1, and many actions are cut at 1


def test_other_tasks_have_no_paths_and_no_progress(reacher):
    assert evaluate(student(reacher), reacher, [0], 1).progress is None
    cheetah = reacher.with_settings(["env.id=Swimmer-v5"]).model_copy(
        update={"reward": {"reward_forward": 1.0}}
    )
    network = student(cheetah)
    assert evaluate(network, cheetah, [0], 1).paths is None


def test_every_other_racing_episode_goes_the_other_way_where_the_card_says_so(lap):
    quiet = lap.with_settings(["eval.noise=none"])
    both = quiet.with_settings(["eval.both_directions=true"])
    played, one_way = (evaluate(student(lap), task, [0], 4) for task in (both, quiet))
    there, here = played.records, one_way.records
    assert_allclose(there["x"][0, 0, [0, 2]], here["x"][0, 0, [0, 2]])
    # a quarter of a lap the other way is where three quarters end
    assert_allclose(there["x"][0, 0, [1, 3]], here["x"][0, 0, [3, 1]], atol=0.4)
    apart = there["heading"][0, 0, [1, 3]] - here["heading"][0, 0, [3, 1]]
    assert_allclose(np.cos(apart), -1, atol=0.1)


def test_noise_is_as_large_as_the_card_says(lap):
    names = ("action_noise", "brightness_noise", "pixel_noise", "salt_pepper", "shift")
    none, nought, some = (
        evaluate(student(lap), lap.with_settings(settings), [0], 2, keep_observations=True)
        for settings in (["eval.noise=none"], [f"eval.{name}=0" for name in names], [])
    )
    assert_array_equal(none.observations[0][0], nought.observations[0][0])
    assert (none.observations[0][0][0] != some.observations[0][0][0]).mean() > 0.5
