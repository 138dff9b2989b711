"""Environments that stay from rollout to rollout, whose episodes rollouts may cut."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from repaint_cli.envs.episodes import BegunEpisode
from repaint_cli.envs.reward_terms import RewardTerms
from repaint_cli.errors import CardError
from repaint_cli.learn.rollout.collect import Policy, clip, collect, start
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose, env_seeds
from repaint_cli.learn.states import below
from repaint_cli.policies.spaces import by_name
from repaint_cli.tasks.card import TaskCard


@dataclass
class Stream:
    """S × N environments and where their episodes are.

    An episode is known by its environment's first seed, its number and its actions, from which it
    can be played again where the simulator can do that.
    """

    env: RewardTerms | None
    """The environments; None until a stream that a checkpoint held is brought back."""
    obs: Any
    """What they show, (S · N, *O), or several such arrays by name."""
    ended: np.ndarray
    """Whether the episode ended with the last step, so that the next one begins another, (S, N)."""
    first_seeds: np.ndarray
    """The seed of each environment's first episode, (S, N)."""
    episodes: np.ndarray
    """Which episode it is in, from 0, (S, N)."""
    returns: np.ndarray
    """What the episode earned so far, (S, N); 0 where it ended."""
    lengths: np.ndarray
    """Its steps so far, (S, N); 0 where it ended."""
    actions: list[np.ndarray]
    """The policy's actions since each episode began, S · N arrays (L, …)."""

    @classmethod
    def begin(
        cls, card: TaskCard, seeds: list[int], n_envs: int, purpose: Purpose, k: int, stream: int,
        *, on_gpu: bool = False,
    ) -> Self:  # fmt: skip
        """Make and reset environments with seeds that iteration k names; see `collect.start`."""
        where = card, seeds, n_envs, purpose, k
        env, obs = start(*where, stream=stream, replayable=True, on_gpu=on_gpu)
        shape = len(seeds), n_envs
        first_seeds = np.reshape(env_seeds(seeds, purpose, k, n_envs, stream), shape)
        zeros = np.zeros(shape, int)
        return cls(
            env, obs, zeros.astype(bool), first_seeds, zeros, zeros.astype(float), zeros,
            [np.empty(0)] * first_seeds.size,
        )  # fmt: skip

    def collect(
        self,
        policy: Policy,
        rngs: Sequence[np.random.Generator],
        each_steps: int,
        record: Sequence[str] = (),
    ) -> Rollout:
        """Let a policy act on in every environment for some steps; see `collect.collect`."""
        assert self.env is not None
        return self._follow(
            collect(
                self.env, self.obs, policy, rngs,
                each_steps=each_steps, ended=self.ended, record=record,
            )
        )  # fmt: skip

    def _follow(self, rollout: Rollout) -> Rollout:
        """Note where a rollout left the episodes; return it with what they had before it.

        Every invalid step of such a rollout is one that begins an episode.
        """
        whole = replace(rollout, returns_before=self.returns, lengths_before=self.lengths)
        self.returns, self.lengths = whole.running_episodes()
        self.obs, resets = rollout.last_obs, ~rollout.valid
        self.ended = (rollout.terminations | rollout.truncations)[-1] & rollout.valid[-1]
        self.episodes = self.episodes + resets.sum(0)
        for i, (s, n) in enumerate(np.ndindex(self.ended.shape)):
            begins = resets[:, s, n].nonzero()[0]
            earlier = [self.actions[i]] if len(self.actions[i]) and not len(begins) else []
            since = rollout.actions[begins[-1] + 1 if len(begins) else 0 :, s, n]
            self.actions[i] = np.concatenate([*earlier, since])
        return whole

    def state(self) -> dict[str, Tensor]:
        """Return all but the environments as tensors."""
        columns = {name: getattr(self, name) for name in COLUMNS}
        counts = np.array([len(own) for own in self.actions])
        done = [own for own in self.actions if len(own)]
        columns |= {"counts": counts, "actions": np.concatenate(done) if done else np.empty(0)}
        shown = self.obs if isinstance(self.obs, Mapping) else {"": self.obs}
        columns |= {"obs/" + name: array for name, array in shown.items()}
        return {name: torch.from_numpy(np.ascontiguousarray(own)) for name, own in columns.items()}

    @classmethod
    def of_state(cls, state: Mapping[str, Tensor]) -> Self:
        """Return the stream that `state` described, without environments.

        Raises:
            KeyError: a tensor is missing.
            ValueError: the counts do not go with the actions.
        """
        shown = {name: tensor.numpy() for name, tensor in below("obs/", state).items()}
        ends = np.cumsum(state["counts"].numpy())
        actions = state["actions"].numpy()
        if len(ends) != state["ended"].numel() or ends[-1] != len(actions):
            raise ValueError("counts and actions of an episode do not go together")
        columns = {name: state[name].numpy() for name in COLUMNS}
        own = np.split(actions, ends[:-1])
        return cls(env=None, obs=shown.get("", shown), actions=own, **columns)

    def bring_back(self, card: TaskCard) -> bool:
        """Make the environments, and play each episode again up to where it was.

        Returns:
            Whether the simulator can do that, and all show what they showed.
        """
        env = card.make_env(self.ended.size, replayable=True)
        if not env.replayable:
            env.close()
            return False
        episodes = [
            BegunEpisode(int(first), int(episode), clip(own, env) if len(own) else own)
            for first, episode, own in zip(
                self.first_seeds.flat, self.episodes.flat, self.actions, strict=True
            )
        ]
        try:
            obs = env.play_again(episodes, self.ended.reshape(-1))
        except CardError:  # an environment that goes another way may fail at any action
            env.close()
            return False
        before = by_name(self.obs)
        if not all(np.array_equal(shown, before[name]) for name, shown in by_name(obs).items()):
            env.close()
            return False
        self.env = env
        return True


COLUMNS = ("ended", "first_seeds", "episodes", "returns", "lengths")
"""The fields of a stream with a number for each environment, (S, N)."""
