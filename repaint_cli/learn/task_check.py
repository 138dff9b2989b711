"""Whole episodes of a task with the policy that training begins with, and what is odd in them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import floor, log10
from typing import Any

import gymnasium
import numpy as np

from repaint_cli.envs.output import Output, output_to
from repaint_cli.envs.reward_terms import OWN_REWARD, RewardTerms, numbers_in
from repaint_cli.errors import CardError, DivergedError, RepaintError
from repaint_cli.learn.evaluation import never_reported
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.observed import narrow_features
from repaint_cli.learn.rollout.collect import collect, start
from repaint_cli.learn.rollout.storage import Rollout
from repaint_cli.learn.seeding import Purpose, generator
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces, by_name
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.task import FUNCTION, SCALE, Task

EPISODES = 4
LARGE_RETURN = 1e4
"""From here on a critic learns slowly."""
GOOD_RETURN = 100.0
"""About what a scale is to make of a larger one."""
MOSTLY = 0.9
"""The share of actions that may be out of bounds."""
LITTLE = 0.25
"""The share of an action's range that a first policy should reach."""


@dataclass
class TaskCheck:
    """What came of the episodes."""

    spaces: Spaces | None = None
    """What policies read and write, where the environment can be made."""
    n_steps: int = 0
    """Steps of all episodes."""
    returns: list[float] = field(default_factory=list)
    """Of each episode."""
    mean_terms: dict[str, float] = field(default_factory=dict)
    """What a step pays of each reward term, on average."""
    errors: list[RepaintError] = field(default_factory=list)
    """What training ends with."""
    warnings: list[str] = field(default_factory=list)
    """What else training stumbles over."""


def check_task(card: TaskCard) -> TaskCheck:
    """Play whole episodes as training begins, and tell all that it would stumble over."""
    check, output = TaskCheck(warnings=card.env.notices()), _Noted()
    with output_to(output):
        try:
            _play(card, check)
        except RepaintError as error:
            check.errors.append(error)
    check.warnings += output.lines()
    return check


def _play(card: TaskCard, check: TaskCheck) -> None:
    one = card.make_env(1)
    actions = one.single_action_space
    check.spaces = Spaces.of(one.single_observation_space, actions)
    one.close()
    try:
        card.check_symmetry(check.spaces)
        if card.symmetry and isinstance(actions, gymnasium.spaces.Box):
            card.symmetry.check_bounds(actions.low.tolist(), actions.high.tolist())
    except CardError as error:
        check.errors.append(error)
    card.env.longest_episode()  # without a limit episodes might never end
    try:
        card.check_rollout()
    except CardError as error:
        check.errors.append(error)
    student = ActorCritic(check.spaces, card.net, 1)
    learner = Learner.fresh(student, [0], card.ppo.learning_rate)
    made, obs = start(card, [0], EPISODES, Purpose.TRAIN, 1, one_episode=True)
    env = _CheckedTerms(made.env, card.reward, card.env.records)
    try:
        rollout = collect(env, obs, student.policy, [generator(0, Purpose.ACT, 1)])
    finally:
        env.close()
        env.conclude(check)
    learner.update_normalizer(rollout)
    valid = rollout.valid
    check.n_steps = int(valid.sum())
    check.returns = (rollout.rewards * valid).sum(0).ravel().tolist()
    means = rollout.reward_terms[valid].mean(0).tolist()
    check.mean_terms = dict(zip(env.names, means, strict=True))
    check.warnings += _oddities(env, rollout, [] if check.errors else check.returns, card)
    if line := narrow_features(student.normalizer):
        check.warnings.append(line)


class _CheckedTerms(RewardTerms):
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

    def conclude(self, check: TaskCheck) -> None:
        """Add what was noted."""
        check.errors += self.errors.values()
        missing = self.unreported if self.n_acted else set()
        if missing:
            check.errors.append(never_reported(missing, self._numbers_seen, self.n_acted))
        for name, t in self._first_absence.items():
            if name not in missing:
                share = 100 - 100 * self._n_reports[name] / self.n_acted
                check.warnings.append(
                    f"the reward term '{name}' is left out in {share:.2g} % of the steps, first in "
                    f"step {t} of an episode, and counts as 0 there"
                )


class _Noted(Output):
    """Notes what an environment prints, and warnings."""

    def __init__(self) -> None:
        super().__init__()
        self._printed, self._warnings = "", dict[str, None]()
        self._n_lines = 0

    def prints(self, text: str) -> None:
        """Note the first line, and count all of them."""
        self._n_lines += text.count("\n")
        if len(self._printed) < 1000:
            self._printed += text

    def warns(self, text: str) -> None:
        """Note a warning."""
        self._warnings[text] = None

    def lines(self) -> list[str]:
        """Return what is worth a line each."""
        first = next(filter(None, map(str.strip, self._printed.splitlines())), None)
        prints = [] if first is None else [
            f"the environment prints {max(1, self._n_lines)} lines, such as '{first:.60}'; in a "
            "training they go to environment.log in the run's folder"
        ]  # fmt: skip
        return [*self._warnings, *prints]


def _oddities(
    env: RewardTerms, rollout: Rollout, returns: list[float], task: Task
) -> Iterator[str]:
    """Yield what is odd in actions, observations and returns, where those are known."""
    observations, actions = env.single_observation_space, env.single_action_space
    if isinstance(actions, gymnasium.spaces.Box):
        drawn = rollout.actions[rollout.valid].astype(np.float64)  # (B, A)
        yield from _odd_bounds(drawn, actions.low.astype(float), actions.high.astype(float))
    for space in by_name(observations).values():
        if len(space.shape or ()) == 3 and space.dtype != np.uint8:
            yield (
                f"images are of {space.dtype}; expected uint8, since networks divide their pixels "
                "by 255"
            )
    if not returns:
        return
    if (largest := float(np.abs(returns).max())) > LARGE_RETURN:
        help_ = "smaller weights in [reward] help"
        if task.reward_code:
            wanted = task.reward[FUNCTION] * 10.0 ** -floor(log10(largest / GOOD_RETURN))
            help_ = f"in [reward], {SCALE} = {wanted:.0e} beside the function helps"
        yield f"returns of {largest:.2g} are large, and a critic learns them slowly; {help_}"
    if np.ptp(returns) == 0:
        yield (
            f"all {len(returns)} episodes return {returns[0]:.4g}: nothing tells a better action "
            "from a worse one yet"
        )


def _odd_bounds(drawn: np.ndarray, low: np.ndarray, high: np.ndarray) -> Iterator[str]:
    """Yield where a first policy's actions (B, A) are far from what the bounds (A,) allow."""
    advice = "give the environment bounds of about -1 to 1 (gymnasium.wrappers.RescaleAction)"
    for i, column in enumerate(drawn.T):
        clipped = np.clip(column, low[i], high[i])
        outside, reach = np.mean(clipped != column), np.ptp(clipped) / (high[i] - low[i])
        if outside > MOSTLY:
            what = f"{100 * outside:.0f} % of them are out of bounds"
        elif reach < LITTLE and np.isfinite(high[i] - low[i]):
            what = f"they reach {clipped.min():.2g} to {clipped.max():.2g} of these"
        else:
            continue
        yield (
            f"action {i} has bounds of {low[i]:g} to {high[i]:g}, and a first policy's actions "
            f"are mostly within -2 to 2: {what}; {advice}"
        )
        return  # the others are mostly the same
