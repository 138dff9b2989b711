"""Whole episodes of a task with the policy that training begins with, and what is odd in them."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from math import floor, log10

import gymnasium
import numpy as np

from repaint_cli.envs.output import CountedPrints, output_to
from repaint_cli.envs.reward_terms import RewardTerms
from repaint_cli.errors import CardError, RepaintError, RewardFailed
from repaint_cli.learn.checked_terms import CheckedTerms
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
    notes: list[str] = field(default_factory=list)
    """What is worth knowing besides."""


def check_task(card: TaskCard) -> TaskCheck:
    """Play whole episodes as training begins, and tell all that it would stumble over."""
    check, output = TaskCheck(), CountedPrints()
    with output_to(output):
        _drive(card, check)
        try:
            _play(card, check)
        except RepaintError as error:
            if not isinstance(error, RewardFailed) or error.place not in _places(check):
                check.errors.append(error)
    check.warnings += output.warnings
    if output.example:
        check.warnings.append(
            f"the environment prints {max(1, output.n_lines)} lines, such as '{output.example}'; "
            "in a training they go to environment.log in the run's folder"
        )
    return check


def _drive(card: TaskCard, check: TaskCheck) -> None:
    """Try a user's reward function in more than a first policy meets."""
    code, kind = card.reward_code, card.env.reward_functions
    if code and kind:
        with suppress(RepaintError):  # of the card, which playing comes upon, too
            tried = kind.check(code.name, code.source)
            check.errors += tried.errors
            check.warnings += tried.warnings
            check.notes += tried.notes


def _places(check: TaskCheck) -> set[str]:
    """Return the places where a reward function is known to fail."""
    return {error.place for error in check.errors if isinstance(error, RewardFailed)}


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
    check.notes += card.env.notes()
    check.warnings += card.env.doubts()
    try:
        card.check_rollout()
    except CardError as error:
        check.errors.append(error)
    student = ActorCritic(check.spaces, card.net, 1)
    learner = Learner.fresh(student, [0], card.ppo.learning_rate)
    made, obs = start(
        card, [0], card.env.even_episodes(EPISODES), Purpose.TRAIN, 1, one_episode=True
    )
    env = CheckedTerms(made.env, card.reward, card.env.records)
    try:
        rollout = collect(env, obs, student.policy, [generator(0, Purpose.ACT, 1)])
    finally:
        env.close()
        errors, warnings = env.conclude()
        check.errors += errors
        check.warnings += warnings
    learner.update_normalizer(rollout)
    valid = rollout.valid
    check.n_steps = int(valid.sum())
    check.returns = (rollout.rewards * valid).sum(0).ravel().tolist()
    means = rollout.reward_terms[valid].mean(0).tolist()
    check.mean_terms = dict(zip(env.names, means, strict=True))
    check.warnings += _oddities(env, rollout, [] if check.errors else check.returns, card)
    if line := narrow_features(student.normalizer):
        check.warnings.append(line)


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
