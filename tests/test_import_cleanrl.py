"""State dicts laid out as cleanrl's PPO scripts lay out their agents."""

import numpy as np
import pytest
import torch
from foreign_policies import ACTIONS, PICTURE, VECTOR, task_of
from gymnasium.spaces import Box, Discrete
from torch import nn

from repaint_cli.errors import CheckpointError, TeacherMismatch, UsageError
from repaint_cli.learn.evaluation import environment_spaces
from repaint_cli.policies.spaces import Spaces
from repaint_cli.zoo.importers import cleanrl
from repaint_cli.zoo.importers.imported import as_teacher
from repaint_cli.zoo.importers.statistics import statistics_of

N, A = 300, 3
ATARI = Box(0, 255, (84, 84, 4), np.uint8)


def dense(n_in, n_out, width=64):
    return nn.Sequential(
        nn.Linear(n_in, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh(),
        nn.Linear(width, n_out),
    )  # fmt: skip


class Discretely(nn.Module):
    def __init__(self, width=64):
        super().__init__()
        self.critic, self.actor = dense(5, 1), dense(5, 4, width)

    def forward(self, x):
        return self.actor(x), self.critic(x)


class Continuously(nn.Module):
    def __init__(self):
        super().__init__()
        self.critic, self.actor_mean = dense(5, 1), dense(5, A)
        self.actor_logstd = nn.Parameter(torch.randn(1, A))

    def forward(self, x):
        return self.actor_mean(x), self.critic(x)


class Atari(nn.Module):
    def __init__(self):
        super().__init__()
        self.network = nn.Sequential(
            nn.Conv2d(4, 32, 8, stride=4), nn.ReLU(), nn.Conv2d(32, 64, 4, stride=2), nn.ReLU(),
            nn.Conv2d(64, 64, 3, stride=1), nn.ReLU(), nn.Flatten(), nn.Linear(64 * 7 * 7, 512),
            nn.ReLU(),
        )  # fmt: skip
        self.actor, self.critic = nn.Linear(512, 4), nn.Linear(512, 1)

    def forward(self, x):
        hidden = self.network(x / 255.0)
        return self.actor(hidden), self.critic(hidden)


def saved(tmp_path, agent, **changes):
    path = tmp_path / "agent.cleanrl_model"
    torch.save(agent.state_dict() | changes, path)
    return path


def imported(path, task, vecnormalize=None):
    spaces = environment_spaces(task)
    policy, seen = cleanrl.read(path, Spaces.of(*spaces))
    return as_teacher(policy, statistics_of(path, vecnormalize, seen), "guest", task, spaces)


def assert_same(agent, network, raw, seen):
    with torch.no_grad():
        out, values = agent(seen)
        policy, found = network.policy(raw[None]), network.value(raw[None])[0]
    if network.spaces.discrete:
        mine, theirs = policy.log_probs[0], torch.log_softmax(out, -1)
    else:
        mine, theirs = policy.mean[0], out
        assert torch.equal(policy.log_std[0, 0], agent.actor_logstd[0])
    for one, other in ((mine, theirs), (found, values[:, 0])):
        assert (one - other).abs().max() <= 1e-6 * max(1.0, other.abs().max())


@pytest.mark.parametrize("width", [64, 24])
def test_the_script_for_discrete_actions(tmp_path, width):
    agent, obs = Discretely(width), torch.randn(N, 5)
    network, card = imported(saved(tmp_path, agent), task_of(VECTOR, ACTIONS["discrete"]))
    assert_same(agent, network, obs, obs)
    assert (card.algorithm, card.method, card.seed, card.env_steps) == ("ppo", "imported", 0, 0)
    assert card.task.net.value_hidden == (None if width == 64 else (64, 64))


def test_the_script_for_continuous_actions_needs_the_statistics_of_its_wrapper(tmp_path):
    agent, task = Continuously(), task_of(VECTOR, ACTIONS["box"])
    path, stats = saved(tmp_path, agent), tmp_path / "stats.npz"
    with pytest.raises(UsageError, match=r"an \.npz of mean and var, or --vecnormalize none"):
        imported(path, task)
    mean, var = np.linspace(-2, 2, 5), np.geomspace(1e-4, 100, 5)
    np.savez(stats, mean=mean, var=var)
    raw = mean + 3 * np.sqrt(var) * np.random.default_rng(0).normal(size=(N, 5))
    raw = raw.astype(np.float32)
    seen = np.clip((raw - mean) / np.sqrt(var + 1e-8), -10, 10).astype(np.float32)
    network, _ = imported(path, task, str(stats))
    assert_same(agent, network, torch.from_numpy(raw), torch.from_numpy(seen))
    network, _ = imported(path, task, "none")
    assert_same(agent, network, torch.from_numpy(raw), torch.from_numpy(raw))


def test_the_script_for_atari(tmp_path):
    agent = Atari()
    obs = torch.randint(256, (N, *ATARI.shape), dtype=torch.uint8)
    network, card = imported(saved(tmp_path, agent), task_of(ATARI, Discrete(4)))
    assert_same(agent, network, obs, obs.permute(0, 3, 1, 2))
    assert card.obs_shape == ATARI.shape


WRAPPED = {
    "compiled": torch.compile,
    "data parallel": nn.DataParallel,
    "both": lambda agent: torch.compile(nn.DataParallel(agent)),
}


@pytest.mark.filterwarnings("ignore:.torch.jit.script_method:DeprecationWarning")
@pytest.mark.parametrize("wrap", WRAPPED.values(), ids=WRAPPED)
@pytest.mark.parametrize("kind", [Discretely, Continuously])
def test_names_of_compiled_and_parallel_agents_are_read(tmp_path, wrap, kind):
    agent, obs = kind(), torch.randn(N, 5)
    action = ACTIONS["discrete" if kind is Discretely else "box"]
    path = saved(tmp_path, wrap(agent))
    network, _ = imported(path, task_of(VECTOR, action), "none")
    assert_same(agent, network, obs, obs)
    agent.critic = wrap(agent.critic)
    network, _ = imported(saved(tmp_path, agent), task_of(VECTOR, action), "none")
    assert_same(agent, network, obs, obs)


def test_a_parameter_under_two_names_is_refused(tmp_path):
    path = saved(tmp_path, Discretely(), **{"_orig_mod.actor.0.bias": torch.ones(64)})
    with pytest.raises(CheckpointError, match=r"actor\.0\.bias' both wrapped and not wrapped"):
        cleanrl.read(path, Spaces((5,), 4, True))


def test_the_script_for_two_players_scales_some_channels_alone_and_is_refused(tmp_path):
    agent = Atari()
    agent.network[0] = nn.Conv2d(6, 32, 8, stride=4)
    message = r"of 6 channels, as ppo_pettingzoo_ma_atari\.py has them.* what can be read"
    with pytest.raises(CheckpointError, match=message):
        cleanrl.read(saved(tmp_path, agent), Spaces((84, 84, 6), 4, True))


def test_what_does_not_fit_the_task_is_refused(tmp_path):
    path = saved(tmp_path, Atari())
    with pytest.raises(TeacherMismatch, match=r"'guest' has 44×40×4 obs.* 'dream' has 44×40×2"):
        imported(path, task_of(PICTURE, Discrete(4)))
    with pytest.raises(TeacherMismatch, match=r"'guest' has 84×84×4 obs.* 'dream' has 5 obs"):
        imported(path, task_of(VECTOR, Discrete(4)))
    first = Box(0, 255, (4, 84, 84), np.uint8)
    with pytest.raises(TeacherMismatch, match=r"channels last, 84×84×4; found 4×84×84: let the"):
        imported(path, task_of(first, Discrete(4)))
    small = Box(0, 255, (60, 60, 4), np.uint8)
    message = r"'policy.dense.weight' is \(3136, 512\), for 60×60×4 .* must be \(1024, 512\)"
    with pytest.raises(TeacherMismatch, match=message):
        imported(path, task_of(small, Discrete(4)))
    stats = tmp_path / "stats.npz"
    np.savez(stats, mean=np.zeros(3), var=np.ones(3))
    path = saved(tmp_path, Continuously())
    with pytest.raises(TeacherMismatch, match="reads 5 numbers, the statistics are of 3"):
        imported(path, task_of(VECTOR, ACTIONS["box"]), str(stats))
    path = saved(tmp_path, Atari())
    with pytest.raises(
        UsageError, match="no statistics of images, found some: --vecnormalize none"
    ):
        imported(path, task_of(ATARI, Discrete(4)), str(stats))


MORE = {
    "an lstm": {"lstm.weight_ih_l0": torch.ones(2, 2)},
    "a deeper critic": {"critic.6.weight": torch.ones(2, 2)},
    "a spread": {"logstd": torch.ones(2)},
}


@pytest.mark.parametrize("more", MORE.values(), ids=MORE)
def test_agents_with_more_parameters_are_refused(tmp_path, more):
    path = saved(tmp_path, Discretely(), **more)
    (name,) = more
    with pytest.raises(CheckpointError, match=f"'{name}' belongs to no policy that can be read"):
        cleanrl.read(path, Spaces((5,), 4, True))


def test_agents_of_other_scripts_are_refused(tmp_path):
    torch.save({"network.0.weight": torch.ones(2, 2)}, tmp_path / "dqn")
    message = (
        r"found parameters network\.0\.weight, … of another script; what can be read: ppo\.py, "
        r"ppo_continuous_action\.py and ppo_atari\.py"
    )
    with pytest.raises(CheckpointError, match=message):
        cleanrl.read(tmp_path / "dqn", Spaces((5,), 4, True))
    path = saved(tmp_path, Discretely())
    state = torch.load(path, weights_only=True)
    del state["actor.2.bias"]
    torch.save(state, path)
    with pytest.raises(CheckpointError, match=r"expected 'actor\.2\.bias', found none"):
        cleanrl.read(path, Spaces((5,), 4, True))


def test_a_whole_agent_is_refused_and_not_run(tmp_path):
    torch.save(Discretely(), tmp_path / "agent.pt")
    with pytest.raises(CheckpointError, match="holds no plain tensors") as refused:
        cleanrl.read(tmp_path / "agent.pt", Spaces((5,), 4, True))
    assert "\n" not in str(refused.value)
    torch.save([torch.ones(2)], tmp_path / "list.pt")
    with pytest.raises(CheckpointError, match="expected tensors by name, found list"):
        cleanrl.read(tmp_path / "list.pt", Spaces((5,), 4, True))
