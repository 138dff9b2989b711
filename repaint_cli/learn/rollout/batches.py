"""Batches of S seeds, each with a number of entries of its own: picking, laying together."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Self

import torch
from torch import Tensor

from repaint_cli.learn.rollout.observations import Frames
from repaint_cli.policies.distributions import concat_policies
from repaint_cli.settings import PPOConfig


class Batch:
    """What a batch can do; its fields beside `frames` and `counts` have an entry each, (S, B, …).

    Each seed's first counts[s] entries are real. Fields named `…rows` refer to the frames.
    """

    frames: Frames
    counts: Tensor

    @property
    def parts(self) -> dict[str, Any]:
        """The fields with an entry each, by name; None where one is absent."""
        names = [part.name for part in fields(self) if part.name not in ("frames", "counts")]  # type: ignore[arg-type]
        return {name: getattr(self, name) for name in names}

    @property
    def mask(self) -> Tensor:
        """Which entries are real, (S, B) bool."""
        width = self.parts["rows"].shape[1]
        return torch.arange(width) < self.counts.unsqueeze(1)

    def pick(self, positions: Tensor, counts: Tensor) -> Self:
        """Return the entries at positions (S, K), of which each seed's first counts[s] are real."""
        seeds = torch.arange(len(positions)).unsqueeze(1)
        picked = {
            name: None if part is None else part[seeds, positions]
            for name, part in self.parts.items()
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
        return self.first(share_of(ppo.n_steps, which, of))

    @classmethod
    def together(cls, several: Sequence[Self]) -> Self:
        """Return several batches as one, each seed's entries in order."""
        if len(several) == 1:
            return several[0]
        before = torch.zeros(len(several[0].counts), 1, dtype=torch.int64)
        columns: dict[str, list[Any]] = {name: [] for name in several[0].parts}
        for batch in several:
            for name, part in batch.parts.items():
                columns[name].append(part + before if name.endswith("rows") else part)
            before = before + batch.frames.sizes.unsqueeze(1)
        whole = replace(
            several[0],  # type: ignore[type-var]
            frames=Frames.together([batch.frames for batch in several]),
            **{name: _end_to_end(column) for name, column in columns.items()},
        )
        return whole.pick(*front(torch.cat([batch.mask for batch in several], 1)))


def _end_to_end(column: Sequence[Any]) -> Any:
    if column[0] is None:
        return None
    return torch.cat(list(column), 1) if isinstance(column[0], Tensor) else concat_policies(column)


def share_of(total: int, which: int, of: int) -> int:
    """Return what falls to one of several who share evenly, the first of them first."""
    return total // of + (which < total % of)


def front(kept: Tensor) -> tuple[Tensor, Tensor]:
    """Return the positions of what is kept (S, B), in order, (S, K), and their counts, (S,)."""
    counts = kept.sum(1)
    return torch.argsort(~kept, dim=1, stable=True)[:, : int(counts.max())], counts
