"""`repaint zoo rank`: which teacher is worth learning a task from, before anything is trained."""

from typing import TYPE_CHECKING, Annotated, Any

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import OPTIONS
from repaint_cli.cli.options import AsJson, option
from repaint_cli.files.commands import command

if TYPE_CHECKING:
    from repaint_cli.zoo.played import Played
    from repaint_cli.zoo.ranking import Ranking


def rank(
    task: Annotated[
        str,
        option(OPTIONS, "TASK", "The task that is to be learned.", autocompletion=completion.tasks),
    ],
    episodes: Annotated[
        int, option(OPTIONS, "INT", "How many episodes each teacher plays, in each view.")
    ] = 20,
    seed: Annotated[int, option(OPTIONS, "INT", "The seed of the episodes.")] = 0,
    as_json: AsJson = False,
) -> None:
    """Let all teachers that fit a task play it, and say whom to learn from.

    Nothing is trained. Teachers play in each view that may differ: as they are, in the mirror
    (NAME:mirrored), and both as one (NAME:both).

    Examples:
        repaint zoo rank --task racer-outer
        repaint zoo rank --task reacher --episodes 100
    """
    import json

    from rich.console import Console

    import repaint_cli
    from repaint_cli.cli.live import live
    from repaint_cli.errors import UsageError
    from repaint_cli.zoo.ranking import rank

    if episodes < 2:
        raise UsageError(f"expected --episodes of at least 2, found {episodes}")
    with live(Console(stderr=True)):
        ranking = rank(repaint_cli.load_task(task), seed, episodes)
    if as_json:
        return print(json.dumps(ranking_as_json(ranking), indent=2))
    print_ranking(ranking, task)


def print_ranking(ranking: "Ranking", task: str) -> None:
    """Print a ranking, whom to take, and the next command; the task as it is typed."""
    _print_table(ranking)
    print(verdict(ranking))
    print(command(*_next(ranking, task)))


def verdict(ranking: "Ranking") -> str:
    """Return a sentence: whom to take, and how to lean on it, or nobody."""
    best = ranking.teachers[0]
    lead = f"the best, {best.name}: {ranking.comparison}"
    if ranking.best is None:
        return f"{lead}\ntake nobody, that is no more than chance"
    how = "starts from its weights" if best.same_networks else "imitates it first"
    return f"{lead}\ntake {best.name}; the plain command {how}"


def _next(ranking: "Ranking", task: str) -> tuple[str, ...]:
    """Return the next command worth typing, and its values."""
    best = ranking.best
    if best is None:
        return "next: repaint transfer --task {} --method scratch", task
    return "next: repaint transfer --teacher {} --task {}", best.name, task


def ranking_as_json(ranking: "Ranking") -> dict[str, Any]:
    """Return a ranking as JSON."""
    best = ranking.best
    everybody = [*ranking.teachers, ranking.untrained]
    return {
        "task": ranking.task.name,
        "take": best.name if best else None,
        "policies": [
            {
                "name": one.name,
                "returns": one.returns.tolist(),
                "lengths": one.lengths.tolist(),
                "progress": None if one.progress is None else one.progress.tolist(),
                "reverse": one.reverse.tolist(),
                "better": one.better,
                "cosine": one.cosine,
                "lead": ranking.lead(one),
                "steps": int(one.lengths.sum()),
            }
            for one in everybody
        ],
    }


def _print_table(ranking: "Ranking") -> None:
    """Print a row per teacher and view, the best first, and one of untrained policies."""
    from repaint_cli.cli.console import columns

    races = ranking.untrained.progress is not None
    both_ways = bool(ranking.teachers[0].reverse.any())
    heads = ["teacher", "return [95 % CI]"]
    heads += ["forward", "reverse"] if both_ways else []
    heads += ["lap, %"] if races else []
    heads += ["better", "cosine"]
    everybody = (*ranking.teachers, ranking.untrained)
    print(columns(heads, [_row(one, both_ways) for one in everybody]))
    steps = sum(int(one.lengths.sum()) for one in everybody)
    print(f"{steps:,} steps in all; better: how often a fresh critic calls a step of the teacher")
    print("better than one of an untrained policy; 0.5 is no difference")


def _row(one: "Played", both_ways: bool) -> tuple[str, ...]:
    from repaint_cli.report.statistics import mean_ci

    mean, low, high = mean_ci(one.returns)
    cells = [one.name, f"{mean:.4g} [{low:.4g}, {high:.4g}]"]
    if both_ways:
        cells += [f"{one.returns[part].mean():.4g}" for part in (~one.reverse, one.reverse)]
    if one.progress is not None:
        cells.append(f"{one.progress.mean():.0f}")
    cosine = "-" if one.cosine is None else f"{round(one.cosine, 3) + 0.0:.3f}"
    return (*cells, f"{one.better:.2f}", cosine)
