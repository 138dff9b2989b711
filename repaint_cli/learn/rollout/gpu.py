"""Act and step where policies and environments lie on one GPU: pictures never leave it.

The same steps, noise and episodes as `collect` has them. At each step the host waits once, to learn
whose episode ended; the other numbers of a rollout come to it at the end.
**S** seeds · **T** steps · **N** environments per seed · **F** reward terms.
"""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.reward_terms import RewardTerms, weighted_sum
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.extent import Extent
from repaint_cli.learn.rollout.noise import ActionNoise
from repaint_cli.learn.rollout.observations import Observations, arrays_of
from repaint_cli.learn.rollout.storage import Rollout, index_of
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.spaces import by_name

BLOCK = 64
"""Steps of which all observations are there; of earlier ones those that count are."""


class GpuRollout:
    """A rollout of environments on a GPU while it is made."""

    def __init__(
        self, env: RewardTerms, obs: Any, shape: tuple[int, int], record: Sequence[str]
    ) -> None:
        """Begin.

        Args:
            env: S · N environments on a GPU, already reset.
            obs: their first observations, arrays there.
            shape: (S, N).
            record: further numbers to keep from `info`.
        """
        self._env, self._shape, self._record, self._cars = env, shape, record, env.device_env
        self._parts = {
            name: _RingBuffer(_tensor(part), shape[0]) for name, part in by_name(obs).items()
        }
        self._named, self._device = isinstance(obs, dict), _tensor(arrays_of(obs)[0]).device
        space = env.single_action_space
        bounds = (space.low, space.high) if isinstance(space, gymnasium.spaces.Box) else ()
        self._bounds = [torch.from_numpy(bound).to(self._device) for bound in bounds]
        self._kept: list[np.ndarray] = []  # (T+1,) of (S, N)
        self._numbers: list[dict[str, Tensor]] = []  # (T,) of (S · N, …)
        self._flags: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def roll(
        self,
        policy: Callable[[Any, Any], Distribution],
        rngs: Sequence[np.random.Generator],
        extent: Extent,
        resetting: np.ndarray,
    ) -> Rollout:
        """Let a policy act until every seed has enough; see `collect.collect`.

        `resetting` says whose next step begins an episode, (S, N).

        Raises:
            DivergedError: a reward is not finite; it is noticed at the end.
        """
        noise, acted = ActionNoise(rngs, self._shape[1]), np.zeros(self._shape, bool)
        self._resetting = resetting
        while True:
            valid = extent.valid(resetting)
            self._kept.append(valid | acted)
            if not extent.running.any():
                return self._build()
            distribution = policy(self._now(), None)
            drawn = noise.draw(distribution, slice(None)).to(self._device)
            actions = distribution.sample(drawn)  # (S, N, …)
            log_probs = distribution.log_prob(actions)
            terminated, truncated, info = self._step(actions)
            numbers = {name: _tensor(info[name]).clone() for name in self._record}
            terms = torch.stack([_tensor(info[name]) for name in self._env.names], 1)  # (S · N, F)
            of_policy = {"actions": actions.flatten(0, 1), "log_probs": log_probs.flatten()}
            self._numbers.append(numbers | of_policy | {"reward_terms": terms})
            self._flags.append((valid, terminated, truncated))
            resetting, acted = terminated | truncated, valid
            extent.advance(valid, resetting)

    def _now(self) -> Any:
        """Return the newest observations, (S, N, *O)."""
        shape = self._shape
        parts = {n: ring.now.view(*shape, *ring.now.shape[1:]) for n, ring in self._parts.items()}
        return parts if self._named else parts[""]

    def _step(self, actions: Tensor) -> tuple[np.ndarray, np.ndarray, Any]:
        """Take a step; its pictures are drawn into the next place of their ring.

        Returns:
            Which episodes were terminated and truncated, (S, N), and the infos, on the GPU.
        """
        if self._device.type == "cuda":
            self._cars.use_stream(torch.cuda.current_stream().cuda_stream)
        for ring in self._parts.values():
            ring.advance(self._kept)
        images = next(ring for ring in self._parts.values() if ring.now.ndim > 2)
        self._cars.draw_into(images.now)
        obs, _, terminated, truncated, info = self._cars.step(self._clipped(actions).flatten(0, 1))
        for name, part in by_name(obs).items():
            if self._parts[name] is not images:
                self._parts[name].now.copy_(_tensor(part))
        ends = torch.stack([_tensor(terminated), _tensor(truncated)]).cpu().numpy()  # waits
        return ends[0].reshape(self._shape), ends[1].reshape(self._shape), info

    def _clipped(self, actions: Tensor) -> Tensor:
        """Return actions as the environment is to see them; see `collect.clip`."""
        if not self._bounds:
            return actions
        return actions.double().clamp(*self._bounds)

    def _build(self) -> Rollout:
        """Bring the numbers to the host, and leave the observations where they are."""
        valid, terminated, truncated = map(np.stack, zip(*self._flags, strict=True))
        numbers = {
            name: torch.stack([step[name] for step in self._numbers]).cpu().numpy()
            for name in self._numbers[0]
        }
        by_seed = {n: a.reshape(len(valid), *self._shape, *a.shape[2:]) for n, a in numbers.items()}
        begins = np.stack([self._resetting, *(terminated | truncated)[:-1]])  # no reward is paid
        terms = by_seed["reward_terms"] * ~begins[..., None]
        rewards = weighted_sum(terms, self._env.weights)
        check_finite(rewards, valid)
        last = {name: ring.now.clone() for name, ring in self._parts.items()}
        return Rollout(
            Observations(self._stores()), index_of(self._kept), by_seed["actions"],
            by_seed["log_probs"], terms, rewards, terminated, truncated, valid,
            {name: by_seed[name] for name in self._record}, last if self._named else last[""],
        )  # fmt: skip

    def _stores(self) -> list[Any]:
        """Return each seed's observations that were kept, step by step, (M, *O)."""
        for ring in self._parts.values():
            ring.keep(self._kept)
        stores = [ring.stores() for ring in self._parts.values()]
        return [
            dict(zip(self._parts, own, strict=True)) if self._named else own[0]
            for own in zip(*stores, strict=True)
        ]


