"""Compare methods on one task: the tables in docs/results.md, and those defaults come from.

    python benchmarks/methods.py choose reacher     # many candidates for the defaults
    python benchmarks/methods.py confirm reacher    # the best of them on fresh seeds, for longer
    python benchmarks/methods.py scale racer-outer  # the scale of L_ins × α₂, small network
    python benchmarks/methods.py readme reacher     # scratch, kickstart, repaint twice; seeds 0-2

Each row is one `repaint transfer` in a process of its own with one thread, two at a time. The runs
go to runs/methods/, the table to benchmarks/results/ as CSV, a line per row and seed.
"""

import argparse
import csv
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from repaint_cli.report.statistics import area_under_curve, iterations_to
from repaint_cli.runs.reader import read_run
from repaint_cli.tasks.card_files import read_task

RESULTS = Path(__file__).parent / "results"
MARKS = (1, 5, 10, 20)


@dataclass(frozen=True)
class Row:
    """One configuration."""

    label: str
    method: str
    teacher: str | None = None
    options: tuple[str, ...] = ()


def sets(**values: object) -> tuple[str, ...]:
    """Return --set options from section__key=value."""
    return tuple(
        part
        for key, value in values.items()
        for part in ("--set", f"{key.replace('__', '.')}={value}")
    )


def paper_numbers(task: str) -> tuple[str, ...]:
    """Return the paper's numbers where ours may differ: raw ζ, the teacher as trained, β₀, 1:1."""
    lasts, threshold = (4, 0.2) if task.startswith("racer") else (15, 0.8)
    return sets(
        select__scale="none", select__threshold=threshold, transfer__iterations=lasts,
        transfer__representation=1, transfer__kickstart_coef=0.2, transfer__teacher_min_std=0,
        transfer__teacher_temperature=1, transfer__alpha_2=1,
    )  # fmt: skip


def readme_rows(task: str) -> Iterator[Row]:
    """Yield the rows of docs/results.md."""
    yield Row("scratch", "scratch")
    for teacher in TEACHERS[task]:
        yield Row(f"kickstart from {teacher}", "kickstart", teacher)
        yield Row(
            f"repaint from {teacher}, paper's numbers", "repaint", teacher, paper_numbers(task)
        )
        yield Row(f"repaint from {teacher}, our defaults", "repaint", teacher)
    if task == "reacher":  # what a teacher of a task that is alike deserves
        leaning = sets(transfer__kickstart_coef=1, transfer__iterations=15)
        label = "from reacher-gentle, leaning on it"
        yield Row(f"kickstart {label}", "kickstart", "reacher-gentle", leaning)
        leaning += sets(select__scale="student-batch")
        yield Row(f"repaint {label}", "repaint", "reacher-gentle", leaning)


def choose_rows(task: str) -> Iterator[Row]:
    """Yield candidates for a family's defaults: β₀ × K × scales of ζ; the teacher as trained."""
    yield Row("scratch", "scratch")
    for teacher in TEACHERS[task]:
        for beta, length in product(BETAS[task], LENGTHS[task]):
            basis = sets(transfer__kickstart_coef=beta, transfer__iterations=length)
            basis += SPREAD[task]
            given = f"{teacher}, β₀={beta}, K={length}"
            yield Row(f"kickstart from {given}", "kickstart", teacher, basis)
            for scale, alpha in product(("teacher-batch", "student-batch", "none"), ALPHAS[task]):
                options = basis + sets(select__scale=scale, transfer__alpha_2=alpha)
                label = f"repaint from {given}, {scale}" + (f", α₂={alpha}" if alpha != 1 else "")
                yield Row(label, "repaint", teacher, options)
        if task == "reacher":
            sharp = sets(transfer__teacher_min_std=0, select__scale="teacher-batch")
            sharp += sets(transfer__kickstart_coef=0.2, transfer__iterations=15)
            yield Row(f"repaint from {teacher}, its σ as trained", "repaint", teacher, sharp)
        else:
            weak = SPREAD[task] + sets(transfer__kickstart_coef=0.05, transfer__iterations=4)
            yield Row(f"kickstart from {teacher}, β₀=0.05, K=4", "kickstart", teacher, weak)
            weak += sets(select__scale="student-batch", transfer__alpha_2=0.1)
            label = f"repaint from {teacher}, β₀=0.05, K=4, student-batch, α₂=0.1"
            yield Row(label, "repaint", teacher, weak)


