"""Whose code may run: what the user began a run with here, or has read and allowed.

A run's folder may bring code along, a reward function or the name of a module to import. Of one's
own runs it runs again; a folder from elsewhere is refused until `repaint tasks trust`.
"""

import hashlib
from contextlib import suppress
from pathlib import Path

from repaint_cli.envs.simulator import GymEnv
from repaint_cli.errors import CardError, StoreError
from repaint_cli.files.atomic import write_errors
from repaint_cli.paths import user_zoo
from repaint_cli.tasks.task import TaskCard


def code_of(task: TaskCard) -> str | None:
    """Return what of a task is somebody's own code or file, for people; None where nothing is."""
    if task.reward_code:
        return f"the reward function {task.reward_code.name}"
    if isinstance(task.env, GymEnv) and ":" in task.env.id:
        return f"the module of {task.env.id}"
    if isinstance(task.env, GymEnv):
        for name, value in task.env.kwargs.items():
            if isinstance(value, str) and ("/" in value or "\\" in value or "." in value):
                return f"the file {value} ({name})"
    return None


def allow(task: TaskCard) -> None:
    """Let a task's code run from runs, too.

    Raises:
        StoreError: the list of what may cannot be written.
    """
    if not code_of(task) or _allowed(task):
        return
    with write_errors(_path()):
        _path().parent.mkdir(parents=True, exist_ok=True)
        with _path().open("a", encoding="utf-8") as file:  # a line at a stroke: others may write
            file.write(f"{_fingerprint(task)}  {code_of(task)!r}\n")


def remember(task: TaskCard) -> None:
    """Let the code of a run that the user begins run again, where that can be noted at all."""
    with suppress(StoreError):
        allow(task)


def check(task: TaskCard, where: Path) -> None:
    """Check that a run's code may run.

    Raises:
        CardError: nobody has allowed it.
    """
    if code_of(task) and not _allowed(task):
        raise CardError(
            f"{where} would run {code_of(task)}, with which nothing was begun here; read it in "
            f"{where}/run.json, then: repaint tasks trust {where}"
        )


def _allowed(task: TaskCard) -> bool:
    try:
        lines = _path().read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return False
    return _fingerprint(task) in {line.partition(" ")[0] for line in lines}


def _fingerprint(task: TaskCard) -> str:
    code = task.reward_code.source if task.reward_code else f"import {task.env.model_dump()}"
    return hashlib.sha256(code.encode()).hexdigest()


def _path() -> Path:
    return user_zoo().parent / "trusted.txt"
