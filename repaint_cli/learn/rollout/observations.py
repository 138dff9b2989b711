"""Observations: one array, or several by name such as camera and lidar; each is stored once."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

BLOCK = 256
"""Observations for which a store makes room at a time."""


def each(change: Callable[..., Any], obs: Any, *args: Any) -> Any:
    """Return change(array, *args) of an array of observations, or of each of several by name."""
    if isinstance(obs, Mapping):
        return {name: change(array, *args) for name, array in obs.items()}
    return change(obs, *args)


def arrays_of(obs: Any) -> list[Any]:
    """Return the arrays of observations, one or several."""
    return list(obs.values()) if isinstance(obs, Mapping) else [obs]


def stacked(seeds: list[Any]) -> Any:
    """Return each seed's observations (B, *O) as one, (S, B, *O)."""
    if isinstance(seeds[0], Mapping):
        return {name: torch.stack([own[name] for own in seeds]) for name in seeds[0]}
    return torch.stack(seeds)


def _concatenated(stores: Sequence[Any]) -> Any:
    if isinstance(stores[0], Mapping):
        return {name: torch.cat([store[name] for store in stores]) for name in stores[0]}
    return torch.cat(list(stores))


class ObservationStore:
    """One seed's observations in an array that grows in place, so that none is in memory twice.

    Images are uint8, all else float32.
    """

    def __init__(self, like: np.ndarray) -> None:
        """Start empty, for observations of the shape and type of like[0, 0]."""
        self._array = np.empty((0, *like.shape[2:]), np.uint8 if like.dtype == np.uint8 else "f4")
        self._size = 0

    def append(self, obs: np.ndarray) -> None:
        """Add observations (K, *O)."""
        size = self._size + len(obs)
        if size > len(self._array):
            self._resize(size + BLOCK)
        self._array[self._size : size] = obs
        self._size = size

    def tensor(self) -> Tensor:
        """Return all of them, (M, *O), without a copy; nothing can be added afterwards."""
        self._resize(self._size)
        array = self._array
        del self._array  # its memory may move only while no tensor shares it
        return torch.from_numpy(array)

    def _resize(self, length: int) -> None:
        # numpy's check of references would count those of debuggers and tracers, too.
        self._array.resize((length, *self._array.shape[1:]), refcheck=False)


class Observations:
    """The observations of a rollout, each stored once; images stay uint8, seed by seed."""

    def __init__(self, stores: list[Any]) -> None:
        """Keep S stores (M_s, *O); vectors are stacked, as they are small and read often."""
        self.stores = stores
        self._stacked = None
        if stores and all(isinstance(store, Tensor) and store.ndim == 2 for store in stores):
            longest = max(len(store) for store in stores)
            self._stacked = torch.stack([_pad(store, longest) for store in stores])
            self._seeds = torch.arange(len(stores), device=self.device).unsqueeze(1)

    @classmethod
    def concatenate(cls, several: Sequence["Observations"]) -> "Observations":
        """Return several rollouts' observations one after the other, seed by seed."""
        per_seed = zip(*(observations.stores for observations in several), strict=True)
        return cls([_concatenated(stores) for stores in per_seed])

    @property
    def device(self) -> torch.device:
        """Where they lie."""
        device: torch.device = arrays_of(self.stores[0])[0].device
        return device

    def to(self, device: torch.device) -> "Observations":
        """Return them on a device: themselves where they lie there, else copies."""
        if not self.stores or device == self.device:
            return self
        return Observations([each(lambda store: store.to(device), own) for own in self.stores])

    @property
    def sizes(self) -> Tensor:
        """How many observations each seed has, (S,)."""
        return torch.tensor([len(arrays_of(store)[0]) for store in self.stores])

    @property
    def small(self) -> bool:
        """Whether they are small enough for one pass of a network over all of them."""
        return self._stacked is not None

    def take(self, rows: Tensor) -> Any:
        """Return the observations at rows (S, B) of each seed's store, (S, B, *O)."""
        rows = rows.to(self.device)
        if self._stacked is not None:
            return self._stacked[self._seeds, rows]
        taken = [each(_rows, *own) for own in zip(self.stores, rows, strict=True)]
        return stacked(taken)


def _rows(store: Tensor, rows: Tensor) -> Tensor:
    """Return store[rows], (B, *O), of rows (B,): images a tenth as slowly as by indexing."""
    return store.index_select(0, rows)


def _pad(store: Tensor, length: int) -> Tensor:
    return torch.cat([store, store.new_zeros(length - len(store), *store.shape[1:])])
