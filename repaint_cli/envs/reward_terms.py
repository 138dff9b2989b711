"""The reward as a weighted sum of named terms, r = w·φ (paper, section 5.2)."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper

from repaint_cli import interruption
from repaint_cli.envs.simulator import BegunEpisode
from repaint_cli.errors import CardError, RepaintError


def weighted_sum(terms: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return w·φ of terms (…, F), (…); a product of matrices would round by the number of rows."""
    total: np.ndarray = (terms * weights).sum(-1)
    return total


@contextmanager
def _environment_errors(when: str) -> Iterator[None]:
    """Raise any error of an environment, which is other people's code, as a CardError."""
    try:
        yield
    except RepaintError:
        raise
    except Exception as error:  # of any kind
        reason = (str(error).strip() or "no reason given").splitlines()[0]
        raise CardError(
            f"the environment failed {when}: {type(error).__name__}: {reason}; see where with "
            "repaint --debug"
        ) from error
    finally:
        interruption.check()  # which the environment may have swallowed


class RewardTerms(VectorWrapper):
    """Replace an environment's reward by w·φ, with φ read from its `info`.

    A term called `reward` is the environment's own reward, unless its info has one of that name.
    Every step's info gains `reward_terms`, (N, F) float64 in the order of the weights. Steps that
    only reset an environment have φ = 0.
    """

    def __init__(
        self,
        env: "VectorEnv[Any, Any, Any]",
        weights: Mapping[str, float],
        replayable: bool = False,
    ) -> None:
        super().__init__(env)
        self.replayable = replayable
        """Whether `Simulator.make_replayable` made the environments."""
        self.names = tuple(weights)
        self.weights = np.array([weights[name] for name in self.names])  # (F,)
        self._ended = np.zeros(env.num_envs, bool)

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start every environment afresh."""
        self._ended[:] = False
        with _environment_errors("when it was reset"):
            return self.env.reset(**kwargs)

    def play_again(self, episodes: Sequence[BegunEpisode], ended: np.ndarray) -> Any:
        """Bring every environment to a step of an episode; return what is observed there.

        Args:
            episodes: of N environments that `Simulator.make_replayable` made.
            ended: whether each had ended with that step, (N,).

        Raises:
            CardError: an environment fails.
        """
        self.env.set_attr("begun", list(episodes))  # type: ignore[attr-defined]
        obs, _ = self.reset()
        self._ended = ended.copy()
        return obs

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every environment by one step.

        Raises:
            CardError: the environment fails, or does not report one of the terms.
        """
        with _environment_errors("in a step"):
            obs, own, terminated, truncated, info = self.env.step(actions)
        info.setdefault("reward", np.asarray(own, np.float64))
        terms = np.zeros((self.num_envs, len(self.names)))  # (N, F)
        if not self._ended.all():
            for column, name in enumerate(self.names):
                terms[:, column] = self._term(info, name)
            terms[self._ended] = 0
        self._ended = np.logical_or(terminated, truncated)
        rewards = weighted_sum(terms, self.weights)
        return obs, rewards, terminated, truncated, info | {"reward_terms": terms}

    def _term(self, info: Mapping[str, Any], name: str) -> Any:
        if name not in info:
            numbers = sorted(
                key for key, value in info.items()
                if not key.startswith("_") and getattr(value, "dtype", None) == np.float64
                and value.ndim == 1
            )  # fmt: skip
            raise CardError(
                f"the environment reports no reward term '{name}'; its info has: "
                f"{', '.join(numbers) or 'nothing'}"
            )
        return info[name]
