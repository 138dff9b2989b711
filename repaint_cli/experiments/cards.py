"""The cards that an experiment trains with: preset, scale and variant as settings."""

from collections.abc import Sequence

from repaint_cli.experiments.schema import Scale
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.presets import PRESETS

SHORT_EPISODE = 30
"""Steps of an episode at the scale smoke, where a simulator has such a setting."""


def card_for(
    card: TaskCard, preset: str, scale: Scale, settings: Sequence[str], iterations: int
) -> TaskCard:
    """Return a task's card as an experiment trains it.

    Raises:
        NotFound: there is no such setting.
        CardError: a value is out of range.
        UsageError: a setting is not `section.key=value`.
    """
    basis = [*preset_settings(preset, card), f"ppo.n_iterations={iterations}", *scale.settings]
    card = card.with_settings([*basis, *settings])
    return card.with_settings(smoke_settings(card)) if scale.short else card


def preset_settings(preset: str, card: TaskCard) -> list[str]:
    """Return the settings of a preset for a card."""
    if preset == "paper":
        return _paper_settings(card)
    return list(PRESETS[preset]) if preset else []


def _paper_settings(card: TaskCard) -> list[str]:
    """Return the paper's numbers (tables 3 and 4) where a shipped card has others."""
    settings = [
        "select.scale=none", "transfer.representation=1", "transfer.kickstart_coef=0.2",
        "transfer.teacher_min_std=0", "transfer.teacher_temperature=1", "transfer.alpha_2=1",
    ]  # fmt: skip
    racing = card.env.simulator == "racer"
    if racing:
        k = 20 if getattr(card.env, "n_bots", 0) else 4
    else:
        k = {"Reacher-v5": 15, "Ant-v5": 50}.get(getattr(card.env, "id", ""), 0)
    if k:
        settings += [f"transfer.iterations={k}", f"select.threshold={0.2 if racing else 0.8}"]
    return settings


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