def confirm_rows(task: str) -> Iterator[Row]:
    """Yield the most promising settings, to be told apart on fresh seeds and for longer."""
    yield Row("scratch", "scratch")
    for teacher, finalist in product(TEACHERS[task], FINALISTS[task]):
        beta, length, scale, alpha, softness, own = finalist
        options = SPREAD[task] + sets(
            transfer__representation=own,
            transfer__kickstart_coef=beta,
            transfer__iterations=length,
            transfer__alpha_2=alpha,
            transfer__teacher_temperature=softness,
            select__scale=scale,
        )
        label = f"repaint from {teacher}, β₀={beta}, K={length}, {scale}"
        label += f", α₂={alpha}" if alpha != 1 else ""
        label += f", temperature {softness}" if softness != 1 else ""
        label += f", ratio {own}:1" if own != 1 else ""
        yield Row(label, "repaint", teacher, options)


def scale_rows(task: str) -> Iterator[Row]:
    """Yield the scales of L_ins × α₂, with the paper's other numbers and with ours."""
    small = SMALL if task.startswith("racer") else ()
    yield Row("scratch", "scratch", None, small)
    for teacher in TEACHERS[task]:
        for basis, numbers in {"paper's numbers": paper_numbers(task), "our numbers": ()}.items():
            for scale, alpha in product(("raw", "student"), (1, 0.3, 0.1)):
                options = small + numbers
                options += sets(select__loss_scale=scale, transfer__alpha_2=alpha)
                label = f"repaint from {teacher}, {basis}, {scale}, α₂={alpha}"
                yield Row(label, "repaint", teacher, options)


SMALL = sets(net__conv="[[16,8,4],[32,4,2]]", net__dense=128, net__pool=4)
"""A camera network that takes a tenth of the card's time and learns much the same."""

TEACHERS = {"reacher": ("reacher-gentle", "reacher-away"), "racer-outer": ("racer-inner",)}
BETAS = {"reacher": (0.2, 1.0), "racer-outer": (0.2,)}
LENGTHS = {"reacher": (15, 4), "racer-outer": (4,)}
ALPHAS = {"reacher": (1,), "racer-outer": (1, 0.1)}
SPREAD = {
    "reacher": sets(transfer__teacher_min_std=0.4),
    "racer-outer": sets(transfer__teacher_temperature=1, transfer__representation=1),
}
FINALISTS = {
    "reacher": (
        (0.2, 4, "none", 1, 1, 1), (0.2, 4, "teacher-batch", 1, 1, 1),
        (0.2, 4, "teacher-batch", 0.1, 1, 1), (0.2, 15, "teacher-batch", 1, 1, 1),
    ),
    "racer-outer": (
        (0.2, 4, "none", 0.1, 1, 1), (0.05, 4, "none", 0.1, 1, 1), (0.2, 4, "none", 0.1, 3, 1),
        (0.2, 3, "none", 0.1, 3, 1), (0.2, 2, "none", 0.1, 3, 1), (0.05, 4, "none", 0.1, 3, 3),
    ),
}  # fmt: skip
"""β₀, K, the scale of ζ, α₂, the softmax temperature of a discrete teacher, and R of the ratio."""
ROWS = {
    "choose": choose_rows, "confirm": confirm_rows, "readme": readme_rows, "scale": scale_rows,
}  # fmt: skip
PLANS = {
    ("readme", "reacher"): ("0", "3", "20"),
    ("readme", "racer-outer"): ("0", "3", "20"),
    ("choose", "reacher"): ("100", "3", "25"),
    ("choose", "racer-outer"): ("100", "2", "8"),
    ("confirm", "reacher"): ("103", "10", "20"),
    ("confirm", "racer-outer"): ("102", "3", "20"),
    ("scale", "reacher"): ("100", "10", "20"),
    ("scale", "racer-outer"): ("100", "10", "8"),
}
"""First seed, number of seeds, iterations."""


