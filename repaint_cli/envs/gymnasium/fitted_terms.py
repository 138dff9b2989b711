"""Which numbers of an environment's infos add up to its reward: the reward terms of a new card."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from repaint_cli.envs.gymnasium.played import Played

EXACT = 1e-5
"""How far a sum may be from the reward, as a share of the largest number: some are float32."""
MOST_SUMMED = 12
"""Numbers of which every sum is tried."""
MOST_WEIGHED = 40
"""Numbers whose weights are fitted."""


@dataclass(frozen=True)
class FittedTerms:
    """Reward terms and their weights, by name; no terms where nothing gives the reward exactly."""

    weights: dict[str, float]
    """Their weighted sum was the reward in every step."""
    always_zero: tuple[str, ...] = ()
    """Those called rewards that were 0 in every step: part of the sum by their name alone."""


def fit_terms(played: Played) -> FittedTerms:
    """Find reward terms: numbers whose sum is the reward, else numbers whose weighted sum is.

    Numbers whose name has "reward" in it come first. A reward that never changes says little: only
    those count then.
    """
    numbers = {name: np.nan_to_num(column) for name, column in played.numbers.items()}
    called = [name for name in numbers if "reward" in name.lower()]
    always_zero = tuple(name for name in called if not numbers[name].any())
    others = [name for name in numbers if name not in called]
    if np.ptp(played.rewards) == 0:
        others = []
    nonzero = {name: numbers[name] for name in [*called, *others] if numbers[name].any()}
    summed = _summed(played.rewards, nonzero, [name for name in called if name in nonzero])
    summed = summed or _summed(played.rewards, nonzero, list(nonzero))
    if summed:
        return FittedTerms(dict.fromkeys([*summed, *always_zero], 1.0), always_zero)
    if np.ptp(played.rewards) == 0:
        return FittedTerms({})
    return FittedTerms(_weighed(played.rewards, nonzero))


def _summed(
    rewards: np.ndarray, nonzero: dict[str, np.ndarray], names: list[str]
) -> tuple[str, ...] | None:
    """Return the largest group of these numbers that adds up to the rewards (B,), if any does."""
    if len(names) > MOST_SUMMED:
        return None
    for size in range(len(names), 0, -1):
        for group in combinations(names, size):
            if _is_exact(rewards, [nonzero[name] for name in group]):
                return group
    return None


def _weighed(rewards: np.ndarray, nonzero: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the weights with which numbers add up to the rewards (B,); none where none do."""
    names = list[str]()
    for name in list(nonzero)[:MOST_WEIGHED]:
        columns = np.stack([nonzero[one] for one in [*names, name]], axis=1)
        scaled = columns / np.abs(columns).max(0)
        if np.linalg.matrix_rank(scaled, tol=1e-6 * np.sqrt(len(rewards))) == len(names) + 1:
            names.append(name)  # what others add up to has no weight of its own
    if not names or len(rewards) < 10 * len(names):
        return {}
    columns = np.stack([nonzero[name] for name in names], axis=1)
    fitted = np.linalg.lstsq(columns, rewards, rcond=None)[0]
    parts = np.abs(fitted * columns).max(0)
    weights = {
        name: float(f"{weight:.5g}")
        for name, weight, part in zip(names, fitted, parts, strict=True)
        if part > EXACT * parts.max()
    }
    exact = _is_exact(rewards, [weight * nonzero[name] for name, weight in weights.items()])
    return weights if exact else {}


def _is_exact(rewards: np.ndarray, parts: Iterable[np.ndarray]) -> bool:
    """Return whether parts, (B,) each, add up to the rewards in every step."""
    parts = list(parts)
    largest = max(float(np.abs(part).max()) for part in [*parts, rewards])
    return bool(np.abs(sum(parts, np.zeros(len(rewards))) - rewards).max() <= EXACT * largest)
