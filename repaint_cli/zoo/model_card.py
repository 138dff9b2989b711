"""A teacher's card as a page in Markdown."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from repaint_cli.files.atomic import sha256
from repaint_cli.files.foreign import PAGE_MARK
from repaint_cli.tasks.card import TaskCard
from repaint_cli.zoo.teacher_card import Score, TeacherCard


def markdown(card: TeacherCard, path: Path) -> str:
    """Return the page of a teacher.

    Args:
        card: in its file.
        path: of the file.
    """
    sections = [
        f"# {card.name}",
        f"A policy for the task `{card.task.name}`: {card.task.summary}",
        f"**Score**: {_score(card.score)}",
        "## Task",
        _task(card.task),
        "## Policy",
        f"It reads and writes {card.spaces}. Observations go in as the environment gives them: the "
        "normaliser is part of the policy, and so is the scaling of images.",
        _table(card.task.net.model_dump(mode="json")),
        "## Training",
        _training(card),
        _table(card.task.ppo.model_dump(mode="json")),
        "## File",
        f"`{path.name}` is safetensors: weights by name, and this card as JSON in its header under "
        f"`repaint`. Its SHA-256 is `{sha256(path)}`.",
        _table(card.versions),
        "## Use",
        f"```sh\nrepaint zoo add {card.name} {path.name}\nrepaint eval {card.name} "
        f"--render-offscreen\nrepaint transfer --teacher {card.name} --task MY-TASK\n```",
        PAGE_MARK,
    ]
    return "\n\n".join(sections) + "\n"


def _score(score: Score | None) -> str:
    if score is None:
        return "not measured."
    text = (
        f"mean return {score.mean:.4g}, 95 % interval [{score.low:.4g}, {score.high:.4g}], over "
        f"{score.episodes} episodes with its most likely actions, on seeds that training never saw"
    )
    if score.progress is not None:
        text += f"; {score.laps} whole laps, mean progress {score.progress:.0f} %"
    return text + "."


def _task(task: TaskCard) -> str:
    env = {name: value for name, value in task.env.model_dump(mode="json").items() if value}
    reward = "The reward is the sum of named terms, each with its weight:"
    if task.reward_code:
        name = task.reward_code.name
        reward = f"The reward is what the function in {name} pays, times its weight:"
    return "\n\n".join([_table(env), reward, _table(task.reward)])


def _training(card: TeacherCard) -> str:
    parents = ", ".join(f"`{parent[:12]}…`" for parent in card.parents)
    taught = f" Its own teachers' files (SHA-256): {parents}." if parents else ""
    return (
        f"Algorithm {card.algorithm}, method {card.method}, seed {card.seed}, kept after iteration "
        f"{card.iteration} and {card.env_steps:,} environment steps, {card.created} UTC.{taught}"
    )


def _table(values: Mapping[str, Any]) -> str:
    rows: Iterable[str] = (f"| {name} | {_cell(value)} |" for name, value in values.items())
    return "\n".join(["| | value |", "|---|---|", *rows])


def _cell(value: Any) -> str:
    """Return a value in a cell of a table, where a bar or a new line would end it."""
    return str(value).replace("|", "\\|").replace("\n", " ")
