"""The text of a card for an environment of Gymnasium: reward terms found by playing it."""

import numpy as np

from repaint_cli.envs.gymnasium.fitted_terms import FittedTerms, fit_terms
from repaint_cli.envs.gymnasium.played import Played, play
from repaint_cli.envs.gymnasium.simulator import GymnasiumSimulator
from repaint_cli.envs.reward_terms import OWN_REWARD
from repaint_cli.files.toml import toml_key, toml_line
from repaint_cli.policies.spaces import Spaces

STEPS = 2048
"""Of a rollout."""
MOST_ENVS = 40
CUT_ENVS = 8
"""Environments where an episode is longer than a rollout."""
LONG = 500
"""Steps from which on few episodes are evaluated: they would take longer than the training."""


def new_card(env_id: str) -> str:
    """Return a card as TOML, with comments that say how it was chosen.

    Raises:
        CardError: the environment cannot be made or played, has no time limit, or spaces that no
            policy of ours reads and writes.
    """
    simulator = GymnasiumSimulator(simulator="gymnasium", id=env_id)
    limit = simulator.longest_episode()
    spaces = _spaces_of(simulator)
    played = play(simulator)
    fitted = fit_terms(played)
    network = ["", "[net]", 'kind = "cnn"'] if spaces.image else []
    lines = [
        f"# {env_id} has {spaces}, and at most {limit:,} steps an episode.",
        f"# It was played with random actions: {_how_played(played)}.",
        toml_line("summary", f"{env_id}, with its own reward."),
        "",
        "[env]",
        'simulator = "gymnasium"',
        toml_line("id", env_id),
        "",
        *_reward_lines(played, fitted),
        *network,
        "",
        *_rollout_lines(limit),
        "",
        "[eval]",
        f"episodes = {20 if limit <= LONG else 5}",
    ]
    return "\n".join(lines) + "\n"


def _spaces_of(simulator: GymnasiumSimulator) -> Spaces:
    env = simulator.make(1, False, None)
    try:
        return Spaces.of(env.single_observation_space, env.single_action_space)
    finally:
        env.close()


def _how_played(played: Played) -> str:
    text = f"{len(played.rewards):,} steps"
    if returns := played.returns:
        text += f"; {len(returns)} whole episodes returned {min(returns):.4g} to {max(returns):.4g}"
    return text


def _reward_lines(played: Played, fitted: FittedTerms) -> list[str]:
    """Return the section [reward], and how its weights were chosen."""
    weights = fitted.weights or {OWN_REWARD: 1.0}
    terms = [
        f"{toml_line(name, weight)} # {_span(played, name)} in a step"
        + (": whether the reward has it is not known" if name in fitted.always_zero else "")
        for name, weight in weights.items()
    ]
    left = [toml_key(name) for name in played.numbers if name not in weights]
    others = [f"# Other numbers of its infos, without weight: {', '.join(left)}"] if left else []
    return [f"# {_how_chosen(played, fitted)}", "[reward]", *terms, *others]


def _how_chosen(played: Played, fitted: FittedTerms) -> str:
    """Return a sentence about the weights."""
    if not fitted.weights:
        if not played.numbers:
            return "The environment's own reward: its infos hold no numbers."
        return "The environment's own reward: no sum of its infos' numbers is that in every step."
    what, verb = "These numbers of its infos", "add up to"
    if len(fitted.weights) == 1:
        what, verb = "This number of its infos", "is"
    how = "" if set(fitted.weights.values()) == {1.0} else ", times the weight,"
    return f"{what}{how} {verb} the environment's own reward in every step."


def _span(played: Played, name: str) -> str:
    """Return from where to where a number goes."""
    column = played.rewards if name == OWN_REWARD else played.numbers[name]
    reported = column[~np.isnan(column)]
    low, high = f"{reported.min():.3g}", f"{reported.max():.3g}"
    text = f"always {low}" if low == high else f"{low} to {high}"
    share = len(reported) / len(column)
    return text if share == 1 else f"{text} in {100 * share:.2g} % of the steps, else 0,"


def _rollout_lines(limit: int) -> list[str]:
    """Return the section [ppo] for a time limit."""
    n_envs = min(MOST_ENVS, STEPS // (limit + 1)) or CUT_ENVS
    each = STEPS // n_envs
    fit = "a whole episode fits" if each > limit else "an episode goes on in the next rollout"
    return [
        f"[ppo] # each environment takes {each:,} steps in a rollout: {fit}",
        "n_iterations = 60",
        f"n_steps = {STEPS}",
        f"n_envs = {n_envs}",
    ]
