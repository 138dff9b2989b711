"""Commands and files small enough to make in a moment, for tests of everything around learning."""

import numpy as np
import torch

from repaint_cli import zoo
from repaint_cli.cards import read_task
from repaint_cli.checkpoint import policy_tensors
from repaint_cli.nets import ActorCritic
from repaint_cli.provenance import versions
from repaint_cli.spaces import Spaces
from repaint_cli.teacher_card import TeacherCard

REACHER = Spaces((10,), 2, False)
QUICK = [
    *("--iterations", 2, "--eval-episodes", 2),
    *("--set", "ppo.n_steps=204", "--set", "ppo.n_envs=4", "--set", "ppo.n_epochs=1"),
]
"""Options of a Reacher run of a moment."""

QUICK_LAP = [
    *("--iterations", 2, "--eval-episodes", 2),
    *("--set", "env.max_steps=6", "--set", "ppo.n_episodes=3", "--set", "ppo.n_epochs=1"),
    *("--set", "net.conv=[[4,8,8]]", "--set", "net.dense=8"),
]
"""The same for the racer."""


def add_teacher(folder, name="old-hand", task="reacher", spaces=REACHER, settings=(), **changes):
    """Put a teacher that knows nothing into a folder."""
    task = read_task(task).with_settings(list(settings))
    network = ActorCritic(spaces, task.net, 1)
    network.initialize([np.random.default_rng(1)])
    with torch.no_grad():  # heads begin near 0: make the teacher opinionated
        network.weights["policy.head.weight"] *= 100
    card = TeacherCard(
        name=name, task=task, obs_shape=spaces.obs_shape, n_actions=spaces.n_actions,
        discrete=spaces.discrete, method="scratch", seed=0, iteration=1, env_steps=10,
        versions=versions(), created="2021-07-18T00:00:00+00:00",
    ).model_copy(update=changes)  # fmt: skip
    return zoo.add(network, 0, card, folder)


def weights_of(path):
    """What a teacher's file holds."""
    network, _ = zoo.load_teacher(path)
    return {name: leaf.detach().clone() for name, leaf in policy_tensors(network).items()}


def files_below(folder):
    """Every file's bytes, by where it is."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
