"""The reward as a weighted sum of named terms, r = w·φ (paper, section 5.2)."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper

from repaint_cli import interruption
from repaint_cli.envs.episodes import BegunEpisode
from repaint_cli.envs.numbers import describe, number_of
from repaint_cli.envs.output import captured
from repaint_cli.errors import CardError, RepaintError

OWN_REWARD = "reward"
"""The term that is the environment's own reward, whatever its info holds under this name."""


def weighted_sum(terms: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return w·φ of terms (…, F), (…); a product of matrices would round by the number of rows."""
    total: np.ndarray = (terms * weights).sum(-1)
    return total


@contextmanager
def _foreign_code(when: str) -> Iterator[None]:
    """Run an environment, which is other people's code.

    What it prints is captured, and an error of any kind is raised as a CardError.
    """
    try:
        with captured():
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

    A term that a step leaves out is 0 in it; the term called `reward` is the environment's own
    reward. Every step's info gains `reward_terms`, (N, F) float64 in the order of the weights.
    Steps that only reset an environment have φ = 0. Of numbers that are recorded, nan stands
    where a step leaves one out.
    """

    def __init__(
        self,
        env: "VectorEnv[Any, Any, Any]",
        weights: Mapping[str, float],
        records: Sequence[str] = (),
        replayable: bool = False,
    ) -> None:
        super().__init__(env)
        self.replayable = replayable
        """Whether `Simulator.make_replayable` made the environments."""
        self.records = tuple(records)
        self.unreported = {*weights, *records}
        """Terms and records that no step has reported yet."""
        self.names = tuple(weights)
        self.weights = np.array([weights[name] for name in self.names])  # (F,)
        self._ended = np.zeros(env.num_envs, bool)

    @property
    def device_env(self) -> Any:
        """The environments where they are on a GPU, which take and return arrays there, or None."""
        return getattr(self.env, "on_device", None)

    def reset(self, **kwargs: Any) -> tuple[Any, dict[str, Any]]:
        """Start every environment afresh."""
        self._ended[:] = False
        with _foreign_code("when it was reset"):
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
            CardError: the environment fails, or reports something else than a number as a term.
        """
        with _foreign_code("in a step"):
            obs, own, terminated, truncated, info = self.env.step(actions)
        info = {**info, OWN_REWARD: np.asarray(own, np.float64)}
        self.unreported -= info.keys()
        terms = np.zeros((self.num_envs, len(self.names)))  # (N, F)
        if not self._ended.all():
            for column, name in enumerate(self.names):
                if name in info:
                    terms[:, column] = self._numbers(info, name)
            terms[self._ended] = 0
        info |= {name: self._record(info, name) for name in self.records}
        self._ended = np.logical_or(terminated, truncated)
        rewards = weighted_sum(terms, self.weights)
        return obs, rewards, terminated, truncated, info | {"reward_terms": terms}

    def _numbers(self, info: Mapping[str, Any], name: str) -> np.ndarray:
        """Return what each environment reports as a term, (N,); 0 where it leaves it out."""
        values = info[name]
        if not isinstance(values, np.ndarray) or len(values) != self.num_envs:
            raise _no_number(name, values)
        if values.ndim == 1 and values.dtype.kind in "fiub":
            return values
        acting = info.get(f"_{name}", True) & ~self._ended
        numbers = np.zeros(self.num_envs)
        for i in np.flatnonzero(acting):
            number = number_of(values[i])
            if number is None:
                raise _no_number(name, values[i])
            numbers[i] = number
        return numbers

    def _record(self, info: Mapping[str, Any], name: str) -> np.ndarray:
        """Return a number to be recorded, (N, …), nan where an environment does not report it."""
        if name not in info:
            return np.full(self.num_envs, np.nan)
        mask = info.get(f"_{name}")
        if mask is None:  # a simulator that always reports it
            return np.asarray(info[name])
        return np.where(mask, self._numbers(info, name), np.nan)


def _no_number(name: str, value: Any) -> CardError:
    return CardError(
        f"expected a number as '{name}' in the environment's info, found {describe(value)}"
    )


def numbers_in(info: Mapping[str, Any]) -> list[str]:
    """Return the names of what could be reward terms in the info of a step."""
    return sorted(
        key for key, values in info.items()
        if isinstance(values, np.ndarray) and values.dtype.kind == "f" and values.ndim == 1
    )  # fmt: skip
