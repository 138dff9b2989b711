"""What a reward function weighs, so that its task can be compared: a least squares fit.

A DeepRacer user's function has no weights w. Where it is nearly a weighted sum of the racer's
terms φ anyway, r ≈ w·φ over recorded states gives them (paper, section 6, asks for such a form).
"""

import sys
from contextlib import redirect_stdout
from dataclasses import dataclass

import numpy as np

from repaint_cli.errors import CardError
from repaint_cli.tasks.card import TaskCard

LEAST_R_SQUARED = 0.9
"""Below this a function is no weighted sum, and a cosine would be meaningless."""
NEGLIGIBLE = 0.02
"""A term that moves the reward by less, in its standard deviations, weighs 0."""


@dataclass(frozen=True)
class Fit:
    """How a reward function weighs the racer's terms."""

    weights: dict[str, float]
    """w by the terms' names."""
    constant: float
    """What it pays for every step besides; no term, and so in no cosine."""
    r_squared: float
    """R², the share of the reward's variance that w·φ explains."""
    n_states: int
    """Over how many states."""

    def __str__(self) -> str:
        terms = ", ".join(f"{name} {weight:.3g}" for name, weight in self.weights.items())
        always = f", {self.constant:.3g} always" if abs(self.constant) >= 0.005 else ""
        return f"{terms}{always} (R² {self.r_squared:.3f} over {self.n_states:,} states)"


def fit(task: TaskCard) -> Fit:
    """Fit the weights of a task's reward function on what 64 wandering cars meet.

        w, c = argmin Σ (r − w·φ − c)²,   R² = 1 − Σ (r − w·φ − c)² / Σ (r − r̄)²

    What it prints goes to stderr.

    Raises:
        CardError: the function failed, or always pays the same.
    """
    code, functions = task.reward_code, task.env.reward_functions
    assert code is not None
    assert functions is not None
    with redirect_stdout(sys.stderr):
        phi, paid, names = functions.sample(code.name, code.source)
    if np.ptp(paid) == 0:
        raise CardError(f"the reward function of '{task.name}' always pays {paid[0]:.4g}")
    w, constant = _least_squares(phi, paid, np.ones(len(names), np.bool_))
    matters = np.abs(w) * phi.std(axis=0) >= NEGLIGIBLE * paid.std()
    w, constant = _least_squares(phi, paid, matters)
    residuals = paid - phi @ w - constant
    r_squared = 1 - (residuals**2).sum() / ((paid - paid.mean()) ** 2).sum()
    weights = dict(zip(names, w.tolist(), strict=True))
    return Fit(weights, constant, float(r_squared), len(paid))


def _least_squares(
    phi: np.ndarray, paid: np.ndarray, matters: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the weights (F,) of the terms that matter (F,), 0 for the others, and a constant."""
    columns = np.column_stack([phi[:, matters], np.ones(len(phi))])
    solution, *_ = np.linalg.lstsq(columns, paid, rcond=None)
    w = np.zeros(phi.shape[1])
    w[matters] = solution[:-1]
    return w, float(solution[-1])


def with_fitted_weights(task: TaskCard, fitted: Fit) -> TaskCard:
    """Return the task with fitted weights in place of its reward function.

    Raises:
        CardError: the function is no weighted sum of the terms, R² < 0.9.
    """
    if fitted.r_squared < LEAST_R_SQUARED:
        raise CardError(
            f"expected the reward function of '{task.name}' to be nearly a weighted sum of "
            f"{', '.join(fitted.weights)} (R² of at least {LEAST_R_SQUARED}), found R² "
            f"{fitted.r_squared:.3f}; a cosine would say nothing"
        )
    return task.model_copy(update={"reward": fitted.weights, "reward_code": None})