def run(row: Row, task: str, plan: tuple[str, str, str], folder: Path) -> Path:
    """Run a row, unless it has been run with the same settings; return its folder."""
    seed, seeds, iterations = plan
    command = [
        "transfer", "--task", task, "--method", row.method,
        "--seed", seed, "--seeds", seeds, "--iterations", iterations, "--run", str(folder),
        *(("--teacher", row.teacher) if row.teacher else ()), *row.options,
    ]  # fmt: skip
    card = read_task(task).with_settings([word for word in row.options if "=" in word])
    settings = f"{' '.join(command)}\n{card.model_dump_json()}\n"
    done = folder / "done"
    if not done.exists() or done.read_text(encoding="utf-8") != settings:
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run(
            [sys.executable, "-m", "repaint_cli", *command],
            check=True, env=os.environ | {"OMP_NUM_THREADS": "1"}, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        done.write_text(settings, encoding="utf-8")
    print(row.label, flush=True)
    return folder


def lines(label: str, folder: Path, target: float) -> Iterator[dict[str, object]]:
    """Yield a line per seed: return and lap progress at the marks, area, iterations to target."""
    recorded = read_run(folder)
    returns, reached = recorded.returns, iterations_to(recorded.returns, target)
    for s, seed in enumerate(recorded.seeds):
        line: dict[str, object] = {"row": label, "seed": seed}
        for k in (k for k in MARKS if k <= returns.shape[1]):
            line[f"return_{k}"] = f"{returns[s, k - 1]:.4g}"
            if recorded.progress is not None:
                line[f"progress_{k}"] = f"{recorded.progress[s, k - 1]:.3g}"
        line["area"] = f"{area_under_curve(returns)[s]:.4g}"
        line["to_target"] = "" if np.isnan(reached[s]) else int(reached[s])
        kept = recorded.rows["kept_fraction"][s]
        line["kept"] = "" if np.isnan(kept).all() else f"{np.nanmean(kept):.3f}"
        yield line


def markdown(table: list[dict[str, object]]) -> Iterator[str]:
    """Yield the table's lines for people: means over seeds, the area with its range."""
    marks = [k for k in MARKS if f"return_{k}" in table[0]]
    yield f"| | {' | '.join(f'k = {k}' for k in marks)} | area [range] | K to scratch's best |"
    yield "|---" * (len(marks) + 3) + "|"
    for label in dict.fromkeys(line["row"] for line in table):
        mine = [line for line in table if line["row"] == label]
        cells = []
        for k in marks:
            cell = f"{mean(mine, f'return_{k}'):.1f}"
            if f"progress_{k}" in mine[0]:
                cell += f" ({mean(mine, f'progress_{k}'):.0f} %)"
            cells.append(cell)
        areas = [float(str(line["area"])) for line in mine]
        first = [str(line["to_target"] or "never") for line in mine]
        reached = ", ".join(first) if set(first) != {"never"} else "never"
        span = f"{mean(mine, 'area'):.1f} [{min(areas):.1f}, {max(areas):.1f}]"
        yield f"| {label} | {' | '.join(cells)} | {span} | {reached} |"


def mean(lines: list[dict[str, object]], name: str) -> float:
    """Return the mean of a column over some lines."""
    return float(np.mean([float(str(line[name])) for line in lines]))


def main() -> None:
    """Run a table's rows and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("table", choices=sorted(ROWS))
    parser.add_argument("task", choices=sorted(TEACHERS))
    parser.add_argument("--jobs", type=int, default=2)
    chosen = parser.parse_args()
    plan = PLANS[chosen.table, chosen.task]
    rows = list(ROWS[chosen.table](chosen.task))
    root = Path("runs") / "methods" / f"{chosen.table}-{chosen.task}"
    folders = [root / re.sub(r"[^a-z0-9.]+", "-", row.label.lower()) for row in rows]
    with ThreadPoolExecutor(chosen.jobs) as pool:
        list(pool.map(lambda row, folder: run(row, chosen.task, plan, folder), rows, folders))
    target = float(np.nanmax(read_run(folders[0]).returns.mean(0)))
    pairs = zip(rows, folders, strict=True)
    table = [line for row, folder in pairs for line in lines(row.label, folder, target)]
    RESULTS.mkdir(exist_ok=True)
    with (RESULTS / f"{chosen.table}-{chosen.task}.csv").open("w", encoding="utf-8") as file:
        names = list(dict.fromkeys(name for line in table for name in line))
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(table)
    print("\n".join(markdown(table)))


if __name__ == "__main__":
    main()
