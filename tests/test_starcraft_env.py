"""The mini-games behind Gymnasium's vector interface: seeds, rewards, ends, images, bad input."""

import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.starcraft.env import StarCraftVectorEnv
from repaint_cli.envs.starcraft.layers import MINIMAP_LAYERS, SCREEN_LAYERS, Spread
from repaint_cli.envs.starcraft.names import RECORDS, SUMS
from repaint_cli.envs.starcraft.reports import scaled
from repaint_cli.envs.starcraft.rts import constants
from repaint_cli.envs.starcraft.rts.constants import ALLY, TERMS
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.tasks.card_files import read_task

PARKS = AutoresetMode.DISABLED


def made(n, autoreset_mode=AutoresetMode.NEXT_STEP, layers="terran", **settings):
    """N games of a minute's fortieth, three steps, where nothing else is said."""
    settings = {"simulator": "starcraft", "minutes": 0.025} | settings
    spec = StarCraftSimulator(**settings).spec
    return StarCraftVectorEnv(MiniRTS(spec, n), n, layers=layers, autoreset_mode=autoreset_mode)


def random_actions(n, t):
    return np.random.default_rng(t).integers([7, 84, 84], size=(64, 3))[:n]


def told(obs, *rest):
    """Everything an environment says, as arrays."""
    return [*obs.values(), *rest[:-1], *rest[-1].values()]


# -- the interface


def test_spaces_and_kinds():
    env = made(3)
    obs, infos = env.reset(seed=0)
    shapes = {name: space.shape for name, space in env.single_observation_space.items()}
    assert shapes == {
        "screen": (84, 84, 9), "minimap": (84, 84, 3), "measurements": (5,), "available": (7,),
    }  # fmt: skip
    assert env.observation_space.contains(obs)
    assert env.single_action_space.nvec.tolist() == [7, 84, 84]
    assert [all(row) for row in env.single_action_space.uses] == [
        True, True, False, False, True, True, False,
    ]  # fmt: skip
    obs, rewards, terminated, truncated, infos = env.step(random_actions(3, 0))
    assert env.observation_space.contains(obs)
    assert set(infos) == {*TERMS, *RECORDS}
    assert all(value.shape == (3,) and value.dtype == np.float64 for value in infos.values())
    assert rewards.dtype == np.float64
    assert terminated.dtype == truncated.dtype == np.bool_


def test_steps_share_no_memory():
    env = made(2)
    before = told(*env.reset(seed=0))
    for t in range(3):
        now = told(*env.step(random_actions(2, t)))
        for one in before:
            assert not any(np.shares_memory(one, other) for other in now)
        before = now


@pytest.mark.parametrize("name", ["build-marines", "build-marines-fdz"])
def test_a_game_depends_on_its_own_seed_alone(name):
    env, one = made(3, map=name), made(1, map=name)
    env.reset(seed=[5, 6, 7])
    one.reset(seed=[7])
    for t in range(8):  # beyond an episode's end
        actions = random_actions(3, t)
        several, single = told(*env.step(actions)), told(*one.step(actions[2:]))
        for arrays, array in zip(several, single, strict=True):
            assert_array_equal(arrays[2:], array)


def test_episodes_follow_one_another():
    env = made(2)
    env.reset(seed=[1, 2])
    ends, seconds = [], []
    for t in range(8):
        _, rewards, terminated, truncated, infos = env.step(random_actions(2, t))
        assert not terminated.any()
        ends.append(bool(truncated.all()))
        seconds.append(infos["seconds"][0])
        if t in (3, 7):  # the step that begins an episode
            assert not rewards.any()
            assert not any(infos[name].any() for name in TERMS)
    assert ends == [False, False, True, False] * 2
    assert seconds == [0.5, 1, 1.5, 0] * 2


def test_a_game_that_is_over_stays_as_it_is_and_costs_nothing():
    env = made(2, PARKS)
    env.reset(seed=[1, 2])
    for t in range(3):
        obs, *_, truncated, _ = env.step(random_actions(2, t))
    assert truncated.all()
    later, rewards, terminated, truncated, infos = env.step(random_actions(2, 9))
    for name, array in obs.items():
        assert_array_equal(array, later[name])
    assert not rewards.any()
    assert not (terminated | truncated).any()
    assert infos["seconds"].tolist() == [1.5, 1.5]


