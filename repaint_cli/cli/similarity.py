"""`repaint similarity`."""

from typing import TYPE_CHECKING, Annotated

from repaint_cli.cli.options import AsJson, argument

if TYPE_CHECKING:
    from repaint_cli.tasks.card import TaskCard


def similarity(
    names: Annotated[
        list[str] | None,
        argument("TASK", "Tasks, cards' files or teachers. Default: all shipped tasks."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compare tasks by the cosine of their reward weights.

    And say what a teacher of one is to another: a row's task is the teacher's, a column's is the
    target.

    Examples:
        repaint similarity
        repaint similarity racer-inner racer-outer
    """
    import json

    from repaint_cli.tasks.card_files import shipped_tasks
    from repaint_cli.tasks.similarity import cosine, relation

    cards = [_card(name) for name in names or shipped_tasks()]
    if len(cards) == 1:
        cards += [_card(name) for name in shipped_tasks() if name != cards[0].name]
    cards = [_with_weights(card, as_json) if card.reward_code else card for card in cards]
    pairs = [
        {"teacher": a.name, "target": b.name, "cosine": cosine(a, b), "relation": relation(a, b)}
        for a in cards for b in cards if a is not b
    ]  # fmt: skip
    if as_json:
        print(json.dumps(pairs[:1] if len(cards) == 2 else pairs, indent=2))
    elif len(cards) == 2:
        pair = pairs[0]
        value = "" if pair["cosine"] is None else f"{pair['cosine']:.3f}  "
        print(f"{pair['teacher']} → {pair['target']}  {value}{pair['relation']}")
    else:
        _print_matrix(cards)


def _card(name: str) -> "TaskCard":
    """Read a task's card, or the card inside a teacher."""
    from repaint_cli.tasks.card_files import read_task, shipped_tasks

    if name.endswith(".toml") or name in shipped_tasks():
        return read_task(name)
    from repaint_cli.errors import CardError, NotFound
    from repaint_cli.zoo import store
    from repaint_cli.zoo.teacher_card import read_card

    teachers = store.teachers()
    if name in teachers or name.endswith(".safetensors"):
        card = read_card(store.find(name)).task
        if card.reward_code:
            raise CardError(
                f"'{name}' was trained with the reward function {card.reward_code.name}, which is "
                "never run from a teacher's file; name its card: my-task.toml"
            )
        return card
    known = [*shipped_tasks(), *teachers]
    raise NotFound.named("task or teacher", name, known, "repaint tasks list, repaint zoo list")


def _with_weights(card: "TaskCard", quiet: bool) -> "TaskCard":
    """Return the card with fitted weights in place of its reward function; print them."""
    from repaint_cli.tasks.reward_fit import fit, weighed

    fitted = fit(card)
    if not quiet:
        print(f"{card.name} weighs {fitted}")
    return weighed(card, fitted)


def _print_matrix(cards: "list[TaskCard]") -> None:
    """Print a table of cosines per group of comparable tasks."""
    from rich.console import Console
    from rich.table import Table

    from repaint_cli.cli.console import literal
    from repaint_cli.tasks.similarity import cosine, relation

    out, left = Console(), list(cards)
    while left:
        group = [card for card in left if card is left[0] or cosine(left[0], card) is not None]
        left = [card for card in left if card not in group]
        table = Table("teacher \\ target", *(literal(card.name) for card in group), box=None)
        for a in group:
            cells = (
                f"{cosine(a, b):.3f}{'*' if 'sub-task' in relation(a, b) else ''}" for b in group
            )
            table.add_row(literal(a.name), *cells)
        out.print(table)
        out.print()
    out.print("above 0: similar; else different; *: the teacher's task is a sub-task of the target")
