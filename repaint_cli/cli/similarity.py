"""`repaint similarity`."""

from typing import TYPE_CHECKING, Annotated

from repaint_cli.cli import completion
from repaint_cli.cli.help_page import OPTIONS
from repaint_cli.cli.options import AsJson, argument, option

if TYPE_CHECKING:
    from repaint_cli.tasks.reward_fit import Fit
    from repaint_cli.tasks.similarity import Similarities, Similarity
    from repaint_cli.zoo.ranking import Ranking


Measure = Annotated[
    bool,
    option(
        OPTIONS,
        None,
        "Let the first, a teacher, play the second, a task: 20 episodes in each view, as in "
        "repaint zoo rank.",
        "--measure",
    ),
]


def similarity(
    names: Annotated[
        list[str] | None,
        argument(
            "TASK",
            "Tasks, cards' files or teachers. Default: all shipped tasks.",
            autocompletion=completion.tasks_and_teachers,
        ),
    ] = None,
    measure: Measure = False,
    as_json: AsJson = False,
) -> None:
    """Compare tasks by the cosine of their reward weights.

    It also says what a teacher of one is to another: a row's task is the teacher's, a column's is
    the target.

    Examples:
        repaint similarity racer-inner racer-outer
        repaint similarity racer-inner racer-outer --measure
    """
    import repaint_cli
    from repaint_cli.cli.namesakes import print_notes
    from repaint_cli.cli.zoo_rank import print_ranking
    from repaint_cli.files.paths import shipped_tasks

    def print_fit(name: str, fit: "Fit") -> None:
        if not as_json:
            print(f"{name} weighs {fit}")

    typed = names or []
    print_notes(*(name for name in typed if name not in shipped_tasks()))
    similarities = repaint_cli.similarity(*typed, on_fit=print_fit)
    ranking = _measured(*typed) if measure else None
    if as_json:
        return _print_json(similarities, ranking)
    if len(similarities.tasks) > 2:
        return _print_matrix(similarities)
    _print_pair(similarities.pairs[0])
    if ranking:
        print()
        print_ranking(ranking, typed[1])


def _print_json(similarities: "Similarities", ranking: "Ranking | None") -> None:
    """Print all pairs, of two tasks the one that is asked for, and what was measured."""
    import json

    from repaint_cli.cli.zoo_rank import ranking_as_json

    pairs = [pair._asdict() for pair in similarities.pairs]
    if ranking:
        pairs[0]["measured"] = ranking_as_json(ranking)
    print(json.dumps(pairs[:1] if len(similarities.tasks) == 2 else pairs, indent=2))


def _print_pair(pair: "Similarity") -> None:
    """Print how two tasks relate, and what a teacher's mirror images are to the other task."""
    from repaint_cli.cli.console import plain

    value = "" if pair.cosine is None else f"{_number(pair.cosine)}  "
    reason = f": {plain(pair.reason)}" if pair.reason else ""
    print(f"{plain(pair.teacher)} → {plain(pair.target)}  {value}{pair.relation}{reason}")
    _print_views(pair)


def _measured(*names: str) -> "Ranking":
    """Let a teacher play a task in every view that may differ.

    Raises:
        UsageError: the names are not two.
    """
    from rich.console import Console

    import repaint_cli
    from repaint_cli.cli.live import live
    from repaint_cli.errors import UsageError
    from repaint_cli.zoo.ranking import rank, views_of
    from repaint_cli.zoo.view_names import AUTO, find, in_view

    if len(names) != 2:
        raise UsageError(
            f"--measure needs a teacher and a task, found {len(names)} names; to measure all "
            "teachers: repaint zoo rank --task TASK"
        )
    card = repaint_cli.load_task(names[1])
    (name,) = in_view(names[:1], AUTO)
    with live(Console(stderr=True)):
        return rank(card, 0, among=views_of(find(name), card))


def _print_views(pair: "Similarity") -> None:
    """Print the cosines of a teacher's mirror images, and what to type for one that is similar."""
    from repaint_cli.cli.console import plain
    from repaint_cli.files.commands import command
    from repaint_cli.zoo.store import teachers
    from repaint_cli.zoo.view_names import with_view

    for name, value in pair.views.items():
        verdict = "similar" if value > 0 else "different"
        teacher = plain(with_view(pair.teacher, name))
        print(f"{teacher} → {plain(pair.target)}  {_number(value)}  {verdict}")
    if not pair.view:
        return
    if pair.teacher in teachers():
        name = with_view(pair.teacher, pair.view)
        print(command("try: repaint transfer --teacher {} --task {}", name, pair.target))
    else:
        print(command("train one first: repaint train-teacher --task {}", pair.teacher))


LONG = 20
"""Letters of the longest name that stands over a column in one line."""


def _print_matrix(similarities: "Similarities") -> None:
    """Print a table of cosines per group of comparable tasks."""
    from rich.console import Console
    from rich.table import Column, Table

    from repaint_cli.cli.console import literal

    out, groups = Console(highlight=False), similarities.groups()
    for group in groups:
        corner = Column("teacher \\ target", no_wrap=True)
        table = Table(corner, *(literal(_heading(card.name)) for card in group), box=None)
        for teacher in group:
            cells = (_cell(similarities.of(teacher, target)) for target in group)
            table.add_row(literal(teacher.name), *cells)
        out.print(table)
        out.print()
    out.print(
        "above 0: similar, else different; *: a sub-task of the target; ~: more similar in "
        "a mirror (name the two tasks to see it)"
    )
    if len(groups) > 1:
        out.print("tables apart are not comparable:")
    for group in groups[1:]:
        pair = similarities.of(groups[0][0], group[0])
        out.print(literal(f"  {pair.teacher}, {pair.target}: {pair.reason}"), soft_wrap=True)


def _heading(name: str) -> str:
    """Return a name over a column of numbers, a long one in two lines."""
    middle = min(
        (i + 1 for i, letter in enumerate(name) if letter == "-"),
        key=lambda i: abs(2 * i - len(name)), default=0,
    )  # fmt: skip
    return f"{name[:middle]}\n{name[middle:]}" if middle and len(name) > LONG else name


def _cell(pair: "Similarity") -> str:
    marks = ("*" if "sub-task" in pair.relation else "") + ("~" if pair.view else "")
    return f"{_number(pair.cosine or 0.0)}{marks}"


def _number(cosine: float) -> str:
    """Return a cosine as text, without a minus where it is 0."""
    return f"{round(cosine, 3) + 0.0:.3f}"
