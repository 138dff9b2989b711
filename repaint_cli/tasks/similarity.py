"""How alike two tasks are, by the weights of their reward terms (paper, section 6)."""

from collections.abc import Mapping
from math import hypot

from repaint_cli.envs.simulator import GymEnv
from repaint_cli.tasks.task import TaskCard


def cosine(first: TaskCard, second: TaskCard) -> float | None:
    """Return the similarity of two tasks, or None where their environments or terms differ.

    The racer's terms are always the same: one that a racing card does not name weighs 0.

    sim(r₁, r₂) = w₁·w₂ / (‖w₁‖‖w₂‖)      (paper, equation 4)
    """
    w1, w2 = first.reward, second.reward
    if _world(first) != _world(second) or first.reward_code != second.reward_code:
        return None
    if isinstance(first.env, GymEnv) and w1.keys() != w2.keys():
        return None
    w1, w2 = _direction(w1), _direction(w2)
    return sum(w1[name] * w2[name] for name in w1.keys() & w2.keys())


def _direction(weights: Mapping[str, float]) -> dict[str, float]:
    """Return w / ‖w‖; first of the largest, for the squares of tiny and huge numbers are lost."""
    largest = max(abs(w) for w in weights.values())
    length = hypot(*(w / largest for w in weights.values()))
    return {name: w / largest / length for name, w in weights.items()}


def relation(teacher: TaskCard, target: TaskCard) -> str:
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


def _world(card: TaskCard) -> tuple[str, str]:
    """Return what decides which reward terms there are."""
    env = card.env
    kind = env.id if isinstance(env, GymEnv) else "with bots" if env.n_bots else "alone"
    return env.simulator, kind
