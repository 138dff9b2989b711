"""What a reward function weighs, so that its task can be compared: a least squares fit.

A DeepRacer user's function has no weights w. Where it is nearly a weighted sum of the racer's
terms φ anyway, r ≈ w·φ over recorded states gives them (paper, section 6, asks for such a form).
"""

from dataclasses import dataclass

import numpy as np

from repaint_cli.errors import CardError
from repaint_cli.simulators import RacerEnv, load_track
from repaint_cli.tasks import TaskCard

N_CARS, N_STEPS = 64, 250
LEAST_R_SQUARED = 0.9
"""Below this a function is no weighted sum, and a cosine would say nothing."""
NEGLIGIBLE = 1e-6
"""A weight that much smaller than the largest is 0."""


@dataclass(frozen=True)
class Fit:
    """How a reward function weighs the racer's terms."""

    weights: dict[str, float]
    """w by the terms' names."""
    r_squared: float
    """R², the share of the reward's variance that w·φ explains."""
    n_states: int
    """Over how many states."""

    def __str__(self) -> str:
        terms = ", ".join(f"{name} {weight:.3g}" for name, weight in self.weights.items())
        return f"{terms} (R² {self.r_squared:.3f} over {self.n_states:,} states)"


def fit(task: TaskCard) -> Fit:
    """Fit the weights of a task's reward function on what 64 wandering cars meet.

        w = argmin Σ (r − w·φ)²,   R² = 1 − Σ (r − w·φ)² / Σ (r − r̄)²

    Raises:
        CardError: the function failed, or always pays the same.
    """
    phi, paid, names = _record(task)
    w, *_ = np.linalg.lstsq(phi, paid, rcond=None)
    w[np.abs(w) < NEGLIGIBLE * np.abs(w).max()] = 0.0
    spread = ((paid - paid.mean()) ** 2).sum()
    if spread == 0 or not w.any():
        raise CardError(f"the reward function of '{task.name}' always pays {paid[0]:.4g}")
    r_squared = 1 - ((paid - phi @ w) ** 2).sum() / spread
    return Fit(dict(zip(names, w.tolist(), strict=True)), float(r_squared), len(paid))


def weighed(task: TaskCard, found: Fit) -> TaskCard:
    """Return the task with fitted weights in place of its reward function.

    Raises:
        CardError: the function is no weighted sum of the terms, R² < 0.9.
    """
    if found.r_squared < LEAST_R_SQUARED:
        raise CardError(
            f"expected the reward function of '{task.name}' to be nearly a weighted sum of "
            f"{', '.join(found.weights)} (R² of at least {LEAST_R_SQUARED}), found R² "
            f"{found.r_squared:.3f}; a cosine would say nothing"
        )
    return task.model_copy(update={"reward": found.weights, "reward_code": None})


def _record(task: TaskCard) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Return the terms (B, F) and rewards (B,) of B states, and the terms' names."""
    from repaint_cli.envs.racer.car import commands_of
    from repaint_cli.envs.racer.fleet import Fleet
    from repaint_cli.envs.racer.reward_file import RewardFunction
    from repaint_cli.envs.racer.wander import wander

    env, code = task.env, task.reward_code
    assert isinstance(env, RacerEnv)
    assert code is not None
    fleet = Fleet(load_track(env.track), N_CARS, env.car, env.max_steps, env.n_bots, env.crash)
    functions = [RewardFunction(code.name, code.source) for _ in range(N_CARS)]
    phi, paid, names = [], [], list[str]()
    for rows, gained in wander(fleet, commands_of(env.actions), N_STEPS, seed=0):
        terms = fleet.terms(rows, gained)
        names = list(terms)
        phi.append(np.stack([*terms.values()], axis=1))
        paid += [functions[row](fleet.params(row), row) for row in rows.tolist()]
    return np.concatenate(phi), np.array(paid), names
