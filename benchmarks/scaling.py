"""What seeds, environments, longer rollouts and camera seeds cost: where each line bends.

    python benchmarks/scaling.py

Reacher with the paper's numbers, training only, and the camera racer with a policy that drives
whole laps. The last column is a row's cost against the first row's: flat or falling is wanted.
"""

import resource
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from time import perf_counter

import numpy as np
from turns import Measurements, Table, median, run, span

SEEDS = (1, 2, 5, 10, 20, 32)
ENVS = (1, 4, 16, 64, 256)
STEPS = (512, 1024, 2048, 4096, 8192, 16384)
CAMERA_SEEDS = (1, 2, 5)


def training(n_seeds: int = 1, n_steps: int = 2048, n_envs: int = 40) -> float:
    """Return the ms per 1,000 steps of training, over all seeds."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.tasks.card_files import read_task

    settings = [f"ppo.n_steps={n_steps}", f"ppo.n_envs={n_envs}"]
    card = read_task("reacher").with_settings(settings)
    student = ActorCritic(spaces_of(card), card.net, n_seeds)
    learner = Learner.fresh(student, list(range(n_seeds)), card.ppo.learning_rate)
    iterations = train(card, learner, course_of(card, (), n_seeds))
    next(iterations)
    started, count = perf_counter(), 3
    for _ in islice(iterations, count):
        pass
    return 1e6 * (perf_counter() - started) / (count * n_seeds * n_steps)


def acting(n_envs: int, steps: int = 100) -> float:
    """Return the ms per 1,000 steps of acting alone in N environments."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.rollout.collect import collect, start
    from repaint_cli.learn.seeding import Purpose
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.tasks.card_files import read_task

    card = read_task("reacher")
    student = ActorCritic(spaces_of(card), card.net, 1)
    student.initialize([np.random.default_rng(0)])
    taken = []
    for iteration in (1, 2):  # the first warms
        env, obs = start(card, [0], n_envs, Purpose.TRAIN, iteration)
        rngs, total = [np.random.default_rng(0)], steps * n_envs
        started = perf_counter()
        collect(env, obs, student.policy, rngs, n_steps=total)
        taken.append(1e6 * (perf_counter() - started) / total)
        env.close()
    return taken[-1]


def memory(n_seeds: int) -> float:
    """Return the largest resident memory of camera training, MB: 20 laps a seed, one epoch."""
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.tasks.card_files import read_task
    from repaint_cli.zoo import store

    student, _ = store.read_teacher(store.find("racer-inner"), n_seeds)
    weights = student.storage.clone()
    card = read_task("racer-inner").with_settings(["ppo.n_epochs=1"])
    learner = Learner.fresh(student, list(range(n_seeds)), card.ppo.learning_rate)
    student.storage.copy_(weights)  # who drives whole laps sees some 7,000 images a seed
    for _ in islice(train(card, learner, course_of(card, (), n_seeds)), 2):
        pass
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


QUESTIONS: dict[str, dict[str, Callable[[], float]]] = {
    "training, ms per 1,000 steps": {f"S = {n}": partial(training, n) for n in SEEDS},
    "one seed, 10 environments, ms per 1,000": {
        f"T = {n:,}": partial(training, 1, n, 10) for n in STEPS
    },
    "acting, ms per 1,000 steps": {f"N = {n}": partial(acting, n) for n in ENVS},
    "camera, MB": {f"S = {n}, camera": partial(memory, n) for n in CAMERA_SEEDS},
}
SIDES = {side: measure for rows in QUESTIONS.values() for side, measure in rows.items()}


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield a table per question."""
    for title, sides in QUESTIONS.items():
        first = measured[next(iter(sides))]
        rows = [
            (side, median(measured[side], ".0f"), span(measured[side] / first, ".2f"))
            for side in sides
        ]
        yield Table((title, "", ": first"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
