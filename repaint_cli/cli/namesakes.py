"""Notes about teachers of one name: the user's own stands before the shipped one."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from repaint_cli.cli.console import plain
from repaint_cli.errors import CheckpointError
from repaint_cli.paths import user_zoo
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card


def note_used(files: Iterable[Path]) -> None:
    """Say which of the teachers that are used are the user's own, and what the shipped ones are."""
    for path in files:
        if shipped := store.shipped_namesake(path):
            _note(f"teacher '{path.stem}' is your own; the shipped one is {shipped}")


def note_named(*names: str) -> None:
    """Do the same for names of teachers, or of other things, as they were typed."""
    known = store.teachers()
    note_used(known[name] for name in names if name in known)


def note_planned(name: str) -> None:
    """Say, before a teacher is trained, what it will stand before or replace."""
    path = user_zoo() / f"{name}{store.SUFFIX}"
    if path.is_file():
        _note(f"this will replace your teacher '{name}'{_facts(path)}; --name keeps both")
    if shipped := store.shipped_namesake(path):
        _note(f"your teacher '{name}' will stand before the shipped one, which is {shipped}")


def note_trained(path: Path) -> None:
    """Say, once a teacher is in the zoo, what it stands before."""
    if shipped := store.shipped_namesake(path):
        _note(f"'{path.stem}' now is your own teacher; the shipped one is {shipped}")


def _facts(path: Path) -> str:
    """Return when a teacher was made, and its score, where its card says it."""
    with suppress(CheckpointError):
        card = read_card(path)
        score = f", score {card.score.mean:.4g}" if card.score else ""
        return f" of {card.created[:10]}{score}"
    return ""


def _note(text: str) -> None:
    """Print a note where it is in no program's way."""
    print(plain(f"note: {text}"), file=sys.stderr)
