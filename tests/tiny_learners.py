"""Who learns the tiny tasks: students and teachers, untrained and trained."""

import numpy as np
import torch

from repaint_cli.config import TransferConfig
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.teachers import Teacher
from repaint_cli.learn.trainer import train
from repaint_cli.nets import ActorCritic
from repaint_cli.spaces import Spaces


def transferring(**settings):
    """Transfer settings as a method leaves them."""
    return TransferConfig().model_copy(update=settings)


def with_transfer(task, transfer):
    return task.model_copy(update={"transfer": transfer})


def spaces_of(task):
    env = task.make_env(1)
    return Spaces.of(env.single_observation_space, env.single_action_space)


def learner_of(task, seeds):
    """A learner at its beginning."""
    student = ActorCritic(spaces_of(task), task.net, len(seeds))
    return Learner.fresh(student, list(seeds), task.ppo.learning_rate)


def stranger(task, n_seeds=1, seed=99):
    """A teacher that knows nothing, the same for every seed, with statistics of its own."""
    teacher = ActorCritic(spaces_of(task), task.net, n_seeds)
    teacher.initialize([np.random.default_rng(seed) for _ in range(n_seeds)])
    if teacher.normalizer:
        for s in range(n_seeds):
            obs = np.random.default_rng(seed).normal(0.5, 2.0, (50, *teacher.spaces.obs_shape))
            teacher.normalizer.update(s, torch.from_numpy(obs))
    return teacher


def taught_by(*networks, **known):
    """Teachers with these policies; None among them is nobody."""
    return [Teacher(network, **known) for network in networks if network]


def trained(task, seeds=(0,), teacher=None, **transfer):
    """Train to the end; return the learner and what was yielded."""
    learner, task = learner_of(task, seeds), with_transfer(task, transferring(**transfer))
    return learner, list(train(task, learner, taught_by(teacher)))
