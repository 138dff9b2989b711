"""What a shell completes: names of tasks, teachers, methods, experiments, and runs' folders.

It is asked at every press of a key, so that nothing slow is imported here.
"""

from collections.abc import Iterable
from pathlib import Path

from repaint_cli.errors import RepaintError
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.methods import ALGORITHMS, METHODS


def tasks(incomplete: str) -> list[str]:
    """Return the shipped tasks, and cards in the present folder."""
    own = map(str, sorted(Path().glob("*.toml")))
    return _beginning(incomplete, [*sorted(shipped_tasks()), *own])


def teachers(incomplete: str) -> list[str]:
    """Return the teachers in the zoo."""
    from repaint_cli.zoo.store import teachers

    try:
        return _beginning(incomplete, teachers())
    except RepaintError:  # a zoo that cannot be read, which the command will say
        return []


def runs(incomplete: str) -> list[str]:
    """Return the folders of runs that were begun from here."""
    from repaint_cli.runs.elsewhere import runs_from_here
    from repaint_cli.runs.folder import RUNS, runs_in

    known = [*runs_in(RUNS, deep=True), *runs_from_here()]
    return _beginning(incomplete, sorted(str(run.path) for run in known if run.is_run()))


def tasks_and_teachers(incomplete: str) -> list[str]:
    """Return tasks and teachers, which `similarity` compares alike."""
    return list(dict.fromkeys([*tasks(incomplete), *teachers(incomplete)]))


def policies(incomplete: str) -> list[str]:
    """Return teachers and runs, which `eval` plays alike."""
    return [*teachers(incomplete), *runs(incomplete)]


def methods(incomplete: str) -> list[tuple[str, str]]:
    """Return the methods, with what each is."""
    return [(name, METHODS[name].summary) for name in _beginning(incomplete, METHODS)]


def experiments(incomplete: str) -> list[str]:
    """Return the experiments to reproduce, and files in the present folder."""
    from repaint_cli.experiments.files import ALL, shipped_experiments

    own = map(str, sorted(Path().glob("*.toml")))
    return _beginning(incomplete, [*shipped_experiments(), ALL, *own])


def algorithms(incomplete: str) -> list[str]:
    """Return the algorithms."""
    return _beginning(incomplete, ALGORITHMS)


def _beginning(incomplete: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
