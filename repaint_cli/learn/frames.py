"""Observations: one array, or several by name such as camera and lidar; each is stored once."""

from collections.abc import Callable, Mapping
from operator import getitem
from typing import Any

import torch
from torch import Tensor


def each(change: Callable[..., Any], obs: Any, *args: Any) -> Any:
    """Return change(array, *args) of an array of observations, or of each of several by name."""
    if isinstance(obs, Mapping):
        return {name: change(part, *args) for name, part in obs.items()}
    return change(obs, *args)


def parts(obs: Any) -> list[Any]:
    """Return the arrays of observations, one or several."""
    return list(obs.values()) if isinstance(obs, Mapping) else [obs]


def joined(pieces: list[Any], join: Callable[..., Tensor] = torch.cat) -> Any:
    """Return observations in pieces as one."""
    if isinstance(pieces[0], Mapping):
        return {name: join([piece[name] for piece in pieces]) for name in pieces[0]}
    return join(pieces)


class Frames:
    """The observations of a rollout, each stored once; images stay uint8, seed by seed."""

    def __init__(self, stores: list[Any]) -> None:
        """Keep S stores (M_s, *O); vectors are stacked, as they are small and read often."""
        self.stores = stores
        self._stacked = None
        if stores and all(isinstance(store, Tensor) and store.ndim == 2 for store in stores):
            longest = max(len(store) for store in stores)
            self._stacked = torch.stack([_pad(store, longest) for store in stores])
            self._seeds = torch.arange(len(stores)).unsqueeze(1)

    @property
    def sizes(self) -> Tensor:
        """How many observations each seed has, (S,)."""
        return torch.tensor([len(parts(store)[0]) for store in self.stores])

    @property
    def small(self) -> bool:
        """Whether all of them may be looked at in one go."""
        return self._stacked is not None

    def take(self, rows: Tensor) -> Any:
        """Return the observations at rows (S, B) of each seed's store, (S, B, *O)."""
        if self._stacked is not None:
            return self._stacked[self._seeds, rows]
        taken = [each(getitem, *own) for own in zip(self.stores, rows, strict=True)]
        return joined(taken, torch.stack)


def _pad(store: Tensor, length: int) -> Tensor:
    return torch.cat([store, store.new_zeros(length - len(store), *store.shape[1:])])
