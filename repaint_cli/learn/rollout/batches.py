"""Batches of S seeds, each with a number of entries of its own: picking, laying together."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Self

import torch
from torch import Tensor

from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.policies.distributions import Distribution, concat_policies
from repaint_cli.settings import PPOConfig


class SeedBatch:
    """Entries of S seeds, (S, B, …) in every field beside `observations` and `counts`.

    Each seed's first counts[s] entries are real. Fields named `…rows` refer to the observations.
    The counts are the host's wherever the rest lies, so that asking for them waits for nothing.
    """

    observations: Observations
    counts: Tensor

    @property
    def columns(self) -> dict[str, Any]:
        """The fields with an entry each, by name; None where one is absent."""
        names = [field.name for field in fields(self)]  # type: ignore[arg-type]
        return {n: getattr(self, n) for n in names if n not in ("observations", "counts")}

    @property
    def mask(self) -> Tensor:
        """Which entries are real, (S, B) bool."""
        width = self.columns["rows"].shape[1]
        return torch.arange(width) < self.counts.unsqueeze(1)

    def to(self, device: torch.device) -> Self:
        """Return the batch with everything but the counts on a device."""
        columns = {
            name: column.to(device)
            for name, column in self.columns.items() if column is not None
        }  # fmt: skip
        observations = self.observations.to(device)
        return replace(self, observations=observations, **columns)  # type: ignore[type-var]

    def alone(self, seed: int) -> Self:
        """Return one seed's entries without padding, as if it were the only one."""
        row, n = slice(seed, seed + 1), int(self.counts[seed])
        columns = {
            name: column.alone(seed, n) if isinstance(column, Distribution) else column[row, :n]
            for name, column in self.columns.items() if column is not None
        }  # fmt: skip
        store = self.observations.stores[seed]
        return replace(  # type: ignore[type-var]
            self, observations=Observations([store]), counts=self.counts[row], **columns
        )

    def pick(self, positions: Tensor, counts: Tensor) -> Self:
        """Return the entries at positions (S, K), of which each seed's first counts[s] are real."""
        device = self.columns["rows"].device
        positions = positions.to(device)
        seeds = torch.arange(len(positions), device=device).unsqueeze(1)
        picked = {
            name: None if column is None else column[seeds, positions]
            for name, column in self.columns.items()
        }
        return replace(self, counts=counts, **picked)  # type: ignore[type-var]

    def first(self, n: int) -> Self:
        """Return at most the first n entries of each seed."""
        counts = self.counts.clamp(max=n)
        return self.pick(torch.arange(int(counts.max())).expand(len(counts), -1), counts)

    def within(self, ppo: PPOConfig, which: int = 0, of: int = 1) -> Self:
        """Return no more entries of a seed than steps asked for, where episodes are played out.

        Of several who share the steps, `which` counts from 0.
        """
        if ppo.n_episodes or ppo.n_steps is None or not ppo.whole_episodes:
            return self
        return self.first(even_share(ppo.n_steps, which, of))

    @classmethod
    def concatenate(cls, several: Sequence[Self]) -> Self:
        """Return several batches as one, each seed's entries in order."""
        if len(several) == 1:
            return several[0]
        before = torch.zeros(len(several[0].counts), 1, dtype=torch.int64)
        columns: dict[str, list[Any]] = {name: [] for name in several[0].columns}
        for batch in several:
            for name, column in batch.columns.items():
                columns[name].append(column + before if name.endswith("rows") else column)
            before = before + batch.observations.sizes.unsqueeze(1)
        whole = replace(
            several[0],  # type: ignore[type-var]
            observations=Observations.concatenate([batch.observations for batch in several]),
            **{name: _concatenated(column) for name, column in columns.items()},
        )
        return whole.pick(*front(torch.cat([batch.mask for batch in several], 1)))


def _concatenated(columns: Sequence[Any]) -> Any:
    if columns[0] is None:
        return None
    return (
        torch.cat(list(columns), 1) if isinstance(columns[0], Tensor) else concat_policies(columns)
    )


def row_sums(numbers: Tensor, counts: Tensor) -> Tensor:
    """Return the sum of each seed's first counts[s] numbers, (S, B) → (S,).

    Not of a padded row: torch sums in another order where the row is longer.
    """
    return torch.cat([numbers[s : s + 1, :n].sum(1) for s, n in enumerate(counts.tolist())])


def even_share(total: int, which: int, of: int) -> int:
    """Return the share of number `which` of several who share a total; the first get the rest."""
    return total // of + (which < total % of)


def front(mask: Tensor) -> tuple[Tensor, Tensor]:
    """Return the positions of a mask (S, B) that are true, (S, K), and their counts, (S,)."""
    counts = mask.sum(1)
    return torch.argsort(~mask, dim=1, stable=True)[:, : int(counts.max())], counts
