"""Which car is DeepRacer's of today."""

from collections.abc import Sequence

from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.simulator import Simulator

TODAY = "sim5"
OFF = {"sim4": 0.27, "sim5": 0.11}
"""How far a car is off after a second on DeepRacer's logs of 2026, median, m."""


def better_car(env: Simulator, files: Sequence[str]) -> str | None:
    """Return a sentence where a card with files for DeepRacer drives another car than today's."""
    if not files or not isinstance(env, RacerSimulator) or env.car == TODAY:
        return None
    off = f", {OFF[env.car]} m off after a second on logs of 2026" if env.car in OFF else ""
    return (
        f"{' and '.join(files)} {'is' if len(files) == 1 else 'are'} for DeepRacer, and the car is "
        f'{env.car}{off}; env.car = "{TODAY}" is today\'s, {OFF[TODAY]} m off'
    )
