"""`--dry-run`: what would run, with which settings, and how long; nothing is written for it.

All that is printed is a card in TOML; what is no setting stands in comments.
"""

import os
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from repaint_cli.runs.plan import Plan
    from repaint_cli.tasks.card import TaskCard


def dry_run(card: "TaskCard", plan: "Callable[[], Sequence[Plan]]", jobs: int = 1) -> None:
    """Print what plans of a task would do.

    Args:
        card: the task's, before any option.
        plan: checks what is asked for, and returns a plan for each run.
        jobs: how many would run at a time.

    Raises:
        RepaintError: as the run itself would.
    """
    with _no_traces():
        plans = plan()
        lines = ["what follows would be trained; nothing is trained or written now"]
        for one in plans:
            lines += ["", *_about(one, card)]
        _print(lines)
        from repaint_cli.tasks.card_text import to_toml

        print(f"\n{to_toml(plans[0].target if len(plans) == 1 else plans[0].task)}", flush=True)
        _print_estimate(plans, jobs)


def _print(lines: Sequence[str]) -> None:
    from repaint_cli.cli.console import plain

    for line in lines:
        print(f"# {plain(line)}".rstrip(), flush=True)


def _about(plan: "Plan", card: "TaskCard") -> Iterator[str]:
    """Yield what is to be known of a plan but for its settings."""
    yield f"task: {plan.task.name}"
    algorithm = "" if plan.algorithm == "ppo" else f" of {plan.algorithm}"
    yield f"method: {plan.method}{algorithm}"
    yield f"seeds: {', '.join(map(str, plan.seeds))}"
    for file in plan.teachers:
        acts = plan.acting is None or file in plan.acting
        yield f"teacher: {file.name}, {file.path}{'' if acts else ', without its samples'}"
    yield f"folder: {plan.folder}{' (with the time at which it begins)' * plan.numbered}"
    if plan.teacher_name:
        from repaint_cli.zoo.store import own_file

        yield f"teacher that it makes: {own_file(plan.teacher_name)}"
    changes = list(_changes(card, plan.task))
    if plan.teachers:
        changes += [f"{change}, by the method" for change in _changes(plan.task, plan.target)]
    yield f"settings that differ from the card: {'' if changes else 'none'}".rstrip()
    yield from (f"  {change}" for change in changes)


def _changes(before: "TaskCard", after: "TaskCard") -> Iterator[str]:
    """Yield the settings that are others than in a card before, with both values."""
    from repaint_cli.tasks.card_settings import differing, setting_text, settings_of

    card, own = settings_of(before), settings_of(after)
    for name in differing(card, own):
        yield f"{name} = {setting_text(own, name)} (card: {setting_text(card, name)})"


def _print_estimate(plans: "Sequence[Plan]", jobs: int) -> None:
    """Print how long the plans would take, by their first iterations."""
    from rich.console import Console

    from repaint_cli.activity import doing
    from repaint_cli.cli.live import live
    from repaint_cli.runs.comparison_words import duration
    from repaint_cli.runs.estimate import estimate

    sys.stderr.write("training first iterations in a temporary folder, to tell how long it takes\n")
    total = 0.0
    for plan in plans:
        with live(Console(stderr=True)), doing(f"measuring {plan.method}"):
            measured = estimate(plan)
        total += measured.seconds
        firsts = ", ".join(f"{seconds:.2g}" for seconds in measured.measured)
        _print([
            f"{plan.method}: about {duration(measured.seconds)} for "
            f"{measured.n_iterations:,} iterations with their evaluations; the first took "
            f"{firsts} s"
        ])  # fmt: skip
    if len(plans) > 1:
        side = f"; with --jobs {jobs} less, at best 1/{jobs} of it" if jobs > 1 else ""
        _print([f"all, one after the other: about {duration(total)}{side}"])


@contextmanager
def _no_traces() -> Iterator[None]:
    """Keep compiled code in a temporary folder meanwhile, beginning with what the user's has."""
    before = os.environ.get("XDG_CACHE_HOME")
    cache = Path(before or os.path.expanduser("~/.cache")) / "repaint" / "numba"
    with TemporaryDirectory(prefix="repaint-") as folder:
        own = Path(folder) / "repaint"
        own.mkdir(mode=0o700)  # whatever the umask: others may not write what is run
        if cache.is_dir():
            shutil.copytree(cache, own / "numba")
        os.environ["XDG_CACHE_HOME"] = folder
        try:
            yield
        finally:
            del os.environ["XDG_CACHE_HOME"]
            if before is not None:
                os.environ["XDG_CACHE_HOME"] = before
