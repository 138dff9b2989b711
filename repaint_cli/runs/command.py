"""The commands that make a run or a comparison again."""

import json
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from repaint_cli.errors import RepaintError
from repaint_cli.files.atomic import sha256
from repaint_cli.files.commands import quoted
from repaint_cli.runs.record import RunRecord, TeacherRecord
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task, shipped_tasks
from repaint_cli.zoo import store

LINE = 78
"""Letters of a line."""


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
    settings = None if card is None else _settings(card.model_dump(), task.model_dump())
    words = ["repaint", "transfer" if record.teacher_name is None else "train-teacher"]
    words += ["--task", task.name if settings is not None else f"{task.name}.toml"]
    if record.teacher_name is None:
        words += ["--algorithm", record.algorithm] if record.algorithm != "ppo" else []
        words += ["--method", record.method, *_teachers(record.teachers)]
    elif record.teacher_name != task.name:
        words += ["--name", record.teacher_name]
    first, n = record.seeds[0], len(record.seeds)
    words += [*_unless(n, 1, "--seeds"), *_unless(first, 0, "--seed")]
    for setting in settings or ():
        words += ["--set", setting]
    return _typed(words)


def compare_command(
    folders: Iterable[Path], reference: Path | None, target: float | None, report: Path
) -> str:
    """Return the command that compares runs' folders and writes a report."""
    words = ["repaint", "compare", *map(as_argument, folders)]
    words += [] if reference is None else ["--reference", as_argument(reference)]
    words += [] if target is None else [f"--target={float(target)!r}"]
    return _typed([*words, "--report", as_argument(report)])


def as_argument(path: Path) -> str:
    """Return a path that no command takes for an option."""
    return f"./{path}" if str(path).startswith("-") else str(path)


def toml_value(value: Any) -> str:
    """Write a value as TOML on one line; None, which TOML lacks, as the word."""
    if isinstance(value, Mapping):
        pairs = (f"{json.dumps(k, ensure_ascii=False)} = {toml_value(v)}" for k, v in value.items())
        return f"{{{', '.join(pairs)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    return "none" if value is None else json.dumps(value, ensure_ascii=False)


def _settings(card: Mapping[str, Any], task: Mapping[str, Any]) -> list[str] | None:
    """Return what `--set` must change on a card, or None where it cannot say it."""
    changed = list[str]()
    for section, values in task.items():
        basis = card[section]
        if values == basis or section in ("name", "summary"):
            continue
        if not isinstance(values, Mapping) or not isinstance(basis, Mapping):
            return None
        for key in basis.keys() | values.keys():
            if values.get(key) != basis.get(key):
                if values.get(key) is None:
                    return None
                changed.append(f"{section}.{key}={toml_value(values[key])}")
    return sorted(changed)


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
        name = next(same, teacher.file or teacher.name)
        yield from ("--teacher", name)
        if teacher.instances and not all_act:
            yield from ("--instances-from", name)


def _typed(words: Sequence[str]) -> str:
    """Return a command as it is typed into a shell, on lines that end before an option."""
    lines = [""]
    parts = [f" {shlex.quote(word) if word.isprintable() else quoted(word)}" for word in words]
    for i, part in enumerate(parts):
        whole = part + parts[i + 1] if words[i].startswith("--") and i + 1 < len(parts) else part
        if len(lines[-1] + whole) > LINE and words[i].startswith("--"):
            lines.append("   ")
        lines[-1] += part
    return " \\\n".join(lines).strip()


def _unless(value: object, default: object, option: str) -> list[str]:
    return [] if value == default else [option, str(value)]
