"""Reward terms of environments, and what is wrong with them: for `repaint tasks check`."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from repaint_cli.envs.reward_terms import OWN_REWARD, RewardTerms, numbers_in
from repaint_cli.errors import CardError, DivergedError, RepaintError
from repaint_cli.learn.evaluation import never_reported


class CheckedTerms(RewardTerms):
    """Reward terms of environments that note what is wrong with one, and go on with 0 of it."""

    def __init__(self, env: Any, weights: dict[str, float], records: Sequence[str]) -> None:
        super().__init__(env, weights, records)
        self.n_acted = 0
        self.errors: dict[str, RepaintError] = {}
        """By the name of the term."""
        self._steps = np.zeros(env.num_envs, int)  # of each environment's episode
        self._n_reports = dict.fromkeys(weights, 0)
        self._first_absence: dict[str, int] = {}
        self._numbers_seen: set[str] = set()

    def step(self, actions: Any) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Advance every environment by one step, and look at what it reports."""
        acting = ~self._ended
        self._steps = np.where(acting, self._steps + 1, 0)
        obs, _, terminated, truncated, info = super().step(actions)
        self.n_acted += int(acting.sum())
        self._numbers_seen |= {*numbers_in(info)} - self.unreported
        for column, name in enumerate(self.names):
            self._count(name, info, acting)
            terms = info["reward_terms"][:, column]
            if not np.isfinite(terms).all():
                n = int(np.argmin(np.isfinite(terms)))
                problem = f"the reward term '{name}' is {terms[n]} in step {self._steps[n]}"
                self.errors.setdefault(name, DivergedError(f"{problem} of an episode"))
                terms[~np.isfinite(terms)] = 0
        return obs, info["reward_terms"] @ self.weights, terminated, truncated, info

    def _count(self, name: str, info: Mapping[str, Any], acting: np.ndarray) -> None:
        absent = acting
        if name in info:
            mask = True if name == OWN_REWARD else info.get(f"_{name}", True)
            absent = acting & ~np.broadcast_to(mask, acting.shape)
        self._n_reports[name] += int((acting & ~absent).sum())
        if absent.any():
            self._first_absence.setdefault(name, int(self._steps[absent].min()))

    def _numbers(self, info: Mapping[str, Any], name: str) -> np.ndarray:
        try:
            return super()._numbers(info, name)
        except CardError as error:
            self.errors.setdefault(name, error)
            return np.zeros(self.num_envs)

    def conclude(self) -> tuple[list[RepaintError], list[str]]:
        """Return the errors and the warnings that were noted."""
        errors, warnings = [*self.errors.values()], list[str]()
        missing = self.unreported if self.n_acted else set()
        if missing:
            errors.append(never_reported(missing, self._numbers_seen, self.n_acted))
        for name, t in self._first_absence.items():
            if name not in missing:
                share = 100 - 100 * self._n_reports[name] / self.n_acted
                warnings.append(
                    f"the reward term '{name}' is left out in {share:.2g} % of the steps, first in "
                    f"step {t} of an episode, and counts as 0 there"
                )
        return errors, warnings
