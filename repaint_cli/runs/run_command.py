"""The commands that make a run or a comparison again."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from repaint_cli.errors import RepaintError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.commands import quoted
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.files.toml import toml_value
from repaint_cli.runs.record import RunRecord
from repaint_cli.runs.record_parts import TeacherRecord
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_settings import differing, settings_of
from repaint_cli.zoo import store
from repaint_cli.zoo.view_names import with_view

LINE = 78
"""Letters of a line."""

IN_CARDS_ONLY = ("reward_code.", "symmetry.")
"""Settings that `--set` cannot add to a card that has none of their section."""


def shipped_card(task: TaskCard) -> TaskCard | None:
    """Return the shipped card that a run's task was begun from, by its name."""
    try:
        return read_task(task.name) if task.name in shipped_tasks() else None
    except RepaintError:
        return None


def command_of(record: RunRecord, task: TaskCard) -> str:
    """Return the command that begins a run like this one.

    A card of one's own is named as a file, NAME.toml: run.json holds what is in it.
    """
    card = shipped_card(task)
    settings = None if card is None else _settings(card, task)
    words = ["repaint", "transfer" if record.teacher_name is None else "train-teacher"]
    words += ["--task", quoted(task.name if settings is not None else f"{task.name}.toml")]
    if record.teacher_name is None:
        words += ["--algorithm", record.algorithm] if record.algorithm != "ppo" else []
        words += ["--method", record.method, *_teachers(record.teachers)]
    elif record.teacher_name != task.name:
        words += ["--name", quoted(record.teacher_name)]
    first, n = record.seeds[0], len(record.seeds)
    words += [*_unless(n, 1, "--seeds"), *_unless(first, 0, "--seed")]
    for setting in settings or ():
        words += ["--set", quoted(setting)]
    return _typed(words)


def scratch_command(record: RunRecord, task: TaskCard) -> str | None:
    """Return the command that trains the same from scratch, or None where that was the run."""
    if record.method == "scratch":
        return None
    alone: dict[str, object] = {"method": "scratch", "teachers": [], "teacher_name": None}
    return command_of(record.model_copy(update=alone), task)


def compare_command(
    folders: Iterable[Path], reference: Path | None, targets: Sequence[float], report: Path
) -> str:
    """Return the command that compares runs' folders and writes a report."""
    words = ["repaint", "compare", *(quoted(str(folder)) for folder in folders)]
    words += [] if reference is None else ["--reference", quoted(str(reference))]
    words += [f"--target={','.join(repr(float(target)) for target in targets)}"] * bool(targets)
    return _typed([*words, "--report", quoted(str(report))])


def _settings(card: TaskCard, task: TaskCard) -> list[str] | None:
    """Return what `--set` must change on a card, or None where it cannot say it."""
    basis, own = settings_of(card), settings_of(task)
    changed = sorted(differing(basis, own))
    if any(name.startswith(IN_CARDS_ONLY) or own.get(name) is None for name in changed):
        return None
    return [f"{name}={toml_value(own[name])}" for name in changed]


def _teachers(teachers: Iterable[TeacherRecord]) -> Iterator[str]:
    """Yield the options that name teachers: by a name only where its file is the same."""
    known, all_act = store.teachers(), all(teacher.instances for teacher in teachers)
    for teacher in teachers:
        name = teacher.name.removesuffix(store.SHIPPED)
        same = (
            other
            for other in (name, name + store.SHIPPED)
            if other in known and sha256(known[other]) == teacher.sha256
        )
        name = quoted(with_view(next(same, teacher.file or teacher.name), teacher.view))
        yield from ("--teacher", name)
        if teacher.instances and not all_act:
            yield from ("--instances-from", name)


def _typed(words: Sequence[str]) -> str:
    """Return a command of words that are quoted, on lines that end before an option."""
    lines = [""]
    parts = [f" {word}" for word in words]
    for i, part in enumerate(parts):
        whole = part + parts[i + 1] if words[i].startswith("--") and i + 1 < len(parts) else part
        if len(lines[-1] + whole) > LINE and words[i].startswith("--"):
            lines.append("   ")
        lines[-1] += part
    return " \\\n".join(lines).strip()


def _unless(value: object, default: object, option: str) -> list[str]:
    return [] if value == default else [option, str(value)]
