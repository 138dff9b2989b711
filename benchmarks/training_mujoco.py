"""Training steps per second on Reacher and Ant: Stable-Baselines3, repaint, the machine's bound.

    python benchmarks/training_mujoco.py

The paper's numbers everywhere: 2,048 steps an iteration, 10 epochs of minibatches of 64, two
networks of 64-64 tanh units. Training only, no evaluation; the first iteration is not counted.
Stable-Baselines3 does without the normaliser of observations that repaint has, which is to its
advantage, and is best of 1 and 8 environments. The bound is what the machine cannot beat: bare
`mj_step` on all cores, then the networks' arithmetic at the matrix-product rate of the moment.
"""

import warnings
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import islice
from os import cpu_count
from time import perf_counter

import numpy as np
from turns import answer, arguments, in_turns, median, show, span

STEPS, EPOCHS, MINIBATCH = 2048, 10, 64
ENV_IDS = {"reacher": "Reacher-v5", "ant": "Ant-v5"}
SEEDS = {"reacher": (1, 5, 20), "ant": (1, 2, 8)}
ITERATIONS = {"reacher": 4, "ant": 2}
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


def repaint(task: str, n_seeds: int, compiled: bool) -> float:
    """Train with repaint; return steps per second over all seeds."""
    from repaint_cli.cards import read_task
    from repaint_cli.evaluate import spaces_of
    from repaint_cli.learn.trainer import Learner, train
    from repaint_cli.nets import ActorCritic

    card = read_task("reacher").with_settings([f"ppo.compiled={str(compiled).lower()}"])
    if task == "ant":
        terms = ("reward_forward", "reward_survive", "reward_ctrl", "reward_contact")
        settings = ["env.id=Ant-v5", "env.backend=envpool", "ppo.n_envs=2"]
        card = card.with_settings(settings).model_copy(update={"reward": dict.fromkeys(terms, 1.0)})
    student = ActorCritic(spaces_of(card), card.net, n_seeds)
    learner = Learner.fresh(student, list(range(n_seeds)), card.ppo.learning_rate)
    iterations = train(card, learner, None)
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
    # Forward and twice backward in every epoch, forward to act and to judge: 2 flop a product.
    flop = 2 * products * (3 * EPOCHS + 2)
    return 1 / (1 / physics_rate(ENV_IDS[task]) + flop / matrix_rate())


def physics_rate(env_id: str, seconds: float = 1.0) -> float:
    """Return environment steps per second of bare `mj_step` on all cores, at random torques."""
    import gymnasium
    import mujoco

    cores = cpu_count() or 1

    def drive(seed: int) -> int:
        env = gymnasium.make(env_id).unwrapped
        env.reset(seed=seed)
        rng, steps, ends = np.random.default_rng(seed), 0, perf_counter() + seconds
        while perf_counter() < ends:
            if steps % 50 == 0:
                env.reset()
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


def sides(task: str) -> dict[str, "partial[float]"]:
    """Return what measures each side of a task, by name."""
    named = {f"{task}, sb3, {n} env": partial(sb3, task, n) for n in (1, 8)}
    for n in SEEDS[task]:
        for compiled in (False, True):
            name = f"{task}, S = {n}{'' if compiled else PLAIN}"
            named[name] = partial(repaint, task, n, compiled)
    return named | {f"{task}, bound": partial(bound, task)}


def main() -> None:
    """Measure both tasks and print a table each."""
    chosen = arguments(__doc__)
    if chosen.side:
        return answer(chosen.side, {**sides("reacher"), **sides("ant")})
    for task in ENV_IDS:
        found = in_turns(__file__, sides(task), chosen)
        best = np.maximum(found[f"{task}, sb3, 1 env"], found[f"{task}, sb3, 8 env"])
        limit = found[f"{task}, bound"]
        rows = [
            (side, median(rates, ",.0f"), span(rates / best, ".2f"), median(rates / limit, ".0%"))
            for side, rates in found.items()
        ]
        columns = ("training", "steps/s", ": sb3's best", ": bound")
        show(
            columns,
            rows,
            f"{chosen.rounds} rounds of {ITERATIONS[task]} iterations: median [range]",
        )


if __name__ == "__main__":
    main()