class _RingBuffer:
    """Room for the newest `BLOCK` observations of all environments, of which some are kept."""

    def __init__(self, first: Tensor, n_seeds: int) -> None:
        """Begin with the first ones, (S · N, *O), which are copied."""
        self._block, self._t, self._done = first.new_empty((BLOCK, *first.shape)), 0, 0
        self._kept: list[list[Tensor]] = [[] for _ in range(n_seeds)]
        self.now.copy_(first)

    @property
    def now(self) -> Tensor:
        """The place of the newest ones, (S · N, *O)."""
        return self._block[self._t % BLOCK]

    def advance(self, marks: Sequence[np.ndarray]) -> None:
        """Make the next place the newest one; see `keep`."""
        self._t += 1
        if self._t % BLOCK == 0:
            self.keep(marks)

    def keep(self, marks: Sequence[np.ndarray]) -> None:
        """Copy those that are marked, (T,) of (S, N), out of what will be written over."""
        recent = np.stack(marks[self._done :], 1)  # (S, steps, N)
        self._done = len(marks)
        n_envs = recent.shape[2]
        for s, (own, kept) in enumerate(zip(recent, self._kept, strict=True)):
            steps, places = own.nonzero()
            rows = torch.from_numpy(steps * self._block.shape[1] + s * n_envs + places)
            kept.append(self._block.flatten(0, 1).index_select(0, rows.to(self._block.device)))

    def stores(self) -> list[Tensor]:
        """Return what each seed kept, (S,) of (M, *O)."""
        return [torch.cat(kept) for kept in self._kept]


def check_finite(rewards: np.ndarray, valid: np.ndarray) -> None:
    """Check the rewards of the steps that count, (T, S, N).

    Raises:
        DivergedError: one is not finite.
    """
    bad = np.argwhere(valid & ~np.isfinite(rewards))
    if len(bad):
        t, s, n = bad[0]
        raise DivergedError(
            "expected finite numbers from the environment, found a reward that is not, "
            f"in environment {n} at step {t} of the rollout",
            row=int(s),
        )


def _tensor(array: Any) -> Tensor:
    """Return an array on a GPU as torch sees it, in the same memory."""
    return array if isinstance(array, Tensor) else torch.as_tensor(array, device="cuda")
