"""Whose code may run: what the user began a run with here, or has read and allowed.

A run's folder may bring code along, a reward function or the name of a module to import. Of one's
own runs it runs again; a folder from elsewhere is refused until `repaint tasks trust`.
"""

import hashlib
from contextlib import suppress
from pathlib import Path

from repaint_cli.errors import CardError, StoreError
from repaint_cli.files.atomic import write_errors
from repaint_cli.files.commands import command
from repaint_cli.files.paths import user_zoo
from repaint_cli.tasks.task import Task


def allow(task: Task) -> None:
    """Let a task's code run from runs, too.

    Raises:
        StoreError: the list of what may run cannot be written.
    """
    if not task.code_at_risk() or _allowed(task):
        return
    with write_errors(_path()):
        _path().parent.mkdir(parents=True, exist_ok=True)
        with _path().open("a", encoding="utf-8") as file:  # a line in one write: others may write
            file.write(f"{_fingerprint(task)}  {task.code_at_risk()!r}\n")


def allow_if_possible(task: Task) -> None:
    """Let the code of a run that the user begins run again, where that can be noted at all."""
    with suppress(StoreError):
        allow(task)


def check(task: Task, where: Path) -> None:
    """Check that a run's code may run.

    Raises:
        CardError: the code is not on the list of what may run.
    """
    if task.code_at_risk() and not _allowed(task):
        raise CardError(
            f"{where} would run {task.code_at_risk()}, with which nothing was begun here; "
            f"read it in {where}/run.json, then: {command('repaint tasks trust {}', where)}"
        )


def _allowed(task: Task) -> bool:
    try:
        lines = _path().read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return False
    return _fingerprint(task) in {line.partition(" ")[0] for line in lines}


def _fingerprint(task: Task) -> str:
    code = task.reward_code.source if task.reward_code else f"import {task.env.model_dump()}"
    return hashlib.sha256(code.encode()).hexdigest()


def _path() -> Path:
    return user_zoo().parent / "trusted.txt"
