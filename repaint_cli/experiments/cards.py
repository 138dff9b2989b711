"""The cards that an experiment trains with: preset, scale and variant as settings."""

from collections.abc import Sequence

from repaint_cli.experiments.schema import Scale
from repaint_cli.runs.start import on_this_machine
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.presets import with_preset

SHORT_EPISODE = 30
"""Steps of an episode at the scale smoke, where a simulator has such a setting."""


def card_for(
    card: TaskCard, preset: str, scale: Scale, settings: Sequence[str], iterations: int
) -> TaskCard:
    """Return a task's card as an experiment trains it; what comes later outranks what is before.

    Networks that read images compute in what is fastest here; a run keeps it.

    Raises:
        NotFound: there is no such setting.
        CardError: a value is out of range.
        UsageError: a setting is not `section.key=value`.
    """
    basis = ["net.precision=auto", f"ppo.n_iterations={iterations}", *scale.settings]
    card = with_preset(card, preset or None).with_settings([*basis, *settings])
    card = card.with_settings(smoke_settings(card)) if scale.short else card
    return on_this_machine(card)


def smoke_settings(card: TaskCard) -> list[str]:
    """Return settings under which an iteration takes a moment: short episodes, one epoch.

    Raises:
        CardError: the environment has no time limit.
    """
    settings = ["ppo.n_epochs=1", "eval.episodes=2"]
    if card.ppo.n_episodes:
        settings.append("ppo.n_episodes=2")
    elif card.ppo.n_steps:
        need = 4 * (card.env.longest_episode() + 1)
        settings += [f"ppo.n_steps={need}", "ppo.n_envs=4"] * (need < card.ppo.n_steps)
    if "max_steps" in type(card.env).model_fields:
        settings.append(f"env.max_steps={SHORT_EPISODE}")
    return settings
