"""The sizes of a policy's observations and actions."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
from gymnasium.spaces import Box, Dict, Discrete, MultiDiscrete

from repaint_cli.errors import CardError


@dataclass(frozen=True)
class Spaces:
    """The sizes of observations and actions."""

    obs_shape: tuple[int, ...]
    """O: (features,) or an image (height, width, channels), the first where there are several."""
    n_actions: int
    """A: dimensions of a continuous action, or how many discrete ones; of a compound action the sum
    over its numbers."""
    discrete: bool
    """Whether actions are numbers 0…A−1, or several numbers."""
    n_beams: int = 0
    """Ranges of a lidar that come with an image; 0 without one."""
    parts: tuple[tuple[str, tuple[int, ...]], ...] = ()
    """Several images and vectors by name, in its order, with their shapes; none where there is one
    image, with a lidar or not, or one vector."""
    sizes: tuple[int, ...] = ()
    """Of each number of a compound action, (P,)."""
    uses: tuple[tuple[bool, ...], ...] = ()
    """Which of its numbers beside the first count, with each value of the first, (C, P − 1)."""

    @classmethod
    def of(cls, obs: gymnasium.Space, action: gymnasium.Space) -> "Spaces":  # type: ignore[type-arg]
        """Return the sizes of Gymnasium spaces.

        Raises:
            CardError: the observations are no vector or image, nor several of them with an image
                among them, or the actions no vector, Discrete or MultiDiscrete from 0.
        """
        if isinstance(obs, Dict) and all(_is_array(part) for part in obs.values()):
            named = {str(name): part.shape or () for name, part in sorted(obs.items())}
            first = next((obs[name] for name, shape in named.items() if len(shape) == 3), None)
            if named.keys() == {"camera", "lidar"} and len(named["lidar"]) == 1:
                return replace(cls.of(obs["camera"], action), n_beams=named["lidar"][0])
            if first is not None:
                return replace(cls.of(first, action), parts=tuple(named.items()))
        shape = obs.shape
        if _is_array(obs) and shape is not None:
            if isinstance(action, Discrete) and action.start == 0:
                return cls(shape, int(action.n), True)
            if isinstance(action, Box) and len(action.shape) == 1:
                return cls(shape, action.shape[0], False)
            if (
                isinstance(action, MultiDiscrete)
                and len(action.shape) == 1
                and not action.start.any()
            ):
                sizes = tuple(action.nvec.tolist())
                return cls(shape, sum(sizes), True, sizes=sizes, uses=_uses(action))
        raise CardError(
            "expected observations in a vector or an image, or in a Dict of these with an image "
            f"among them, and actions in a vector, Discrete or MultiDiscrete, found {obs} and "
            f"{action}"
        )

    @property
    def image(self) -> bool:
        """Whether observations are images, perhaps with numbers beside them."""
        return len(self.obs_shape) == 3

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shapes of one observation's arrays by name, "" of an array without one."""
        if self.n_beams:
            return {"camera": self.obs_shape, "lidar": (self.n_beams,)}
        return dict(self.parts) or {"": self.obs_shape}

    def __str__(self) -> str:
        named = [("×".join(map(str, shape)), name) for name, shape in self.shapes.items()]
        size = " + ".join(f"{name} {shape}" if self.parts else shape for shape, name in named)
        kind = "discrete" if self.discrete else "continuous"
        n_actions = "×".join(map(str, self.sizes)) or str(self.n_actions)
        return f"{size} observations and {n_actions} {kind} actions"


def _uses(space: MultiDiscrete) -> tuple[tuple[bool, ...], ...]:
    """Return which numbers beside the first count with each value of the first, (C, P − 1).

    All do, unless the space says otherwise, as `envs.compound_space.CompoundSpace` does.
    """
    n_first, n_rest = int(space.nvec[0]), len(space.nvec) - 1
    uses: tuple[tuple[bool, ...], ...] = getattr(space, "uses", ((True,) * n_rest,) * n_first)
    return uses


def _is_array(space: Any) -> bool:
    """Return whether a space is of vectors or images."""
    return isinstance(space, Box) and len(space.shape) in (1, 3)


def by_name(obs: Any) -> dict[str, Any]:
    """Return the arrays of observations by name, "" of an array without one."""
    return dict(obs) if isinstance(obs, Mapping) else {"": obs}
