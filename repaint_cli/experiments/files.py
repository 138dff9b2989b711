"""Experiments on disk: TOML that people write; the shipped ones lie in `experiments/`."""

import os
from pathlib import Path

from pydantic import ValidationError

from repaint_cli.errors import CardError, NotFound, StoreError, reported_as
from repaint_cli.experiments.schema import Experiment
from repaint_cli.files.atomic import write_text
from repaint_cli.files.commands import command
from repaint_cli.files.limits import read_text, read_toml
from repaint_cli.files.paths import shipped
from repaint_cli.settings import first_problem

ALL = "all"
"""The name that stands for all shipped experiments."""


def shipped_experiments() -> dict[str, Path]:
    """Return the files of the shipped experiments by name."""
    return {path.stem: path for path in sorted(shipped("experiments").glob("*.toml"))}


def list_experiments() -> list[Experiment]:
    """Return the shipped experiments, in the order of the paper."""
    experiments = [_read(path) for path in shipped_experiments().values()]
    return sorted(experiments, key=lambda one: (one.order, one.name))


def read_experiment(name: str) -> Experiment:
    """Read a shipped experiment by name, or one of one's own by its path (`my.toml`).

    Raises:
        NotFound: there is no such experiment.
        CardError: the file has a value that is not allowed.
    """
    return _read(_find(name))


def copy_experiment(name: str, file: Path) -> None:
    """Copy an experiment's file, comments and all, to a new one.

    Raises:
        NotFound: there is no such experiment.
        StoreError: the new file is there already, does not end in .toml, or cannot be written.
    """
    path = _find(name)
    if file.suffix != ".toml":
        raise StoreError(f"expected a file that ends in .toml, found '{file}'")
    if os.path.lexists(file):
        raise StoreError(f"{file} exists already; give another name")
    with reported_as(CardError):
        text = read_text(path)
    write_text(file, text, new=True)


def _find(name: str) -> Path:
    path = Path(name)
    if path.suffix == ".toml":
        if not os.path.exists(path):
            start = command("repaint reproduce copy reacher {}", name)
            raise NotFound(f"there is no experiment at '{name}'; start one: {start}")
        return path
    known = shipped_experiments()
    if name not in known:
        raise NotFound.named("experiment", name, [*known, ALL], "repaint reproduce list")
    return known[name]


def _typed(path: Path) -> str:
    """Return how an experiment is named on a command line."""
    return path.stem if path.parent == shipped("experiments") else str(path)


def _read(path: Path) -> Experiment:
    with reported_as(CardError):
        data = read_toml(path)
    try:
        return Experiment.model_validate({"name": path.stem} | data | {"file": _typed(path)})
    except ValidationError as error:
        raise CardError(f"{path}: {first_problem(error)}") from error
