"""Sets of choices with a name: `--preset` and `--auto`. Settings as in --set."""

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

UNTIL_MEASURED = 10**6
"""K where the end of the transfer is measured."""


def automatic_settings(algorithm: str, method: str | None) -> list[str]:
    """Return the settings with which β, ζ, the ratio and the end of the transfer are measured.

    Raises:
        NotFound: there is no such algorithm or method.
        UsageError: the method has none of these.
    """
    name = method_for(algorithm, method)
    if not (METHODS[name].kickstart and METHODS[name].alternates):
        raise UsageError(f"expected method 'repaint' to be automatic, found '{name}'")
    return [
        "transfer.phases=auto",
        "transfer.kickstart_schedule=auto",
        "select.rule=auto",
        f"transfer.iterations={UNTIL_MEASURED}",
    ]
