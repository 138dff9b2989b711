"""A teacher's card in ten lines, for people."""

from pathlib import Path

from repaint_cli.cli.console import plain
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.task import FUNCTION
from repaint_cli.zoo.store import name_of, whose
from repaint_cli.zoo.teacher_card import Score, TeacherCard

WIDTH = 80
"""Of the lines, in characters."""


def lines(card: TeacherCard, path: Path) -> list[str]:
    """Return a teacher's facts, each in a line that is cut off where it is too long."""
    parents = ", ".join(f"{parent[:12]}…" for parent in card.parents)
    trained = [
        f"{card.algorithm} {card.method}", f"seed {card.seed}", f"iteration {card.iteration}",
        f"{card.env_steps:,} steps", card.created[:10],
    ]  # fmt: skip
    facts = {
        "teacher": f"{name_of(path, card)}, {whose(path) or 'a file outside the zoo'}",
        "task": f"{card.task.name}: {card.task.summary}",
        "score": _score(card.score),
        "reward": _reward(card.task),
        "policy": f"{_net(card.task)}; {card.spaces}",
        "trained": ", ".join(trained),
        "taught by": f"{parents} (sha256)" if parents else "nobody",
        "with": ", ".join(f"{name} {version}" for name, version in card.versions.items()),
        "file": str(path),
    }
    return [_line(name, text) for name, text in facts.items()]


def _line(name: str, text: str) -> str:
    """Lay out a fact; its end is left out where it is too long for a line."""
    shown = plain(" ".join(text.split()))
    room = WIDTH - 11
    return f"{name:<11}" + (shown if len(shown) <= room else f"{shown[: room - 1]}…")


def _score(score: Score | None) -> str:
    if score is None:
        return "not measured"
    text = str(score)
    if score.laps is not None and score.progress is not None:
        text += f", {score.laps} laps, progress {score.progress:.0f} %"
    return text


def _reward(task: TaskCard) -> str:
    if task.reward_code:
        scale = task.reward[FUNCTION]
        return f"{f'{scale:g} × ' * (scale != 1)}the function in {task.reward_code.name}"
    text = " + ".join(f"{weight:g} {term}" for term, weight in task.reward.items() if weight)
    return text.replace("+ -", "- ")


def _net(task: TaskCard) -> str:
    if task.net.kind == "mlp":
        return f"mlp {' × '.join(map(str, task.net.hidden))}"
    conv = task.net.conv if isinstance(task.net.conv, str) else "with convolutions of its own"
    return f"cnn {conv}" + (f" in {task.net.precision}" if task.net.precision != "float32" else "")
