"""How alike two tasks are, by the weights of their reward terms (paper, section 6)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot
from typing import TYPE_CHECKING, NamedTuple

from repaint_cli.envs.simulator import Simulator
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.task import Task

if TYPE_CHECKING:
    from repaint_cli.tasks.reward_fit import Fit


SAME = 1e-9
"""Cosines that differ less are the same."""


def cosine(first: Task, second: Task) -> float | None:
    """Return the similarity of two tasks, or None where their environments or terms differ.

    A term that the simulator can pay and a task does not name weighs 0.

    sim(r₁, r₂) = w₁·w₂ / (‖w₁‖‖w₂‖)      (paper, equation 4)
    """
    if obstacle(first, second):
        return None
    terms = sorted(first.reward.keys() & second.reward.keys())
    w1, w2 = (_direction(task, terms) for task in (first, second))
    return sum(a * b for a, b in zip(w1, w2, strict=True))


def cosines_of_views(teacher: Task, target: Task) -> dict[str, float]:
    """Return cos(g·w_T, w) by the names of the target's symmetries g, where it is another cosine.

    g·w_T are the weights of what a teacher's mirror image does in the same world.
    """
    plain, cosines = cosine(teacher, target), {}
    for symmetry in target.symmetries:
        image = teacher.in_mirror(symmetry)
        value = None if image is None else cosine(image, target)
        if value is not None and plain is not None and abs(value - plain) > SAME:
            cosines[symmetry.name] = value
    return cosines


def better_view(teacher: Task, target: Task) -> tuple[str, float] | None:
    """Return the symmetry in whose mirror a teacher is similar and more so than as it is.

    With its cosine, the highest of several; None where there is none.
    """
    plain, cosines = cosine(teacher, target), cosines_of_views(teacher, target)
    better = {name: value for name, value in cosines.items() if value > max(plain or 0.0, 0.0)}
    return max(better.items(), key=lambda pair: pair[1], default=None)


def obstacle(first: Task, second: Task) -> str | None:
    """Return why two tasks cannot be compared, for people; None where they can."""
    if first.env.simulator != second.env.simulator:
        return f"other simulators: {first.env.simulator} and {second.env.simulator}"
    if not first.env.same_world(second.env):
        return _other_worlds(first.env, second.env)
    if first.reward_code != second.reward_code:
        return "other reward functions"
    if first.terms != second.terms:
        return f"other reward terms: {_differing(first.terms, second.terms)}"
    return None


def _differing(first: frozenset[str], second: frozenset[str]) -> str:
    """Name the terms that only one of two tasks has."""
    only = {"the first": sorted(first - second), "the second": sorted(second - first)}
    return "; ".join(
        f"{', '.join(terms)} only in {which}" for which, terms in only.items() if terms
    )


def _other_worlds(first: Simulator, second: Simulator) -> str:
    """Say in which settings two environments differ, or in the terms that they can pay."""
    if first.reward_terms and second.reward_terms:
        return f"other reward terms: {_differing(first.reward_terms, second.reward_terms)}"
    own, others = first.model_dump(), second.model_dump()
    differing = [name for name in own if own[name] != others.get(name)]
    values = [f"{name} {own[name]} and {others.get(name)}" for name in differing]
    return f"other environments: {'; '.join(values)}"


def _direction(task: Task, terms: Sequence[str]) -> list[float]:
    """Return some terms of w / ‖w‖; scaled first, as squares of tiny and huge numbers are lost."""
    largest = max(abs(w) for w in task.reward.values())
    length = hypot(*(w / largest for w in task.reward.values()))
    return [w / largest / length for w in task.weights(terms)]


def relation(teacher: Task, target: Task) -> str:
    """Return the paper's verdict on a teacher's task for a target task (section 6).

    "similar" where the cosine is above 0, else "different"; and "sub-task" where the teacher's
    weight is 0 on a term whose weight in the target is not. The last is directed: it may not
    hold with the two exchanged.
    """
    similarity = cosine(teacher, target)
    if similarity is None:
        return "not comparable"
    part = any(weight and not teacher.reward.get(name) for name, weight in target.reward.items())
    return ("similar" if similarity > 0 else "different") + (", sub-task" if part else "")


OnFit = Callable[[str, "Fit"], object]
"""Is called with a task's name and the weights that were fitted to its reward function."""


class Similarity(NamedTuple):
    """What a teacher of one task is to another task."""

    teacher: str
    """The teacher's task."""
    target: str
    """The other task."""
    cosine: float | None
    """Of their weights; None where they are not comparable."""
    relation: str
    """The paper's verdict."""
    reason: str | None = None
    """Why they are not comparable."""
    views: dict[str, float] = {}  # noqa: RUF012
    """The cosine of a teacher's mirror image, by the name of a symmetry, where it is another."""
    view: str | None = None
    """The symmetry in whose mirror it is similar and more so than as it is."""


@dataclass(frozen=True)
class Similarities:
    """Tasks beside each other."""

    tasks: Sequence[TaskCard]
    """The tasks, with weights."""
    fits: "dict[str, Fit]"
    """By task, the weights that were fitted to a reward function."""

    @property
    def pairs(self) -> list[Similarity]:
        """Every task as the teacher's of every other one."""
        return [self.of(a, b) for a in self.tasks for b in self.tasks if a is not b]

    def of(self, teacher: TaskCard, target: TaskCard) -> Similarity:
        """Return what a teacher of one of the tasks is to another one of them."""
        value = cosine(teacher, target)
        reason = obstacle(teacher, target)
        views, better = cosines_of_views(teacher, target), better_view(teacher, target)
        return Similarity(
            teacher.name, target.name, value, relation(teacher, target), reason, views,
            better[0] if better else None,
        )  # fmt: skip

    def groups(self) -> list[list[TaskCard]]:
        """Return the tasks in groups within which cosines exist."""
        groups, left = [], list(self.tasks)
        while left:
            first = left[0]
            groups.append([t for t in left if t is first or cosine(first, t) is not None])
            left = [task for task in left if task not in groups[-1]]
        return groups


def similarities_of(cards: Sequence[TaskCard], on_fit: OnFit | None = None) -> Similarities:
    """Compare tasks, with weights fitted in place of reward functions.

    Args:
        cards: the tasks.
        on_fit: called with a task's name and what was fitted, before it is judged.

    Raises:
        CardError: a reward function is no weighted sum of the simulator's terms, or failed.
    """
    tasks = list(cards)
    fits: dict[str, Fit] = {}
    for i, card in enumerate(cards):
        if card.reward_code:
            from repaint_cli.tasks.reward_fit import fit, with_fitted_weights

            fits[card.name] = fit(card)
            if on_fit:
                on_fit(card.name, fits[card.name])
            tasks[i] = with_fitted_weights(card, fits[card.name])
    return Similarities(tasks, fits)
