"""Sets of choices with a name: `--preset` and `--auto`. Settings as in --set."""

from collections.abc import Sequence

from repaint_cli.errors import UsageError
from repaint_cli.tasks.methods import METHODS, method_for

PRESETS = {
    "coach": (
        "ppo.time_limit=terminal",
        "ppo.vf_coef=1.0",
        "ppo.clip_decay=488",  # 10⁶ steps of 2,048 an iteration
        "ppo.whole_episodes=true",
        "ppo.n_envs=1",  # whose episodes follow one another, so that the last one is cut
    ),
}
"""`coach`: what the framework of the paper's experiments does where our defaults differ (RL Coach's
clipped PPO for MuJoCo), to approach the paper's own baseline."""

AUTOMATIC = {
    "transfer.phases=auto": ("transfer.phases", "transfer.representation", "transfer.instance"),
    "transfer.kickstart_schedule=auto": ("transfer.kickstart_schedule", "transfer.kickstart_coef"),
    "select.rule=auto": ("select.rule", "select.threshold"),
    "transfer.iterations=1000000": ("transfer.iterations",),  # the end is found long before
}
"""Settings with which the ratio, β, ζ and the end of the transfer are measured; a setting of those
behind them decides it by hand."""


def automatic_settings(settings: Sequence[str], algorithm: str, method: str | None) -> list[str]:
    """Return settings after those of `AUTOMATIC` that they leave to be measured.

    Raises:
        NotFound: there is no such algorithm or method.
        UsageError: the method has none of these.
    """
    name = method_for(algorithm, method)
    if not (METHODS[name].kickstart and METHODS[name].alternates):
        raise UsageError(f"expected method 'repaint' to be automatic, found '{name}'")
    by_hand = {setting.partition("=")[0] for setting in settings}
    automatic = [text for text, deciding in AUTOMATIC.items() if not by_hand.intersection(deciding)]
    return [*automatic, *settings]
