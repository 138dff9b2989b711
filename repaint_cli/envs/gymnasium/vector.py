"""Any Gymnasium environment by its id, on EnvPool where that was checked to be the same.

Both sides follow next-step autoreset: the step that ends an episode returns the true last
observation, the following step ignores its action and returns the first observation of the next
episode. SI units are the environment's own.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from repaint_cli.envs.gymnasium.copies import Copies
from repaint_cli.errors import CardError
from repaint_cli.threads import cores

ENVPOOL_IDS = frozenset({"Reacher-v5", "Ant-v5"})
"""Ids whose bodies, numbers and reward terms a test holds equal to Gymnasium's."""


def make_gym(
    env_id: str,
    n_envs: int,
    kwargs: Mapping[str, Any],
    backend: str = "auto",
    wrappers: Sequence[Any] = (),
) -> "VectorEnv[Any, Any, Any]":
    """Make `n_envs` copies of a Gymnasium environment that step together.

    Args:
        env_id: as in `gymnasium.make`.
        n_envs: N.
        kwargs: passed to the environment; EnvPool serves only environments without any.
        backend: "envpool", "gymnasium", or "auto" for EnvPool where installed and checked.
        wrappers: of each of Gymnasium's environments; EnvPool's have none.

    Raises:
        CardError: Gymnasium does not know the id or refuses the arguments, or EnvPool would.
    """
    if backend == "envpool" and kwargs:
        raise CardError(
            f"expected no env.kwargs with env.backend envpool, found {', '.join(kwargs)}; "
            "try --set env.backend=gymnasium"
        )
    with _constructor_errors(env_id):
        if on_envpool(env_id, kwargs, backend):
            return EnvPoolVector(env_id, n_envs)
        return Copies(env_id, n_envs, kwargs, wrappers)


def on_envpool(env_id: str, kwargs: Mapping[str, Any], backend: str) -> bool:
    """Return whether EnvPool serves an environment; see `make_gym`."""
    checked = env_id in ENVPOOL_IDS and not kwargs
    return backend == "envpool" or (
        backend == "auto" and checked and find_spec("envpool") is not None
    )


@contextmanager
def _constructor_errors(env_id: str) -> Iterator[None]:
    """Raise any error of a constructor, which is other people's code, as a CardError."""
    try:
        yield
    except Exception as error:  # of any kind
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise CardError(f"cannot make the environment '{env_id}': {reason}") from error


class EnvPoolVector(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """EnvPool behind Gymnasium's interface: seeds are given to `reset`, which makes the pool."""

    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(self, env_id: str, n_envs: int) -> None:
        import envpool

        self.env_id, self.num_envs = env_id, n_envs
        self._pool: Any = None
        spec = envpool.make_spec(env_id)
        self.single_observation_space = spec.gymnasium_observation_space
        self.single_action_space = spec.gymnasium_action_space
        self.observation_space = gymnasium.vector.utils.batch_space(
            self.single_observation_space, n_envs
        )
        self.action_space = gymnasium.vector.utils.batch_space(self.single_action_space, n_envs)

    def _make(self, seeds: list[int]) -> Any:
        import envpool

        return envpool.make(
            self.env_id,
            env_type="gymnasium",
            num_envs=self.num_envs,
            seed=seeds,
            num_threads=min(self.num_envs, cores()),
        )

    def reset(
        self, *, seed: int | list[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start every environment afresh, environment i from seed[i] (or seed + i)."""
        if isinstance(seed, int):
            seed = [seed + i for i in range(self.num_envs)]
        if seed is None and self._pool is None:
            seed = list(range(self.num_envs))
        if seed is not None:
            self._pool = self._make([int(value) % 2**31 for value in seed])
        obs, info = self._pool.reset()
        return obs, info

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every environment by one step; actions are (N, A) float64."""
        obs, reward, terminated, truncated, info = self._pool.step(
            np.asarray(actions, self.single_action_space.dtype)
        )
        return obs, reward, terminated, truncated, info

    def close_extras(self, **kwargs: Any) -> None:
        """Stop the pool's threads."""
        self._pool = None
