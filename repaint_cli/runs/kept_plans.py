"""compare.json: what a comparison trains, so that another command can go on with it."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from repaint_cli.errors import CardError, StoreError
from repaint_cli.files.atomic import as_json, write_text
from repaint_cli.files.commands import command
from repaint_cli.runs.folder import PLANS
from repaint_cli.runs.kept_records import kept_records
from repaint_cli.runs.plan import Plan, difference, plan_of
from repaint_cli.tasks import trust
from repaint_cli.tasks.card import TaskCard

OPEN = ("versions", "reward_file", "ranked")
"""What may be another when the same command is typed again."""


def keep_plans(plans: Sequence[Plan], root: Path) -> None:
    """Write plans, whose folders all lie in one, into that.

    Raises:
        StoreError: the file cannot be written.
    """
    for plan in plans:
        trust.allow_if_possible(plan.target)
    write_text(root / PLANS, as_json({"schema_version": 1, "runs": _records(plans)}))


def check_same(plans: Sequence[Plan], root: Path) -> None:
    """Check that plans are those that were kept in a folder.

    Raises:
        CheckpointError: the file is damaged.
        StoreError: others were kept there.
    """
    kept = {name: record.model_dump(mode="json") for name, record in kept_records(root).items()}
    now = _records(plans)
    if kept.keys() == now.keys():
        text = difference(_defining(kept), _defining(now))
    else:
        text = f"{', '.join(kept)} against {', '.join(now)}"
    if text:
        raise StoreError(
            f"{root} holds another comparison: {text}; name another folder with --into, or go on "
            f"with that one: {command('repaint compare --resume {}', root)}"
        )


def _records(plans: Sequence[Plan]) -> dict[str, dict[str, Any]]:
    """Return the records of runs at their beginning, by the names of their folders."""
    return {
        plan.folder.name: plan.new_record(plan.check()[1]).model_dump(mode="json") for plan in plans
    }


def _defining(runs: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return what defines runs; teachers count by what they hold."""
    return {
        name: {key: value for key, value in run.items() if key not in OPEN}
        | {"teachers": [{**one, "file": ""} for one in run["teachers"]]}
        for name, run in runs.items()
    }


def kept_plans(root: Path) -> list[Plan]:
    """Return the plans that were kept in a folder.

    Raises:
        NotFound: none were, or a teacher's file is gone.
        CheckpointError: the file is damaged.
        TeacherMismatch: a teacher's file has other contents now.
        CardError: a task would run code with which nothing was begun here.
    """
    plans = []
    for name, record in kept_records(root).items():
        task = TaskCard.parse(record.task, str(root / PLANS))
        plan = plan_of(record, task, root / name)
        try:
            trust.check(plan.target, plan.folder)
        except CardError as error:
            raise CardError(
                f"{root / PLANS} would run {task.code_at_risk()}, with which nothing was begun "
                "here; train its methods with --task instead"
            ) from error
        plans.append(plan.as_new())
    return plans
