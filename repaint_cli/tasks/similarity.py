"""How alike two tasks are, by the weights of their reward terms (paper, section 6)."""

from collections.abc import Sequence
from math import hypot

from repaint_cli.tasks.task import Task


def cosine(first: Task, second: Task) -> float | None:
    """Return the similarity of two tasks, or None where their environments or terms differ.

    A term that the simulator can pay and a task does not name weighs 0.

    sim(r₁, r₂) = w₁·w₂ / (‖w₁‖‖w₂‖)      (paper, equation 4)
    """
    if not first.env.same_world(second.env) or first.reward_code != second.reward_code:
        return None
    if first.terms != second.terms:
        return None
    terms = sorted(first.reward.keys() & second.reward.keys())
    w1, w2 = (_direction(task, terms) for task in (first, second))
    return sum(a * b for a, b in zip(w1, w2, strict=True))


def _direction(task: Task, terms: Sequence[str]) -> list[float]:
    """Return some terms of w / ‖w‖; scaled first, as squares of tiny and huge numbers are lost."""
    largest = max(abs(w) for w in task.reward.values())
    length = hypot(*(w / largest for w in task.reward.values()))
    return [w / largest / length for w in task.weights(terms)]


def relation(teacher: Task, target: Task) -> str:
    """Return the paper's verdict on a teacher's task for a target task (section 6).

    "similar" where the cosine is above 0, else "different"; and "sub-task" where the teacher's
    weight is 0 on a term whose weight in the target is not. The last is directed: swap the two and
    it may vanish.
    """
    similarity = cosine(teacher, target)
    if similarity is None:
        return "not comparable"
    part = any(weight and not teacher.reward.get(name) for name, weight in target.reward.items())
    return ("similar" if similarity > 0 else "different") + (", sub-task" if part else "")