def test_the_reward_is_the_weighted_sum_and_sums_of_terms_are_the_counters():
    card = read_task("build-marines-fdz").with_settings(["env.minutes=1"])
    env = card.make_env(2, one_episode=True)
    env.reset(seed=[1, 2])
    total = np.zeros((2, len(TERMS)))
    weights = np.array([card.reward[name] for name in TERMS])
    for t in range(card.env.longest_episode()):
        _, rewards, _, truncated, infos = env.step(random_actions(2, t))
        terms = np.stack([infos[name] for name in TERMS], 1)
        assert_array_equal(rewards, (terms * weights).sum(1))
        total += terms
        stats = env.unwrapped._engine.stats()
        for name in SUMS:
            assert_array_equal(infos[f"sum_{name}"], total[:, TERMS.index(name)])
            assert_array_equal(infos[f"sum_{name}"], stats[name])
    assert truncated.all()
    assert total[:, : TERMS.index("scvs_trained")].sum(1).min() > 0


# -- bad input


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((2, 2), int), r"expected integer actions \(2, 3\), found \(2, 2\) of int64"),
        (np.zeros((2, 3)), r"expected integer actions \(2, 3\), found \(2, 3\) of float64"),
        ([[0, 0, 0], [7, 0, 0]], "expected a command from 0 to 6, .* found 7, 0 and 0"),
        ([[0, 0, 0], [4, 84, 0]], "a column from 0 to 83 .* found 4, 84 and 0"),
        ([[0, 0, -1], [4, 84, 0]], "a row from 0 to 83, found 0, 0 and -1"),
    ],
)
def test_wrong_actions_are_named(actions, message):
    env = made(2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(actions)


def test_wrong_calls_are_named():
    env = made(2)
    with pytest.raises(ResetNeeded, match="expected reset"):
        env.step(random_actions(2, 0))
    with pytest.raises(ValueError, match="expected 2 seeds, found 1"):
        env.reset(seed=[1])
    with pytest.raises(ValueError, match="expected autoreset NEXT_STEP or DISABLED"):
        made(1, AutoresetMode.SAME_STEP)


# -- what networks see


NOBODYS = ("player_id", ALLY)
"""A layer and a value of it that these games do not have."""


@pytest.mark.parametrize("kinds", [SCREEN_LAYERS, MINIMAP_LAYERS])
@pytest.mark.parametrize("name", SCREEN_LAYERS)
def test_values_of_a_layer_stay_apart_within_a_byte(kinds, name):
    for layer in kinds[name]:
        if layer.name in ("creep", "power") or len(layer.values) == 1:
            assert layer.values == (0,)  # which these games do not have
        else:
            shown = [v for k, v in enumerate(layer.values) if (layer.name, k) != NOBODYS]
            assert len(set(shown)) == len(shown)
            assert 200 < max(layer.values) <= 255


def test_an_image_is_a_look_up_of_every_layer():
    layers = np.random.default_rng(0).integers(0, 9, (2, 9, 84, 84), dtype=np.uint8)
    for kind in SCREEN_LAYERS.values():
        images = Spread(kind)(layers)
        for i, layer in enumerate(kind):
            last = len(layer.values) - 1
            expected = np.array(layer.values)[layers[:, layer.source].clip(max=last)]
            assert_array_equal(images[..., i], expected)


def test_the_engine_and_the_images_name_the_same_layers():
    for kinds, names in (
        (SCREEN_LAYERS, constants.SCREEN_LAYERS), (MINIMAP_LAYERS, constants.MINIMAP_LAYERS),
    ):  # fmt: skip
        for layer in kinds["terran"]:
            assert names[layer.source] == layer.name
    assert len(SCREEN_LAYERS["coach-prefix"]) == 9
    assert len(MINIMAP_LAYERS["coach-prefix"]) == 3


def test_measurements_are_scaled_to_about_one():
    raw = np.array([[0, 0, 0, 0, 0], [2980, 200, 200, 64, 200]], np.int32)
    assert_allclose(scaled(raw), [[0] * 5, [1] * 5], rtol=1e-3)
    assert scaled(raw).dtype == np.float32


def test_other_layers_have_other_names():
    obs, _ = made(1, layers="coach-prefix").reset(seed=0)
    assert list(obs)[:2] == ["screen-coach-prefix", "minimap-coach-prefix"]
    assert obs["screen-coach-prefix"].shape == (1, 84, 84, 9)
    creep, power = 2, 3
    assert not obs["screen-coach-prefix"][..., [creep, power]].any()
