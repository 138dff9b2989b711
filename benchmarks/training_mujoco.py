"""Training steps per second on Reacher and Ant: Stable-Baselines3, repaint, the machine's bound.

    python benchmarks/training_mujoco.py

The paper's numbers everywhere: 2,048 steps an iteration, 10 epochs of minibatches of 64, two
networks of 64-64 tanh units. Training only, no evaluation; the first iteration is not counted.

Stable-Baselines3 is best of 1 and 8 environments; beside it, what one such process a core makes
together, for whoever trains several seeds. It steps Gymnasium's environments one by one, within its
Monitor, and clips gradients; repaint has 40 of EnvPool's (Ant: 2) and keeps
a normaliser of observations. The bound is what the machine cannot beat: bare `mj_step` on all
cores, then the networks' arithmetic at the matrix-product rate of the moment.
"""

import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import islice
from time import perf_counter

import numpy as np
from turns import Measurements, Table, median, run, span

STEPS, EPOCHS, MINIBATCH = 2048, 10, 64
ENV_IDS = {"reacher": "Reacher-v5", "ant": "Ant-v5"}
SEEDS = {"reacher": (1, 5, 20), "ant": (1, 2)}
ITERATIONS = {"reacher": 4, "ant": 2}
SB3 = ("1 env", "8 env", "8 env, a process a core")
PLAIN = ", autograd"


def sb3(task: str, n_envs: int) -> float:
    """Train with Stable-Baselines3's PPO; return steps per second."""
    warnings.simplefilter("ignore")
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env

    env = make_vec_env(ENV_IDS[task], n_envs, seed=0)
    learner = PPO(
        "MlpPolicy", env, n_steps=STEPS // n_envs, batch_size=MINIBATCH, n_epochs=EPOCHS,
        gamma=0.99, gae_lambda=0.95, ent_coef=1e-4, device="cpu", seed=0,
    )  # fmt: skip
    learner.learn(STEPS)
    total = ITERATIONS[task] * STEPS
    started = perf_counter()
    learner.learn(total)
    return total / (perf_counter() - started)


def sb3_on_every_core(task: str) -> float:
    """Train in a process of one thread on every core; return steps per second over all of them."""
    command = [sys.executable, __file__, "--side", f"{task}, sb3, 8 env"]
    alone = os.environ | {"OMP_NUM_THREADS": "1"}
    processes = [
        subprocess.Popen(command, stdout=subprocess.PIPE, env=alone)
        for _ in range(os.cpu_count() or 1)
    ]
    return sum(float(process.communicate()[0]) for process in processes)


def repaint(task: str, n_seeds: int, compiled: bool) -> float:
    """Train with repaint; return steps per second over all seeds."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.tasks.card_files import read_task

    card = read_task(task).with_settings([f"ppo.compiled={str(compiled).lower()}"])
    student = ActorCritic(spaces_of(card), card.net, n_seeds)
    learner = Learner.fresh(student, list(range(n_seeds)), card.ppo.learning_rate)
    iterations = train(card, learner, course_of(card, (), len(learner.seeds)))
    next(iterations)
    started = perf_counter()
    for _ in islice(iterations, ITERATIONS[task]):
        pass
    return n_seeds * ITERATIONS[task] * STEPS / (perf_counter() - started)


def bound(task: str) -> float:
    """Return the steps per second of bare physics and bare arithmetic, one after the other."""
    import gymnasium

    env = gymnasium.make(ENV_IDS[task])
    n_obs, n_actions = env.observation_space.shape[0], env.action_space.shape[0]
    towers = [(n_obs, 64), (64, 64), (64, n_actions)], [(n_obs, 64), (64, 64), (64, 1)]
    products = sum(rows * columns for tower in towers for rows, columns in tower)
    first = 2 * n_obs * 64  # whose input needs no derivative
    # Forward and twice backward in every epoch, forward once to act and to judge: 2 flop a product.
    flop = 2 * (EPOCHS * (3 * products - first) + products)
    return 1 / (1 / physics_rate(ENV_IDS[task]) + flop / matrix_rate())


def physics_rate(env_id: str, seconds: float = 1.0) -> float:
    """Return environment steps per second of bare `mj_step` on all cores, at random torques."""
    import gymnasium
    import mujoco

    cores = os.cpu_count() or 1

    def drive(seed: int) -> int:
        env = gymnasium.make(env_id).unwrapped
        env.reset(seed=seed)
        rng, steps, ends = np.random.default_rng(seed), 0, perf_counter() + seconds
        while perf_counter() < ends:
            if steps % 1000 == 0:
                mujoco.mj_resetData(env.model, env.data)
            env.data.ctrl[:] = rng.uniform(-1, 1, env.model.nu)
            mujoco.mj_step(env.model, env.data, nstep=10 * env.frame_skip)
            steps += 10
        return steps

    with ThreadPoolExecutor(cores) as pool:
        return sum(pool.map(drive, range(cores))) / seconds


def matrix_rate(size: int = 1024, times: int = 20) -> float:
    """Return floating-point operations per second of large matrix products on all cores."""
    import torch

    a = torch.randn(size, size)
    for _ in range(3):
        a @ a
    started = perf_counter()
    for _ in range(times):
        a @ a
    return times * 2 * size**3 / (perf_counter() - started)


def sides_of(task: str) -> dict[str, Callable[[], float]]:
    """Return what measures each side of a task, by name."""
    named: dict[str, Callable[[], float]] = {
        f"{task}, sb3, {n} env": partial(sb3, task, n) for n in (1, 8)
    }
    named[f"{task}, sb3, 8 env, a process a core"] = partial(sb3_on_every_core, task)
    for n in SEEDS[task]:
        for compiled in (False, True):
            name = f"{task}, S = {n}{'' if compiled else PLAIN}"
            named[name] = partial(repaint, task, n, compiled)
    return named | {f"{task}, bound": partial(bound, task)}


SIDES = sides_of("reacher") | sides_of("ant")


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield a table per task."""
    for task in ENV_IDS:
        one, eight, every = (measured[f"{task}, sb3, {n}"] for n in SB3)
        rows = []
        for side, rates in measured.items():
            if side.startswith(task):
                ratios = (span(rates / np.maximum(one, eight), ".2f"), median(rates / every, ".2f"))
                limit = median(rates / measured[f"{task}, bound"], ".0%")
                rows.append((side, median(rates, ",.0f"), *ratios, limit))
        yield Table(("training", "steps/s", ": sb3's best", ": one a core", ": bound"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
