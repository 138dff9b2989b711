"""How long the runs of an experiment that are not trained yet would take on two cores."""

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from repaint_cli.activity import doing
from repaint_cli.experiments.planned import PlannedRun
from repaint_cli.experiments.planning import plan_experiment
from repaint_cli.experiments.schema import Experiment
from repaint_cli.runs.estimate import estimate

RUN_SECONDS = 5.0
"""What a run takes besides its iterations: to begin, and to draw and write what came of it."""


def seconds_left(runs: Iterable[PlannedRun]) -> float:
    """Return how long runs would take one after the other.

    The time of an iteration is what a run's own last one took, for a run that was begun; else what
    the experiment says, or what the first iterations of a seed take.

    Raises:
        RepaintError: a run to be measured could not begin.
    """
    measured: dict[str, float] = {}
    total = 0.0
    for run in runs:
        left = run.left()
        if left is None:
            continue
        pace = run.pace()
        if pace is None:
            one = run.seconds if run.seconds is not None else _measured(run, measured)
            pace = one * len(run.seeds)
        total += RUN_SECONDS + left * pace
    return total


def _measured(run: PlannedRun, known: dict[str, float]) -> float:
    """Return how long an iteration of a seed takes; runs of one task are alike."""
    task = run.card.name
    if task not in known:
        plan = run.plan
        short = replace(plan, seeds=plan.seeds[:1], method="scratch", teachers=())
        with doing(f"measuring {task}"):
            known[task] = estimate(short).seconds / plan.task.ppo.n_iterations
    return known[task]


def hours_of(experiment: Experiment, scale: str) -> float:
    """Return about how many hours a scale of an experiment takes where nothing is trained yet.

    Raises:
        RepaintError: see `plan_experiment` and `seconds_left`.
    """
    nowhere = Path(os.devnull) / "nothing"
    return seconds_left(plan_experiment(experiment, scale, nowhere).all_runs()) / 3600
