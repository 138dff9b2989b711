"""A task by name, be it a shipped task, a card of one's own, or the task of a teacher."""

from collections.abc import Sequence
from pathlib import Path

from repaint_cli.errors import CardError, NotFound
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import check_no_environment, read_task
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card


def read_task_or_teacher(name: str) -> TaskCard:
    """Read a task's card, or the card inside a teacher.

    Raises:
        NotFound: there is no such task or teacher.
        CardError: the card has a value that is not allowed, or a teacher's card has a reward
            function, which is never run from a teacher's file.
        CheckpointError: the teacher's file is damaged.
    """
    if name.endswith(".toml") or name in shipped_tasks():
        return read_task(name)
    teachers = store.teachers()
    if name in teachers or name.endswith((store.SUFFIX, store.SHIPPED)):
        card = read_card(store.find(name)).task
        if card.reward_code:
            raise CardError(
                f"'{name}' was trained with the reward function {card.reward_code.name}, which is "
                "never run from a teacher's file; name its card: my-task.toml"
            )
        return card
    check_no_environment(name)
    known = [*shipped_tasks(), *teachers]
    raise NotFound.named("task or teacher", name, known, "repaint tasks list, repaint zoo list")


def tasks_to_compare(names: Sequence[str | Path | TaskCard]) -> list[TaskCard]:
    """Return cards, read where they are named: one with all shipped tasks, or else all of those.

    Raises:
        As `read_task_or_teacher`.
    """
    named = names or list(shipped_tasks())
    cards = [n if isinstance(n, TaskCard) else read_task_or_teacher(str(n)) for n in named]
    if len(cards) == 1:
        cards += [read_task_or_teacher(n) for n in shipped_tasks() if n != cards[0].name]
    return cards
