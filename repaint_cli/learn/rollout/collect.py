"""Drive S × N environments with a policy until every seed has enough."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import isfinite
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.reward_terms import RewardTerms
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.observations import each, parts
from repaint_cli.learn.rollout.storage import Rollout, Tape
from repaint_cli.learn.seeding import Purpose, env_seeds
from repaint_cli.policies.distributions import Distribution
from repaint_cli.tasks.card import TaskCard

Policy = Callable[[Any, Sequence[int]], Distribution]
"""Maps observations (S, B, *O), the first counts[s] of them real, to distributions."""


def start(
    task: TaskCard,
    seeds: list[int],
    n_envs: int,
    purpose: Purpose,
    iteration: int,
    *,
    stream: int = 0,
    one_episode: bool = False,
    noise: bool = False,
) -> tuple[RewardTerms, Any]:
    """Make and reset S × N environments with seeds of their own; return the first observations.

    Evaluation starts are spread over the task's starts; training starts go on where the last
    iteration's ended.
    """
    env = task.make_env(
        len(seeds) * n_envs, one_episode=one_episode, noise=task.eval if noise else None
    )
    spread = purpose in (Purpose.EVALUATE, Purpose.SCORE)
    options = task.start_options(len(seeds), n_envs, None if spread else iteration)
    drawn = env_seeds(seeds, purpose, iteration, n_envs, stream)
    obs, _ = env.reset(seed=drawn, options=options)
    return env, obs


def collect(
    env: RewardTerms,
    obs: Any,
    policy: Policy,
    rngs: Sequence[np.random.Generator],
    *,
    n_steps: int | None = None,
    whole: bool = False,
    greedy: bool = False,
    record: Sequence[str] = (),
) -> Rollout:
    """Let a policy act until every seed has enough.

    Args:
        env: S · N environments, seed by seed, already reset.
        obs: their first observations, (S · N, *O), or several such arrays by name.
        policy: who acts.
        rngs: one generator per seed for the actions.
        n_steps: valid steps per seed; where absent, every environment plays exactly one episode.
        whole: whether episodes that run when a seed has `n_steps` go on to their ends.
        greedy: take the most likely action instead of a sample.
        record: further numbers to keep from `info`.

    Raises:
        DivergedError: an observation or a reward is not finite.
    """
    shape = (len(rngs), env.num_envs // len(rngs))  # (S, N)
    tape = Tape(shape, record)
    noise = _Noise(rngs, shape[1])
    with torch.no_grad(), _threads_for(obs):
        return _play(env, obs, policy, tape, noise, n_steps, whole, greedy)


def _play(
    env: RewardTerms,
    obs: Any,
    policy: Policy,
    tape: Tape,
    noise: "_Noise",
    n_steps: int | None,
    whole: bool,
    greedy: bool,
) -> Rollout:
    """Act, step and remember until every seed has enough; see `collect`."""
    shape = tape.shape
    taken = np.zeros(shape[0], int)
    running, resetting, acted = np.ones(shape, bool), np.zeros(shape, bool), np.zeros(shape, bool)
    while True:
        valid = running & ~resetting
        if n_steps is not None and not whole:  # no more than the seed still needs
            valid &= valid.cumsum(1) + taken[:, None] <= n_steps
        obs = each(lambda part: part.reshape(*shape, *part.shape[1:]), obs)
        for part in parts(obs):
            _check_finite(part, valid | acted, "an observation", len(tape.steps))
        tape.observe(obs, valid | acted)
        if not running.any():
            return tape.rollout()
        actions, seats, distribution = _act(policy, obs, valid, noise, greedy)
        obs, rewards, terminated, truncated, info = env.step(
            clip(actions, env).reshape(-1, *actions.shape[2:])
        )
        rewards, terminated, truncated = (
            x.reshape(shape) for x in (rewards, terminated, truncated)
        )
        _check_finite(rewards[..., None], valid, "a reward", len(tape.steps))
        tape.act(seats, distribution, info, valid, actions, rewards, terminated, truncated)
        taken += valid.sum(1)
        resetting, acted = terminated | truncated, valid
        if n_steps is None:
            running, resetting = running & ~resetting, np.zeros(shape, bool)
        elif whole:  # no environment begins another episode once its seed has enough
            running &= ~((resetting | ~valid) & (taken >= n_steps)[:, None])
        elif (taken >= n_steps).all():
            running[:] = False


def _act(
    policy: Policy, obs: Any, valid: np.ndarray, noise: "_Noise", greedy: bool
) -> tuple[np.ndarray, Any, Distribution]:
    """Choose actions (S, N, …), looking only at images that count.

    Returns:
        The actions, and the seats the distribution is about.
    """
    seats: Any = slice(None)
    counts = [valid.shape[1]] * len(valid)
    if any(part.ndim > 3 for part in parts(obs)):  # bring those that count to each row's front
        order = np.argsort(~valid, axis=1, kind="stable")  # (S, N)
        counts = valid.sum(1).tolist()
        seats = (np.arange(len(valid))[:, None], order[:, : max(counts)])
    distribution = policy(each(_tensor, obs, seats), counts)
    drawn = distribution.mode() if greedy else distribution.sample(noise.draw(distribution, seats))
    chosen = drawn.numpy()
    actions = np.zeros((*valid.shape, *chosen.shape[2:]), chosen.dtype)
    actions[seats] = chosen
    return actions, seats, distribution


@contextmanager
def _threads_for(obs: Any) -> Iterator[None]:
    """Keep torch to one thread for vectors (S · N, O): others would spin against the simulator."""
    threads = torch.get_num_threads()
    if all(part.ndim == 2 for part in parts(obs)):
        torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _tensor(array: np.ndarray, seats: Any) -> Tensor:
    """Return some observations of an array as the networks read them."""
    tensor = torch.from_numpy(np.ascontiguousarray(array[seats]))
    return tensor if tensor.dtype == torch.uint8 else tensor.float()


def clip(actions: np.ndarray, env: RewardTerms) -> np.ndarray:
    """Return actions as the environment is to see them: continuous ones float64 within bounds."""
    space = env.single_action_space
    if isinstance(space, gymnasium.spaces.Box):
        # np.clip would spend more on looking at its arguments than on these few numbers.
        return np.minimum(np.maximum(actions.astype(np.float64), space.low), space.high)
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


class _Noise:
    """Each seed's own stream of noise for its N environments, drawn 64 steps at a time."""

    def __init__(self, rngs: Sequence[np.random.Generator], n_envs: int) -> None:
        self._rngs, self._n_envs, self._t = rngs, n_envs, 0
        self._block = np.empty(0)

    def draw(self, distribution: Distribution, seats: Any) -> Tensor:
        if self._t % 64 == 0:
            shape = (64, self._n_envs, distribution.n_actions)
            self._block = np.stack([distribution.noise(rng, shape) for rng in self._rngs], axis=1)
        drawn = self._block[self._t % 64]  # (S, N, A)
        self._t += 1
        return torch.from_numpy(drawn[seats])
