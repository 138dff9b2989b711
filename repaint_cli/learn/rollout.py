"""Drive S × N environments with a policy and remember who acted, what was paid, how it ended."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.distributions import Distribution
from repaint_cli.envs.terms import RewardTerms
from repaint_cli.errors import DivergedError
from repaint_cli.learn.frames import Frames, Store, each, parts
from repaint_cli.learn.seeding import Purpose, env_seeds
from repaint_cli.tasks import TaskCard

Policy = Callable[[Any, Sequence[int]], Distribution]
"""Maps observations (S, B, *O), the first counts[s] of them real, to distributions."""


@dataclass(frozen=True)
class Rollout:
    """What happened, step by step. Invalid entries (resets, ended episodes) are not to be read."""

    frames: Frames
    """The observations."""
    index: np.ndarray
    """Where each observation is in its seed's store, (T+1, S, N); row t+1 truly followed row t."""
    actions: np.ndarray
    """What the policy chose, before any clipping to bounds: (T, S, N, A) or (T, S, N) int64."""
    behavior_log_probs: np.ndarray
    """log μ(a|s) of the policy that acted, (T, S, N)."""
    reward_terms: np.ndarray
    """φ, (T, S, N, F)."""
    rewards: np.ndarray
    """w·φ, (T, S, N)."""
    terminations: np.ndarray
    """Whether the step ended the episode for good, (T, S, N)."""
    truncations: np.ndarray
    """Whether a time limit cut the episode there, (T, S, N)."""
    valid: np.ndarray
    """Whether the step counts, (T, S, N)."""
    records: dict[str, np.ndarray] = field(default_factory=dict)
    """Whatever else was asked for from `info`, each (T, S, N, …)."""

    def episodes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return (seed, return, length) of every episode that ended here, (episodes,) each."""
        total, length = np.zeros(self.valid.shape[1:]), np.zeros(self.valid.shape[1:], int)
        ended: list[tuple[int, float, int]] = []
        for t, valid in enumerate(self.valid):
            total += np.where(valid, self.rewards[t], 0)
            length += valid
            over = valid & (self.terminations[t] | self.truncations[t])
            ended += [(s, total[s, n], length[s, n]) for s, n in zip(*over.nonzero(), strict=True)]
            total[over], length[over] = 0, 0
        seeds, returns, lengths = zip(*ended, strict=True) if ended else ((), (), ())
        return np.array(seeds, int), np.array(returns), np.array(lengths, int)


def start(
    task: TaskCard,
    seeds: list[int],
    n_envs: int,
    purpose: Purpose,
    iteration: int,
    *,
    one_episode: bool = False,
    noise: bool = False,
) -> tuple[RewardTerms, Any]:
    """Make and reset S × N environments with seeds of their own; return the first observations.

    Evaluation starts are spread over the task's starts; training starts go on where the last
    iteration's ended.
    """
    env = task.make_env(len(seeds) * n_envs, one_episode=one_episode, noise=noise)
    spread = purpose in (Purpose.EVALUATE, Purpose.SCORE)
    options = task.start_options(len(seeds), n_envs, None if spread else iteration)
    obs, _ = env.reset(seed=env_seeds(seeds, purpose, iteration, n_envs), options=options)
    return env, obs


def collect(
    env: RewardTerms,
    obs: Any,
    policy: Policy,
    rngs: Sequence[np.random.Generator],
    *,
    n_steps: int | None = None,
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
        greedy: take the most likely action instead of a sample.
        record: further numbers to keep from `info`.

    Raises:
        DivergedError: an observation or a reward is not finite.
    """
    shape = (len(rngs), env.num_envs // len(rngs))  # (S, N)
    tape = _Tape(shape, record)
    noise = _Noise(rngs, shape[1])
    with torch.no_grad(), _threads_for(obs):
        return _play(env, obs, policy, tape, noise, n_steps, greedy)


def _play(
    env: RewardTerms,
    obs: Any,
    policy: Policy,
    tape: "_Tape",
    noise: "_Noise",
    n_steps: int | None,
    greedy: bool,
) -> Rollout:
    """Act, step and remember until every seed has enough; see `collect`."""
    shape = tape.shape
    taken = np.zeros(shape[0], int)
    running, resetting, acted = np.ones(shape, bool), np.zeros(shape, bool), np.zeros(shape, bool)
    while True:
        valid = running & ~resetting
        if n_steps is not None:  # no more than the seed still needs
            valid &= valid.cumsum(1) + taken[:, None] <= n_steps
        obs = each(lambda part: part.reshape(*shape, *part.shape[1:]), obs)
        for part in parts(obs):
            _check_finite(part, valid | acted, "an observation", len(tape.valid))
        tape.observe(obs, valid | acted)
        enough = not running.any() if n_steps is None else bool((taken >= n_steps).all())
        if enough:
            return tape.rollout()
        actions, log_probs = _act(policy, obs, valid, noise, greedy)
        obs, rewards, terminated, truncated, info = env.step(
            clip(actions, env).reshape(-1, *actions.shape[2:])
        )
        rewards, terminated, truncated = (
            x.reshape(shape) for x in (rewards, terminated, truncated)
        )
        _check_finite(rewards[..., None], valid, "a reward", len(tape.valid))
        tape.act(valid, actions, log_probs, rewards, terminated, truncated, info)
        taken += valid.sum(1)
        resetting, acted = terminated | truncated, valid
        if n_steps is None:
            running, resetting = running & ~resetting, np.zeros(shape, bool)


def _act(
    policy: Policy, obs: Any, valid: np.ndarray, noise: "_Noise", greedy: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Choose actions, looking only at images that count; return them with log μ(a|s), (S, N)."""
    seats: Any = slice(None)
    counts = [valid.shape[1]] * len(valid)
    if any(part.ndim > 3 for part in parts(obs)):  # bring those that count to each row's front
        order = np.argsort(~valid, axis=1, kind="stable")  # (S, N)
        counts = valid.sum(1).tolist()
        seats = (np.arange(len(valid))[:, None], order[:, : max(counts)])
    distribution = policy(each(_tensor, obs, seats), counts)
    chosen = distribution.mode() if greedy else distribution.sample(noise.draw(distribution, seats))
    log_probs = distribution.log_prob(chosen)
    actions = np.zeros((*valid.shape, *chosen.shape[2:]), chosen.numpy().dtype)
    full_log_probs = np.zeros(valid.shape, np.float32)
    actions[seats], full_log_probs[seats] = chosen.numpy(), log_probs.numpy()
    return actions, full_log_probs


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
        return np.clip(actions.astype(np.float64), space.low, space.high)
    return actions


def _check_finite(numbers: np.ndarray, mask: np.ndarray, what: str, t: int) -> None:
    if numbers.dtype.kind != "f":
        return
    with np.errstate(all="ignore"):
        if np.isfinite(numbers.sum()):
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


class _Tape:
    """Lists that grow step by step, and become a Rollout."""

    def __init__(self, shape: tuple[int, int], record: Sequence[str]) -> None:
        self.shape = shape
        self.seen: list[Any] = []
        self.sizes = np.zeros(shape[0], int)
        self.index: list[np.ndarray] = []
        self.valid: list[np.ndarray] = []
        self.steps: list[tuple[np.ndarray, ...]] = []
        self.terms: list[np.ndarray] = []
        self.records: dict[str, list[np.ndarray]] = {name: [] for name in record}

    def observe(self, obs: Any, keep: np.ndarray) -> None:
        """Store the observations (S, N, *O) where keep (S, N), and where they went."""
        self.index.append(np.where(keep, self.sizes[:, None] + keep.cumsum(1) - 1, 0))
        self.sizes += keep.sum(1)
        if not self.seen:
            self.seen = [each(Store, obs) for _ in keep]
        for s, mask in enumerate(keep):
            for store, part in zip(parts(self.seen[s]), parts(obs), strict=True):
                store.append(part[s, mask])

    def act(self, valid: np.ndarray, *step: Any) -> None:
        """Store a step and its info."""
        *arrays, info = step
        self.valid.append(valid)
        self.steps.append(tuple(arrays))
        self.terms.append(info["reward_terms"].reshape(*self.shape, -1))
        for name, rows in self.records.items():
            told = np.array(info[name], float)
            rows.append(told.reshape(*self.shape, *told.shape[1:]))

    def rollout(self) -> Rollout:
        """Stack what was stored."""
        actions, log_probs, rewards, terminated, truncated = map(
            np.stack, zip(*self.steps, strict=True)
        )
        frames = Frames([each(Store.tensor, seen) for seen in self.seen])
        return Rollout(
            frames, np.stack(self.index), actions, log_probs, np.stack(self.terms), rewards,
            terminated, truncated, np.stack(self.valid),
            {name: np.stack(rows) for name, rows in self.records.items()},
        )  # fmt: skip
