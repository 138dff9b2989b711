"""Rollouts of environments on a GPU are those of the CPU: here on a stand-in for one.

What a GPU itself does of it is held to the CPU in `tests/gpu/check.py`.
"""

import numpy as np
import pytest
import torch

from repaint_cli.envs.reward_terms import RewardTerms
from repaint_cli.errors import DivergedError
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.learn.rollout import gpu
from repaint_cli.learn.rollout.collect import collect, start
from repaint_cli.learn.rollout.stream import Stream
from repaint_cli.learn.seeding import Purpose
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card_files import read_task

SMALL = ["net.conv=[[4,8,8]]", "net.dense=8", "env.max_steps=9"]
TASKS = {
    "camera": ("racer-inner", SMALL),
    "lidar": ("racer-avoid", SMALL),
    "ranges": ("racer-inner", [*SMALL, "env.actions={steering_angle=[-30,30],speed=[1,2]}"]),
}
EXTENTS = {
    "steps": {"n_steps": 40},
    "whole": {"n_steps": 40, "whole": True},
    "episodes": {"playing": np.array([[1, 1, 0, 1, 1], [1, 0, 1, 1, 1]], bool)},
}


class StandIn:
    """The cars of an environment on the CPU, by the interface of `DeviceRacer`."""

    def __init__(self, env):
        self.env, self.images = env, None

    def draw_into(self, images):
        self.images = images

    def step(self, actions):
        obs, *outcomes, info = self.env.step(actions.numpy())
        camera = obs["camera"] if isinstance(obs, dict) else obs
        self.images.copy_(torch.from_numpy(camera))
        parts = (
            {"camera": self.images, "lidar": obs["lidar"]} if isinstance(obs, dict) else self.images
        )
        return tensors(parts), *map(torch.from_numpy, outcomes), tensors(info)


def tensors(arrays):
    if not isinstance(arrays, dict):
        return torch.as_tensor(arrays)
    return {name: torch.as_tensor(part) for name, part in arrays.items()}


@pytest.mark.parametrize("extent", EXTENTS.values(), ids=EXTENTS)
@pytest.mark.parametrize(("name", "settings"), TASKS.values(), ids=TASKS)
def test_the_same_is_done_and_seen(name, settings, extent, monkeypatch):
    monkeypatch.setattr(gpu, "BLOCK", 4)  # room is made again and again
    card = read_task(name).with_settings(settings)
    student = ActorCritic(spaces_of(card), card.net, 2)
    student.initialize([np.random.default_rng(s) for s in range(2)])
    sides = []
    for on_gpu in (False, True):
        env, obs = start(
            card, [100, 101], 5, Purpose.TRAIN, 1, one_episode="playing" in extent,
            playing=extent.get("playing"),
        )  # fmt: skip
        if on_gpu:
            cars = StandIn(env.env)
            monkeypatch.setattr(RewardTerms, "device_env", cars)
            obs = tensors(obs)
        rngs = [np.random.default_rng(s) for s in range(2)]
        sides.append(collect(env, obs, student.policy, rngs, record=card.env.records, **extent))
    cpu, there = sides
    assert cpu.valid.any()
    assert (cpu.valid == there.valid).all()
    marks = cpu.valid
    for field in ("actions", "reward_terms", "rewards", "terminations", "truncations"):
        np.testing.assert_array_equal(
            getattr(there, field)[marks], getattr(cpu, field)[marks], field
        )
    np.testing.assert_allclose(there.behavior_log_probs[marks], cpu.behavior_log_probs[marks], 1e-5)
    for field in cpu.records:
        np.testing.assert_array_equal(there.records[field][marks], cpu.records[field][marks], field)
    np.testing.assert_array_equal(there.index, cpu.index)
    for theirs, ours in zip(cpu.observations.stores, there.observations.stores, strict=True):
        for part in theirs if isinstance(theirs, dict) else [None]:
            a, b = (theirs, ours) if part is None else (theirs[part], ours[part])
            assert torch.equal(a, b)


def test_episodes_go_on_in_the_next_rollout(monkeypatch):
    card = read_task("racer-inner").with_settings(SMALL)
    ppo = card.ppo.model_copy(update={"n_episodes": None, "n_steps": 20, "n_envs": 5})
    card = card.model_copy(update={"ppo": ppo})
    assert card.continues_episodes
    student = ActorCritic(spaces_of(card), card.net, 1)
    student.initialize([np.random.default_rng(1)])
    sides = []
    for on_gpu in (False, True):
        stream = Stream.begin(card, [100], 5, Purpose.TRAIN, 1, 0)
        if on_gpu:
            monkeypatch.setattr(RewardTerms, "device_env", StandIn(stream.env.env))
            stream.obs = tensors(stream.obs)
        rngs = [np.random.default_rng(1)]
        sides.append([stream.collect(student.policy, rngs, 4) for _ in range(4)])
    for cpu, there in zip(*sides, strict=True):
        assert (there.valid == cpu.valid).all()
        for field in ("actions", "rewards"):
            ours, theirs = (getattr(side, field)[cpu.valid] for side in (there, cpu))
            np.testing.assert_array_equal(ours, theirs, field)
        assert torch.equal(there.observations.stores[0], cpu.observations.stores[0])
        np.testing.assert_array_equal(there.last_obs, cpu.last_obs)
    assert not all(side.valid.all() for side in sides[0])  # episodes began within


def test_a_reward_that_is_not_finite_names_its_place():
    rewards, valid = np.zeros((4, 2, 3)), np.ones((4, 2, 3), bool)
    rewards[2, 1, 0], valid[1, 0, 0], rewards[1, 0, 0] = np.nan, False, np.nan
    with pytest.raises(
        DivergedError, match="a reward that is not, in environment 0 at step 2"
    ) as it:
        gpu.check_finite(rewards, valid)
    assert it.value.row == 1
