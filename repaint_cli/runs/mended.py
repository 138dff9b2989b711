"""A reward function that failed in mid-run and was mended: the run goes on with its new text."""

from pathlib import Path

from repaint_cli.errors import CardError, RepaintError, reported_as
from repaint_cli.files.commands import command
from repaint_cli.files.limits import read_text
from repaint_cli.runs.reader import RecordedRun
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard


def mended_task(run: RecordedRun) -> TaskCard:
    """Return a run's task with the text that its reward function has now, if it failed before.

    It is the run's own task where its function did not fail, or its file is gone or as it was.
    """
    text = _text_now(run)
    code = run.task.reward_code
    if code is None or text is None or text == code.source or not run.record.failure:
        return run.task
    new = code.model_copy(update={"source": text})
    return run.task.model_copy(update={"reward_code": new})


def check_mended(run: RecordedRun, task: TaskCard) -> None:
    """Check that a reward function's new text may run.

    Raises:
        CardError: nothing was begun with it here, and nobody has allowed it.
    """
    if task.reward_code == run.task.reward_code:
        return
    try:
        trust.check(task, run.folder)
    except CardError as error:
        raise CardError(
            f"{run.record.reward_file} has changed since it failed ({run.record.failure}); let the "
            f"run go on with its new text: {command('repaint tasks trust {}', run.folder)}"
        ) from error


def notices_of_text(run: RecordedRun, task: TaskCard) -> list[str]:
    """Return a sentence about the text that a run goes on with, where that is in doubt."""
    text, code, done = _text_now(run), run.task.reward_code, run.returns.shape[1]
    if code is None:
        return []
    if task.reward_code != code:
        before = f"iteration{'s 1 to' * (done > 1)} {done} had another" if done else "none had"
        return [f"the run goes on with the new text of {code.name}; {before}"]
    if run.record.failure and text == code.source:
        return [f"{code.name} is as it was when it failed: {run.record.failure}"]
    if text is not None and text != code.source:
        return [f"{code.name} has changed; the run goes on with the text that it began with"]
    return []


def _text_now(run: RecordedRun) -> str | None:
    """Return the text in the file of a run's reward function, or None where there is none."""
    if not run.record.reward_file:
        return None
    try:
        with reported_as(CardError):
            return read_text(Path(run.record.reward_file))
    except RepaintError:
        return None
