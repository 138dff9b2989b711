"""Let a policy play, deterministically, and say how it went."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from repaint_cli.envs.simulator import GymEnv
from repaint_cli.learn.rollout.collect import Policy, clip, collect, start
from repaint_cli.learn.rollout.observations import each
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose, env_seeds, generator
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.tasks.task import TaskCard


@dataclass(frozen=True)
class Episodes:
    """E episodes of each of S policies."""

    returns: np.ndarray
    """Undiscounted sum of the rewards, (S, E)."""
    lengths: np.ndarray
    """Steps, (S, E)."""
    terms: np.ndarray
    """Undiscounted sums of the reward terms φ, (S, E, F)."""
    rewards: np.ndarray
    """Reward per step, (T, S, E), nan after the end."""
    actions: np.ndarray
    """What the environment was told, (T, S, E[, A]); continuous actions within their bounds."""
    records: dict[str, np.ndarray]
    """The racer's state after each step, (T, S, E, …), nan after the end; empty elsewhere."""
    env_seeds: list[int]
    """The environments' seeds, (S · E,), seed by seed."""
    paths: np.ndarray | None
    """Where the car or the fingertip was, (S, E, T, 2) in m, nan after the end."""
    targets: np.ndarray | None
    """Where the fingertip should go, (S, E, 2) in m."""

    sights: list[list[Any]] | None = None
    """What the car saw after each step, [S][E] of observations (T, *O), where it was asked for."""

    @property
    def progress(self) -> np.ndarray | None:
        """The share of a lap driven when the episode ended, (S, E) in %; None off the track."""
        return self._last("progress")

    @property
    def status(self) -> np.ndarray | None:
        """How each racing episode ended, (S, E) codes of the racer's STATUS."""
        return self._last("status")

    @property
    def lap_times(self) -> np.ndarray | None:
        """How long each whole lap took, (S, E) in s, nan where there was none."""
        seconds, progress = self._last("lap_time"), self.progress
        if seconds is None or progress is None:
            return None
        return np.where(progress >= 100, seconds, np.nan)

    def of_seed(self, s: int) -> "Episodes":
        """Return the episodes of one of the policies, without what it saw."""
        only, per = slice(s, s + 1), len(self.env_seeds) // len(self.returns)
        return Episodes(
            returns=self.returns[only],
            lengths=self.lengths[only],
            terms=self.terms[only],
            rewards=self.rewards[:, only],
            actions=self.actions[:, only],
            records={name: rows[:, only] for name, rows in self.records.items()},
            env_seeds=self.env_seeds[s * per : (s + 1) * per],
            paths=None if self.paths is None else self.paths[only],
            targets=None if self.targets is None else self.targets[only],
        )

    def _last(self, name: str) -> np.ndarray | None:
        if name not in self.records:
            return None
        ends = self.lengths[None] - 1
        last: np.ndarray = np.take_along_axis(self.records[name], ends, axis=0)[0]
        return last


def spaces_of(task: TaskCard) -> Spaces:
    """Return what policies of a task read and write.

    Raises:
        CardError: the task's environment cannot be made or lacks a reward term.
    """
    return try_out(task)[0]


def try_out(task: TaskCard) -> tuple[Spaces, dict[str, float]]:
    """Take a random first step in a task; return its spaces and the reward terms of the step.

    Raises:
        CardError: the task's environment cannot be made or lacks a reward term.
    """
    env = task.make_env(1)
    spaces = Spaces.of(env.single_observation_space, env.single_action_space)
    env.reset(seed=[0])
    env.action_space.seed(0)
    *_, info = env.step(env.action_space.sample())
    env.close()
    return spaces, dict(zip(env.names, info["reward_terms"][0].tolist(), strict=True))


def evaluate(
    policy: Policy | ActorCritic,
    task: TaskCard,
    seeds: list[int],
    n_episodes: int,
    iteration: int = 0,
    purpose: Purpose = Purpose.EVALUATE,
    *,
    keep_sights: bool = False,
) -> Episodes:
    """Play E episodes with each seed's most likely actions.

    The environments' seeds depend on the run seed, the purpose and the iteration, never on the
    method, so that methods meet the same episodes. Racing cards add the paper's small noise and
    spread the starts over the lap: a deterministic car from one start would be one episode E times.

    Args:
        policy: S policies.
        task: whose environment and rewards.
        seeds: the run seeds, (S,).
        n_episodes: E.
        iteration: after which iteration.
        purpose: EVALUATE during training, SCORE for a teacher's score.
        keep_sights: whether to return what the car saw.
    """
    act = policy.policy if isinstance(policy, ActorCritic) else policy
    noise = task.eval.noise == "paper"
    env, obs = start(task, seeds, n_episodes, purpose, iteration, one_episode=True, noise=noise)
    rngs = [generator(seed, purpose, iteration) for seed in seeds]
    rollout = collect(env, obs, act, rngs, greedy=True, record=task.env.records)
    rollout = replace(rollout, actions=clip(rollout.actions, env))
    env.close()
    played = _episodes(task, rollout, env_seeds(seeds, purpose, iteration, n_episodes))
    return replace(played, sights=_sights(rollout)) if keep_sights else played


def _episodes(task: TaskCard, rollout: Rollout, seeds: list[int]) -> Episodes:
    valid = rollout.valid
    records = {
        name: np.where(valid.reshape(*valid.shape, *[1] * (rows.ndim - 3)), rows, np.nan)
        for name, rows in rollout.records.items()
    }
    paths, targets = _paths(task, rollout, records)
    return Episodes(
        returns=(rollout.rewards * valid).sum(0),
        lengths=valid.sum(0),
        terms=(rollout.reward_terms * valid[..., None]).sum(0),
        rewards=np.where(valid, rollout.rewards, np.nan),
        actions=rollout.actions,
        records=records,
        env_seeds=seeds,
        paths=paths,
        targets=targets,
    )


def has_paths(task: TaskCard) -> bool:
    """Tell whether a task's episodes lead along paths: a car's, or the fingertip's of Reacher."""
    return not isinstance(task.env, GymEnv) or task.env.id == "Reacher-v5"


def _paths(
    task: TaskCard, rollout: Rollout, records: dict[str, np.ndarray]
) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Return where things went, (S, E, T, 2), and where they should, (S, E, 2)."""
    if records:
        xy = np.stack([records["x"], records["y"]], -1)  # (T, S, E, 2)
        return np.moveaxis(xy, 0, 2), None
    if not has_paths(task):
        return None, None
    stores = [store.numpy() for store in rollout.observations.stores]
    obs = np.stack([store[rollout.index[:, s]] for s, store in enumerate(stores)])  # (S, T+1, E, O)
    target, gap = obs[..., 4:6], obs[..., 8:10]  # the gap is fingertip − target
    seen = np.concatenate([rollout.valid[:1], rollout.valid]).transpose(1, 0, 2)[..., None]
    return np.where(seen, target + gap, np.nan).transpose(0, 2, 1, 3), target[:, 0]


def _sights(rollout: Rollout) -> list[list[Any]]:
    """Return the observation that followed each step of each episode, [S][E] of (T, *O)."""
    return [
        [
            each(lambda part, rows: part.numpy()[rows], store, after[valid])
            for after, valid in zip(rollout.index[1:, s].T, rollout.valid[:, s].T, strict=True)
        ]
        for s, store in enumerate(rollout.observations.stores)
    ]
