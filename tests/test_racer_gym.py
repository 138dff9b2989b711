"""The racer for other libraries: registered in Gymnasium, and as Gymnasium wants environments."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

import repaint_cli  # noqa: F401 - registers it
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.files.paths import shipped
from repaint_cli.tasks.card import TaskCard

ID = "repaint/Racer-v0"
RANGES = {"actions": {"steering_angle": [-30, 30], "speed": [0.5, 2]}}
TRAFFIC = {"sensors": "stereo+lidar", "n_bots": 2, "reward": {"lane": 1.0, "hazard": -1.0}}
KINDS = {"alone": {}, "traffic": TRAFFIC, "ranges": RANGES}


@pytest.mark.parametrize(
    ("first", "name"),
    [
        ("import gymnasium", f"repaint_cli:{ID}"),
        ("import gymnasium, repaint_cli", ID),
        ("import repaint_cli, gymnasium", ID),
        ("import repaint_cli, gymnasium", f"repaint_cli:{ID}"),
        ("import repaint_cli, importlib.util; importlib.util.find_spec('gymnasium')", ID),
    ],
)
def test_it_is_registered_in_whatever_order_both_are_imported(first, name):
    code = (
        f"{first}; import sys; from gymnasium.envs.registration import _find_spec; "
        f"print(_find_spec('{name}').id); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found, modules = done.stdout.splitlines()
    assert found == ID
    assert not {"numba", "torch", "numpy.testing"} & set(modules.split())
    assert done.stderr == ""


def test_waypoints_are_numbered_as_in_the_file_or_uniquely(tmp_path):
    rows = np.load(shipped("tasks") / "racer" / "tracks" / "oval.npy")
    file = str(tmp_path / "twice.npy")
    np.save(file, np.insert(rows, 30, rows[30], axis=0))
    for how, n in (("file", len(rows) + 1), ("unique", len(rows))):
        cars = gymnasium.make_vec(f"repaint_cli:{ID}", num_envs=1, track=file, waypoints=how)
        assert len(cars.unwrapped.tracks[0].waypoints[0]) == n
    with pytest.raises(ValueError, match="waypoints"):
        gymnasium.make_vec(f"repaint_cli:{ID}", num_envs=1, waypoints="twice")


def test_importing_repaint_does_not_import_gymnasium():
    code = "import repaint_cli, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"gymnasium", "numpy", "torch"} & set(done.stdout.split())


@pytest.mark.parametrize("kwargs", KINDS.values(), ids=KINDS)
def test_gymnasium_finds_nothing_wrong_with_one_car(kwargs):
    check_env(gymnasium.make(f"repaint_cli:{ID}", **kwargs).unwrapped)


@pytest.mark.parametrize("kwargs", KINDS.values(), ids=KINDS)
def test_many_cars_are_our_fast_ones_and_do_what_single_ones_do(kwargs):
    fast = gymnasium.make_vec(f"repaint_cli:{ID}", num_envs=3, max_episode_steps=12, **kwargs)
    assert isinstance(fast.unwrapped, RacerVectorEnv)
    assert fast.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    single = [gymnasium.make(ID, max_episode_steps=12, **kwargs) for _ in range(3)]
    copies = gymnasium.vector.SyncVectorEnv([lambda env=env: env for env in single])
    assert fast.single_observation_space == copies.single_observation_space
    seen = [env.reset(seed=7)[0] for env in (fast, copies)]
    rng, ends = np.random.default_rng(0), 0
    for _ in range(20):  # over the end of an episode, and into the next one
        for one, other in zip(*map(parts_of, seen), strict=True):
            assert_array_equal(one, other)
        assert seen[0] in fast.observation_space
        actions = rng.uniform(-1, 1, (3, 2)) if kwargs is RANGES else rng.integers(10, size=3)
        one, other = (env.step(actions) for env in (fast, copies))
        for mine, copy in zip(one[1:4], other[1:4], strict=True):
            assert_array_equal(mine, copy)
        assert_array_equal(one[4]["x"], other[4]["x"])
        seen, ends = [one[0], other[0]], ends + one[3].sum()
    assert ends == 3
    fast.close()
    copies.close()


def parts_of(obs):
    return obs.values() if isinstance(obs, dict) else [obs]


def test_the_reward_is_of_the_terms_that_are_named():
    env = gymnasium.make(ID, reward={"lane": 2.0, "dprog": 10.0})
    env.reset(seed=0, options={"lap_fraction": 0.25})
    _, reward, _, _, info = env.step(7)
    assert reward == pytest.approx(2 * info["lane"] + 10 * info["dprog"])
    assert env.unwrapped.reset(options={"lap_fraction": 0.25})[1]["x"] != pytest.approx(
        env.reset(options={"lap_fraction": 0.75})[1]["x"]
    )


@pytest.mark.parametrize(
    ("kwargs", "line"),
    [
        ({"reward": {"lnae": 1.0}}, "unknown reward 'lnae'; choose one of dprog, fail, keep, lane"),
        ({"reward": {"hazard": 1.0}}, "'hazard'"),  # needs bots
        ({"car": "sim9"}, "sim9"),
    ],
)
def test_wrong_arguments_are_named(kwargs, line):
    with pytest.raises(ValueError, match=line):
        gymnasium.make(ID, **kwargs)


def test_it_is_drawn_as_its_camera_sees_it():
    env = gymnasium.make(ID, render_mode="rgb_array")
    obs, _ = env.reset(seed=0)
    assert_array_equal(env.render(), np.repeat(obs, 3, axis=2))


def test_a_card_can_name_it_too():
    card = TaskCard.parse(
        {
            "name": "mine", "summary": "", "reward": {"lane": 1.0},
            "env": {"simulator": "gymnasium", "id": f"repaint_cli:{ID}"},
            "net": {"kind": "cnn"},
        },
        "a test",
    )  # fmt: skip
    assert card.env.longest_episode() == 1500


@pytest.mark.parametrize("kwargs", [{}, {"reward": {"lane": 1.0}}])
def test_stable_baselines3_learns_on_it(kwargs):
    sb3 = pytest.importorskip("stable_baselines3", reason="needs Stable-Baselines3")
    from stable_baselines3.common.env_util import make_vec_env

    envs = make_vec_env(f"repaint_cli:{ID}", n_envs=2, env_kwargs=kwargs)
    net = {"features_extractor_kwargs": {"features_dim": 8}}
    learner = sb3.PPO(
        "CnnPolicy", envs, n_steps=8, batch_size=16, n_epochs=1, policy_kwargs=net, device="cpu"
    )
    learner.learn(16)
    assert learner.num_timesteps == 16
