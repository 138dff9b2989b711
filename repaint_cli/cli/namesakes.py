"""Notes about teachers of one name: the user's own stands before the shipped one."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from repaint_cli.cli.console import plain
from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card


def of_used(files: Iterable[Path]) -> Iterator[str]:
    """Yield which of some teachers are the user's own, and what the shipped ones are called."""
    for path in files:
        if shipped := store.shipped_namesake(path):
            yield f"teacher '{path.stem}' is your own; the shipped one is {shipped}"


def of_planned(name: str) -> Iterator[str]:
    """Yield, before a teacher is trained, what it will replace or stand before."""
    path = store.own_file(name)
    if path.is_file():
        yield f"this will replace your teacher '{name}'{_facts(path)}; --name keeps both"
    if shipped := store.shipped_namesake(path):
        yield f"your teacher '{name}' will stand before the shipped one, which is {shipped}"


def of_trained(path: Path) -> Iterator[str]:
    """Yield, once a teacher is in the zoo, what it stands before."""
    if shipped := store.shipped_namesake(path):
        yield f"'{path.stem}' now is your own teacher; the shipped one is {shipped}"


def _facts(path: Path) -> str:
    """Return when a teacher was made, and its score, where its card says it."""
    with suppress(CheckpointError):
        card = read_card(path)
        score = f", score {card.score.mean:.4g}" if card.score else ""
        return f" of {card.created[:10]}{score}"
    return ""


def print_notes(*names: str) -> None:
    """Print notes about names of teachers as they were typed, where they are in no program's way.

    Other names are passed over.
    """
    with suppress(StoreError):  # a zoo that cannot be read: who needs it says so
        known = store.teachers()
        for note in of_used(known[name] for name in names if name in known):
            print(plain(f"note: {note}"), file=sys.stderr)
