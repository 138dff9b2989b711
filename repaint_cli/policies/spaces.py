"""The sizes of a policy's observations and actions."""

from dataclasses import dataclass, replace

import gymnasium

from repaint_cli.errors import CardError


@dataclass(frozen=True)
class Spaces:
    """The sizes of observations and actions."""

    obs_shape: tuple[int, ...]
    """O: (features,) or an image (height, width, channels)."""
    n_actions: int
    """A: dimensions of a continuous action, or how many discrete ones."""
    discrete: bool
    """Whether actions are numbers 0…A−1."""
    n_beams: int = 0
    """Ranges of a lidar that come with an image; 0 without one."""

    @classmethod
    def of(cls, obs: gymnasium.Space, action: gymnasium.Space) -> "Spaces":  # type: ignore[type-arg]
        """Return the sizes of Gymnasium spaces.

        Raises:
            CardError: the observations are no vector or image, or the actions no vector or Discrete
                from 0.
        """
        if isinstance(obs, gymnasium.spaces.Dict) and obs.keys() == {"camera", "lidar"}:
            image, ranges = cls.of(obs["camera"], action), cls.of(obs["lidar"], action)
            return replace(image, n_beams=ranges.obs_shape[0])
        shape = obs.shape
        if isinstance(obs, gymnasium.spaces.Box) and shape is not None and len(shape) in (1, 3):
            if isinstance(action, gymnasium.spaces.Discrete) and action.start == 0:
                return cls(shape, int(action.n), True)
            if isinstance(action, gymnasium.spaces.Box) and len(action.shape) == 1:
                return cls(shape, action.shape[0], False)
        raise CardError(
            "expected observations in a vector or an image and actions in a vector or Discrete, "
            f"found {obs} and {action}"
        )

    @property
    def image(self) -> bool:
        """Whether observations are images."""
        return len(self.obs_shape) == 3

    def __str__(self) -> str:
        size = "×".join(str(n) for n in self.obs_shape)
        size += f" + {self.n_beams}" if self.n_beams else ""
        kind = "discrete" if self.discrete else "continuous"
        return f"{size} observations and {self.n_actions} {kind} actions"
