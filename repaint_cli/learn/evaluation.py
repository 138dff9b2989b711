"""Evaluation: whole episodes of a policy's most likely actions, or as it draws them."""

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

from repaint_cli.activity import doing
from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.reward_functions import Functions
from repaint_cli.envs.reward_terms import numbers_in
from repaint_cli.errors import CardError
from repaint_cli.learn.rollout.collect import Policy, clip, collect, start
from repaint_cli.learn.rollout.observations import each
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose, env_seeds, generator
from repaint_cli.policies.mirror import PolicyNetwork
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.task import Task

LONGEST_TRY = 1000
"""Steps in which each reward term must be reported once."""


def spaces_of(task: Task) -> Spaces:
    """Return what policies of a task read and write; see `environment_spaces`."""
    return Spaces.of(*environment_spaces(task))


def environment_spaces(
    task: Task,
) -> tuple[gymnasium.Space, gymnasium.Space]:  # type: ignore[type-arg]
    """Return the spaces of a task's environment: of observations, and of actions.

    Steps are taken until each reward term was reported once, which is one step for most tasks.

    Raises:
        CardError: the task's environment cannot be made, has spaces that no policy reads or
            writes, or never reports a reward term.
    """
    env = task.make_env(1)
    spaces = env.single_observation_space, env.single_action_space
    Spaces.of(*spaces)
    env.reset(seed=[0])
    env.action_space.seed(0)
    reported, ended, t = set[str](), False, 0
    while env.unreported and not ended:
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        reported, t = reported | ({*numbers_in(info)} - env.unreported), t + 1
        # only Gymnasium's environments may leave terms out, and those with a time limit end
        ended = task.env.reward_terms is not None or bool(terminated[0] or truncated[0])
        ended |= t == LONGEST_TRY
    env.close()
    if env.unreported:
        raise never_reported(env.unreported, reported, t)
    return spaces


def never_reported(missing: Iterable[str], reported: Iterable[str], n_steps: int) -> CardError:
    """Return the error of reward terms or positions that no step reported, and what others did."""
    names = ", ".join(f"'{name}'" for name in sorted(missing))
    steps = f" in {n_steps} steps" if n_steps > 1 else ""
    others = ", ".join(sorted(set(reported))) or "nothing"
    return CardError(f"the environment reports no {names}{steps}; its info has: {others}")


def evaluate(
    policy: Policy | PolicyNetwork,
    task: TaskCard,
    seeds: list[int],
    n_episodes: int,
    iteration: int = 0,
    purpose: Purpose = Purpose.EVALUATE,
    *,
    keep_observations: bool = False,
    functions: Functions | None = None,
) -> Episodes:
    """Play episodes with each seed's most likely actions, unless the card says otherwise.

    The environments' seeds depend on the run seed, the purpose and the iteration, never on the
    method, so that methods meet the same episodes. Racing cards add the paper's small noise and
    spread the starts over the lap: a deterministic car from one start would be one episode E times.

    Args:
        policy: S policies.
        task: whose environment and rewards.
        seeds: the run seeds, (S,).
        n_episodes: at least so many; E is a few more where `Simulator.even_episodes` says so.
        iteration: after which iteration.
        purpose: EVALUATE during training, SCORE for a teacher's score.
        keep_observations: whether to return what the policies observed.
        functions: the user's reward functions of earlier evaluations, whose variables go on.
    """
    rollout, episodes = play(
        policy, task, seeds, n_episodes, iteration, purpose,
        functions=functions, keep_images=keep_observations,
    )  # fmt: skip
    return replace(episodes, observations=_observations(rollout)) if keep_observations else episodes


def play(
    policy: Policy | PolicyNetwork,
    task: TaskCard,
    seeds: list[int],
    n_episodes: int,
    iteration: int = 0,
    purpose: Purpose = Purpose.EVALUATE,
    *,
    functions: Functions | None = None,
    keep_images: bool = True,
) -> tuple[Rollout, Episodes]:
    """Play episodes, and return them step by step, too; see `evaluate` and `collect`."""
    act = policy.policy if isinstance(policy, PolicyNetwork) else policy
    noise, n_episodes = task.eval.noise == "paper", task.env.even_episodes(n_episodes)
    env, obs = start(
        task, seeds, n_episodes, purpose, iteration,
        one_episode=True, noise=noise, functions=functions,
    )  # fmt: skip
    rngs = [generator(seed, purpose, iteration) for seed in seeds]
    with doing("playing" if purpose is Purpose.SCORE else "evaluating"):
        rollout = collect(
            env, obs, act, rngs, greedy=task.eval.actions == "likeliest",
            record=task.env.records, keep_images=keep_images,
        )  # fmt: skip
    rollout = replace(rollout, actions=clip(rollout.actions, env))
    env.close()
    return rollout, _episodes(task, rollout, env_seeds(seeds, purpose, iteration, n_episodes))


def _episodes(task: Task, rollout: Rollout, seeds: list[int]) -> Episodes:
    valid = rollout.valid
    records = {
        name: np.where(valid.reshape(*valid.shape, *[1] * (rows.ndim - 3)), rows, np.nan)
        for name, rows in rollout.records.items()
    }

    def observations() -> np.ndarray:
        stores = [store.numpy() for store in rollout.observations.stores]
        return np.stack([store[rollout.index[:, s]] for s, store in enumerate(stores)])

    finder, positions, targets = task.env.paths, None, None
    if finder is not None:
        positions, targets = finder.paths_of(valid, records, observations)
    return Episodes(
        returns=sum(rollout.rewards * valid),  # step by step, however many episodes there are
        lengths=valid.sum(0),
        terms=sum(rollout.reward_terms * valid[..., None]),
        rewards=np.where(valid, rollout.rewards, np.nan),
        actions=rollout.actions,
        records=records,
        env_seeds=seeds,
        paths=positions,
        targets=targets,
    )


def _observations(rollout: Rollout) -> list[list[Any]]:
    """Return the observation that followed each step of each episode, [S][E] of (T, *O)."""
    return [
        [
            each(lambda part, rows: part.numpy()[rows], store, after[valid])
            for after, valid in zip(rollout.index[1:, s].T, rollout.valid[:, s].T, strict=True)
        ]
        for s, store in enumerate(rollout.observations.stores)
    ]
