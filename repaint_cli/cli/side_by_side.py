"""The table of `repaint compare`."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from repaint_cli.cli.examine import policies
from repaint_cli.cli.played import racing_summary, table
from repaint_cli.cli.screen import out
from repaint_cli.cli.session import say_written
from repaint_cli.errors import CardError
from repaint_cli.evaluate import evaluate, has_paths
from repaint_cli.history import Run, read_run
from repaint_cli.learn.seeding import Purpose
from repaint_cli.report.pictures import draw_trajectories
from repaint_cli.report.statistics import area_under_curve, iterations_to
from repaint_cli.simulators import RacerEnv

EPISODES = 20
"""Episodes that the paper draws of each policy."""

MARKS = (1, 5, 10, 20)
"""Iterations whose returns are shown."""


def read_runs(folders: Sequence[Path]) -> dict[str, Run]:
    """Read runs of one task by labels that tell them apart.

    Other folders, and runs without a finished iteration, are passed over.

    Raises:
        NotFound: there is no such folder.
        CardError: they are of several tasks, or there is none.
    """
    read = _finished(folders)
    tasks = sorted({run.task.name for run in read})
    if len(tasks) != 1:
        raise CardError(f"expected runs of one task, found {', '.join(tasks) or 'no run'}")
    for run in read:
        for part in ("env", "reward"):
            if getattr(run.task, part) != getattr(read[0].task, part):
                raise CardError(
                    f"expected runs of one task, found other [{part}] settings in {run.folder} "
                    f"than in {read[0].folder}"
                )
    labels = [run.label for run in read]
    return {run.label if labels.count(run.label) == 1 else str(run.folder): run for run in read}


def _finished(folders: Sequence[Path]) -> list[Run]:
    """Read those folders that are runs with a finished iteration."""
    read = [read_run(f) for f in folders if (f / "run.json").is_file() or not f.is_dir()]
    return [run for run in read if run.returns.size]


def play(folders: Sequence[Path], picture: Path, as_json: bool) -> None:
    """Let the last policies of runs play, and draw the first seeds' paths side by side.

    Raises:
        NotFound: there is no such folder.
        CardError: there is no run, they drive on several tracks, or their task has no paths.
    """
    runs = _finished(folders)
    if not runs or len({_place(run) for run in runs}) > 1:
        found = ", ".join(sorted({_place(run) for run in runs})) or "no run"
        raise CardError(f"expected runs on one track or in one environment, found {found}")
    if not has_paths(runs[0].task):
        raise CardError(f"expected a task with paths to draw, found '{runs[0].task.name}'")
    panels, told = [], []
    for run in runs:
        seeds = run.record["seeds"]
        played = evaluate(policies(run), run.task, seeds, EPISODES, purpose=Purpose.SCORE)
        panels.append((f"{run.task.name}: {run.label}", played))
        told.append({"run": str(run.folder), "task": run.task.name, "label": run.label})
        told[-1] |= {"returns": played.returns.tolist()} | racing_summary(played)
        if not as_json:
            out.print(table(panels[-1][0], seeds, played))
    title = f"the last policies, {EPISODES} episodes each, first seeds"
    draw_trajectories(runs[0].task, panels, picture, title)
    if as_json:
        print(json.dumps(told, indent=2))
    else:
        say_written([picture], "repaint compare --help")


def _place(run: Run) -> str:
    """Return where a run's paths lie: the track, or the environment's id."""
    env = run.task.env
    return env.track if isinstance(env, RacerEnv) else env.id


def rows(runs: dict[str, Run]) -> list[dict[str, object]]:
    """Return each run's numbers over the iterations that all of them have.

    The target is the best mean return of the first scratch run.
    """
    scratch = [run for run in runs.values() if run.method == "scratch"]
    target = float(np.nanmax(scratch[0].returns.mean(0))) if scratch else None
    common = min(run.returns.shape[1] for run in runs.values())
    found = []
    for label, run in runs.items():
        returns = run.returns
        marks = {f"k={k}": _at(returns, k) for k in MARKS}
        row: dict[str, object] = {"run": label, "method": run.method, "seeds": len(returns)} | marks
        if run.progress is not None:
            row |= {f"progress k={k}": _at(run.progress, k) for k in MARKS}
        area = area_under_curve(returns[:, :common])
        reached = iterations_to(returns, np.nan if target is None else target)
        found.append(
            row
            | {"area": float(area.mean()), "area_spread": float(np.ptp(area))}
            | {"area_iterations": common}
            | {"target": target, "reached": [None if np.isnan(k) else int(k) for k in reached]}
        )
    return found


def verdicts(found: list[dict[str, object]]) -> list[str]:
    """Say in a sentence per run whether its area is ahead of the first scratch run's, or not."""
    scratch = next((row for row in found if row["method"] == "scratch"), None)
    if scratch is None:
        return []
    base = float(str(scratch["area"]))
    sentences = []
    for row in found:
        if row is not scratch:
            ahead = float(str(row["area"])) - base
            word = "above" if ahead > 0 else "below"
            sentences.append(
                f"{row['run']} earned {abs(ahead):.3g} {word} {scratch['run']} per iteration "
                f"(mean return {float(str(row['area'])):.4g} against {base:.4g})"
            )
    return sentences


def _at(numbers: np.ndarray, k: int) -> float | None:
    return float(numbers[:, k - 1].mean()) if k <= numbers.shape[1] else None


def print_comparison(runs: dict[str, Run], as_json: bool) -> None:
    """Print the table, or the same numbers as JSON."""
    found = rows(runs)
    if as_json:
        print(json.dumps(found, indent=2))
        return
    table = Table("run", *(f"k={k}" for k in MARKS), "area", "to target", box=None)
    for row in found:
        cells = []
        for k in MARKS:
            value, progress = row[f"k={k}"], row.get(f"progress k={k}")
            text = "-" if value is None else f"{value:.4g}"
            cells.append(text if progress is None else f"{text} ({progress:.0f} %)")
        reached = row["reached"]
        assert isinstance(reached, list)
        cells.append(f"{row['area']:.4g}")
        cells.append(", ".join("never" if k is None else str(k) for k in reached))
        table.add_row(str(row["run"]), *cells)
    out.print(table)
    for sentence in verdicts(found):
        out.print(sentence)
    target = found[0]["target"]
    reach = "unknown without a scratch run" if target is None else f"{target:.4g}"
    out.print(
        "k: mean evaluation return after iteration k (lap progress); area: under the curve up to "
        f"iteration {found[0]['area_iterations']}, per iteration; to target: each seed's first "
        f"iteration at scratch's best mean, {reach}"
    )
