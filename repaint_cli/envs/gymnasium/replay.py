"""Episodes that can be played again up to any step: each begins from a seed of its own."""

from typing import Any

import gymnasium
import numpy as np

from repaint_cli.envs.episodes import BegunEpisode


class EpisodeSeeds(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Begins episode e of an environment from a seed that its first seed and e name.

    With `begun` set, the next reset plays that episode again up to where it was, and returns what
    was observed there. Where that was its end, the next step begins the episode after it, as
    environments with next-step autoreset do.
    """

    def __init__(self, env: "gymnasium.Env[Any, Any]") -> None:
        super().__init__(env)
        self.begun: BegunEpisode | None = None
        self._first, self._episode, self._ended = 0, 0, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode: the first one with a seed, or the next, or the one that was begun."""
        self._episode += 1
        if self.begun:
            self._first, self._episode = self.begun.first_seed, self.begun.episode
        elif seed is not None:
            self._first, self._episode = seed, 0
        named = np.random.SeedSequence((self._first, self._episode)).generate_state(1)[0]
        obs, info = self.env.reset(seed=int(named) >> 1, options=options)
        self._ended = False
        for action in self.begun.actions if self.begun else ():
            obs, _, terminated, truncated, info = self.env.step(action)
            self._ended = bool(terminated or truncated)
        self.begun = None
        return obs, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Advance by one step, or begin the next episode after one that was played to its end."""
        if self._ended:
            obs, info = self.reset()
            return obs, 0.0, False, False, info
        return self.env.step(action)
