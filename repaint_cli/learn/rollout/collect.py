"""Act in S × N environments with a policy until every seed has enough steps or episodes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.reward_functions import Functions
from repaint_cli.envs.reward_terms import RewardTerms
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.extent import Extent
from repaint_cli.learn.rollout.gpu import GpuRollout
from repaint_cli.learn.rollout.noise import ActionNoise
from repaint_cli.learn.rollout.observations import arrays_of, each
from repaint_cli.learn.rollout.storage import Rollout, RolloutBuilder
from repaint_cli.learn.seeding import Purpose, env_seeds
from repaint_cli.learn.side_by_side import one_thread
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.distributions import Distribution
from repaint_cli.tasks.card import TaskCard

Policy = Callable[[Any, Sequence[int]], Distribution]
"""Maps observations (S, B, *O), the first counts[s] of them real, to distributions."""


def start(
    card: TaskCard,
    seeds: list[int],
    n_envs: int,
    purpose: Purpose,
    iteration: int,
    *,
    stream: int = 0,
    one_episode: bool = False,
    noise: bool = False,
    replayable: bool = False,
    functions: Functions | None = None,
    playing: np.ndarray | None = None,
    on_gpu: bool = False,
) -> tuple[RewardTerms, Any]:
    """Make and reset S × N environments with seeds of their own; return the first observations.

    Evaluation starts are spread over the task's starts; training starts go on where the last
    iteration's ended. Those that are not `playing`, (S, N), will play no episode.
    """
    spread = purpose in (Purpose.EVALUATE, Purpose.SCORE)
    env = card.make_env(
        len(seeds) * n_envs,
        one_episode=one_episode,
        noise=card.eval if noise or not spread else None,
        training=not spread,
        replayable=replayable,
        functions=functions,
        on_gpu=on_gpu,
    )
    options = card.start_options(len(seeds), n_envs, None if spread else iteration)
    if options is not None and playing is not None:
        options |= {"parked": ~playing.ravel()}
    obs, _ = env.reset(seed=env_seeds(seeds, purpose, iteration, n_envs, stream), options=options)
    return env, obs


def collect(
    env: RewardTerms,
    obs: Any,
    policy: Policy,
    rngs: Sequence[np.random.Generator],
    *,
    n_steps: int | None = None,
    whole: bool = False,
    each_steps: int | None = None,
    playing: np.ndarray | None = None,
    ended: np.ndarray | None = None,
    greedy: bool = False,
    record: Sequence[str] = (),
    keep_images: bool = True,
) -> Rollout:
    """Let a policy act until every seed has enough.

    Args:
        env: S · N environments, seed by seed, already reset.
        obs: their first observations, (S · N, *O), or several such arrays by name.
        policy: who acts.
        rngs: one generator per seed for the actions.
        n_steps: valid steps per seed; where this and `each_steps` are absent, every environment
            plays exactly one episode.
        whole: whether episodes that run when a seed has `n_steps` go on to their ends.
        each_steps: steps of every environment, with those that begin an episode among them: seeds
            then stop together, and the environments can go on from there.
        playing: which environments play an episode, where each plays one, (S, N); all where absent.
        ended: where an episode ended before the first step, which begins another, (S, N).
        greedy: take the most likely action instead of a sample.
        record: further numbers to keep from `info`.
        keep_images: whether to keep observations that are images, up to 150 MB an episode.

    Raises:
        DivergedError: an observation or a reward is not finite.
    """
    shape = (len(rngs), env.num_envs // len(rngs))  # (S, N)
    act = _ActingPolicy(policy, ActionNoise(rngs, shape[1]), greedy)
    resetting = np.zeros(shape, bool) if ended is None else ended
    with torch.no_grad(), one_thread():
        extent = Extent(shape, n_steps, whole, each_steps)
        if playing is not None:
            extent.running &= playing
        if env.device_env is not None:
            assert not greedy  # only training drives there
            return GpuRollout(env, obs, shape, record).roll(policy, rngs, extent, resetting)
        builder = RolloutBuilder(shape, record, keep_images)
        return _roll(env, obs, act, builder, extent, resetting)


def _roll(
    env: RewardTerms,
    obs: Any,
    act: "_ActingPolicy",
    builder: RolloutBuilder,
    extent: Extent,
    resetting: np.ndarray,
) -> Rollout:
    """Act and step until every seed has enough; see `collect`."""
    shape, acted = builder.shape, np.zeros(builder.shape, bool)
    while True:
        valid = extent.valid(resetting)
        last_obs = obs
        obs = each(lambda array: array.reshape(*shape, *array.shape[1:]), obs)
        for array in arrays_of(obs):
            _check_finite(array, valid | acted, "an observation", builder.n_steps)
        builder.add_observations(obs, valid | acted)
        if not extent.running.any():
            return builder.build(last_obs)
        actions, envs, distribution = act(obs, valid)
        obs, *outcomes, info = env.step(clip(actions, env).reshape(-1, *actions.shape[2:]))
        rewards, terminated, truncated = (array.reshape(shape) for array in outcomes)
        _check_finite(rewards[..., None], valid, "a reward", builder.n_steps)
        builder.add_step(envs, distribution, info, valid, actions, rewards, terminated, truncated)
        resetting, acted = terminated | truncated, valid
        extent.advance(valid, resetting)


@dataclass(frozen=True)
class _ActingPolicy:
    """A policy that acts in S × N environments."""

    policy: Policy
    noise: "ActionNoise"
    greedy: bool
    """Whether it takes the most likely action instead of a sample."""

    def __call__(self, obs: Any, valid: np.ndarray) -> tuple[np.ndarray, Any, Distribution]:
        """Choose actions (S, N, …); images where valid (S, N) is false are not looked at.

        Returns:
            The actions, the environments that the distribution is about (an index into (S, N)),
            and the distribution.
        """
        envs: Any = slice(None)
        counts = [valid.shape[1]] * len(valid)
        if any(array.ndim > 3 for array in arrays_of(obs)):  # bring those that count to the front
            order = np.argsort(~valid, axis=1, kind="stable")  # (S, N)
            counts = valid.sum(1).tolist()
            envs = (np.arange(len(valid))[:, None], order[:, : max(counts)])
        distribution = self.policy(each(_tensor, obs, envs), counts).to(HOST)
        chosen = (
            distribution.mode()
            if self.greedy
            else distribution.sample(self.noise.draw(distribution, envs))
        ).numpy()
        actions = np.zeros((*valid.shape, *chosen.shape[2:]), chosen.dtype)
        actions[envs] = chosen
        return actions, envs, distribution


def _tensor(array: np.ndarray, envs: Any) -> Tensor:
    """Return the observations of some environments as the networks read them."""
    tensor = torch.from_numpy(np.ascontiguousarray(array[envs]))
    return tensor if tensor.dtype == torch.uint8 else tensor.float()


def clip(actions: np.ndarray, env: RewardTerms) -> np.ndarray:
    """Return actions as the environment is to see them: continuous ones in and of its space."""
    space = env.single_action_space
    if isinstance(space, gymnasium.spaces.Box):
        # np.clip would spend more on looking at its arguments than on these few numbers.
        bounded = np.minimum(np.maximum(actions.astype(np.float64), space.low), space.high)
        if space.dtype.kind in "iu":
            bounded = bounded.round()
        return bounded.astype(space.dtype)
    return actions


def _check_finite(numbers: np.ndarray, mask: np.ndarray, what: str, t: int) -> None:
    if numbers.dtype.kind != "f":
        return
    with np.errstate(all="ignore"):
        if isfinite(numbers.sum()):
            return  # quick, and nearly always
    if not np.isfinite(numbers[mask]).all():
        s, n = np.argwhere(mask & ~np.isfinite(numbers).all(-1))[0]
        raise DivergedError(
            f"expected finite numbers from the environment, found {what} that is not, "
            f"in environment {n} at step {t} of the rollout",
            row=int(s),
        )
