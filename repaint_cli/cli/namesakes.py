"""Notes about teachers of one name: the user's own stands before the shipped one."""

import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from repaint_cli.cli.console import plain
from repaint_cli.errors import CheckpointError, StoreError
from repaint_cli.files.commands import command
from repaint_cli.zoo import store
from repaint_cli.zoo.teacher_card import read_card
from repaint_cli.zoo.view_names import split


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
        yield f"your teacher '{name}' will stand before the shipped one, {_shipped(shipped)}"


def of_trained(path: Path) -> Iterator[str]:
    """Yield, once a teacher is in the zoo, what it stands before, and how to undo that."""
    if shipped := store.shipped_namesake(path):
        other = _shipped(shipped)
        yield f"'{path.stem}' now is your own teacher{_score(path)}; the shipped one is {other}"
        yield command("to go back to the shipped one: repaint zoo remove {}", path.stem)


def of_interrupted(name: str) -> Iterator[str]:
    """Yield, where a training ended early, that its teacher is not in the zoo."""
    yield f"no teacher is in your zoo yet: '{name}' is put there when the run is done"


def _facts(path: Path) -> str:
    """Return when a teacher was made, and its score, where its card says it."""
    with suppress(CheckpointError):
        return f" of {read_card(path).created[:10]}{_score(path)}"
    return ""


def _shipped(name: str) -> str:
    """Return a shipped teacher's name behind the user's, and its score."""
    return f"{name}{_score(store.find(name))}"


def _score(path: Path) -> str:
    """Return what a teacher earned, where its card says it."""
    with suppress(CheckpointError):
        score = read_card(path).score
        return f", score {score.mean:.4g}" if score else ""
    return ""


def print_notes(*names: str) -> None:
    """Print notes about names of teachers as they were typed, where they are in no program's way.

    Other names are passed over.
    """
    with suppress(StoreError):  # a zoo that cannot be read: who needs it says so
        known = store.teachers()
        bare = [split(name)[0] for name in names]
        for note in of_used(known[name] for name in bare if name in known):
            print(plain(f"note: {note}"), file=sys.stderr)
