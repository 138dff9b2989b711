"""Reflections of a simulator: the world in a mirror is the same world, under other numbers.

Importing this brings no arrays, as `similarity` asks for symmetries too.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Self


class SignedPermutation(NamedTuple):
    """A map of vectors: out[i] = signs[i] · x[order[i]]."""

    order: tuple[int, ...]
    """Where each number comes from, (n,)."""
    signs: tuple[int, ...]
    """+1, or −1 where a number changes its sign, (n,)."""

    @classmethod
    def identity(cls, n: int) -> Self:
        """Return the map that changes nothing."""
        return cls(tuple(range(n)), (1,) * n)

    @classmethod
    def of(cls, numbers: Iterable[int]) -> Self:
        """Return the map of signed numbers k from 1, with out[i] = sign(k) · x[|k| − 1]."""
        numbers = tuple(numbers)
        return cls(tuple(abs(k) - 1 for k in numbers), tuple(1 if k > 0 else -1 for k in numbers))

    @property
    def is_involution(self) -> bool:
        """Whether two times the map changes nothing."""
        return all(
            0 <= j < len(self.order) and self.order[j] == i and self.signs[i] == self.signs[j]
            for i, j in enumerate(self.order)
        )

    def __call__(self, x: Any) -> Any:
        """Map numpy arrays or torch tensors (…, n)."""
        mapped = x[..., list(self.order)]  # a copy
        negated = [i for i, sign in enumerate(self.signs) if sign < 0]
        if negated:
            mapped[..., negated] *= -1
        return mapped


@dataclass(frozen=True)
class Symmetry:
    """A reflection: what observations, actions and reward terms are in the mirror."""

    name: str
    """"mirrored" is the one from left to right."""
    actions: SignedPermutation
    """Of a continuous action; of numbered ones, action i is `order[i]` in the mirror."""
    vector: SignedPermutation | None
    """Of an observation that is a vector, else None."""
    channels: tuple[int, ...] | None
    """Of images (H, W, C), which are flipped from left to right: the channel that each comes from,
    as two eyes change places. None without images."""
    beams: tuple[int, ...] | None
    """Of a lidar, the beam that each range comes from; None without one."""
    odd: frozenset[str]
    """Reward terms that change their sign for the mirrored policy in the same world."""
    mixed: frozenset[str] = frozenset()
    """Those that do neither, or of which nothing is known; all others stay as they are."""
    same_world: bool = True
    """Whether the world is its own mirror image, so that a policy and its image earn the same where
    all terms stay. A track is not: it has other bends."""

    def parity(self, term: str) -> Literal[1, -1] | None:
        """Return what a reward term is multiplied by for the mirrored policy; None if unknown."""
        if term in self.mixed:
            return None
        return -1 if term in self.odd else 1

    def observe(self, obs: Any) -> Any:
        """Return what the mirrored policy observes, as new arrays.

        Args:
            obs: numpy arrays or torch tensors: vectors (…, O), images (…, H, W, C), or both kinds
                of a car's, by name: "camera" (…, H, W, C) and "lidar" (…, ranges).
        """
        if isinstance(obs, dict):
            assert self.beams is not None
            order = list(self.beams)
            return {"camera": self._flipped(obs["camera"]), "lidar": obs["lidar"][..., order]}
        return self._flipped(obs) if self.vector is None else self.vector(obs)

    def act(self, actions: Any) -> Any:
        """Return actions in the mirror: whole numbers (…) are numbered, others vectors (…, A).

        The same map leads back.
        """
        is_tensor = hasattr(actions, "new_tensor")  # of torch, which is not imported here
        if actions.is_floating_point() if is_tensor else actions.dtype.kind == "f":
            return self.actions(actions)
        if is_tensor:
            return actions.new_tensor(self.actions.order)[actions]
        import numpy as np

        return np.array(self.actions.order)[actions]

    def _flipped(self, images: Any) -> Any:
        """Return images (…, H, W, C) from left to right, with each channel in its place."""
        assert self.channels is not None
        is_tensor = hasattr(images, "new_tensor")
        flipped = images.flip(-2) if is_tensor else images[..., ::-1, :]
        mirrored = flipped.clone() if is_tensor else flipped.copy()
        for channel, source in enumerate(self.channels):
            if source != channel:  # indexing with a list is ten times as slow
                mirrored[..., channel] = flipped[..., source]
        return mirrored
