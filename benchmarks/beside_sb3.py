"""PPO beside Stable-Baselines3's: what a seed earns while it learns, with the same numbers.

    python benchmarks/beside_sb3.py                     # the table of what was measured
    python benchmarks/beside_sb3.py --measure CartPole  # or Pendulum, HalfCheetah: what is missing

The numbers are those of rl-baselines3-zoo, also the first weights, the longest gradient and whether
observations and rewards are normalised; "repaint's defaults" are its own of these: orthogonal
weights, observations are normalised, rewards are not, and gradients stay as long as they are. What
differs by intent: Stable-Baselines3 scales down the gradients of policy and critic by their common
norm, repaint each by its own; it standardises advantages in each minibatch, repaint in the whole
batch; Pendulum is without state-dependent exploration. A seed's area is the mean over its
environment steps of the return of the episode that each belongs to, over all episodes that ended
within the budget; actions are samples. The seeds of each library are other random numbers, so that
nothing is paired.
"""

import argparse
import csv
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from turns import Table, drawn

from repaint_cli.report.statistics import mean_ci

RESULTS = Path(__file__).parent / "results" / "beside-sb3.csv"


@dataclass(frozen=True)
class Numbers:
    """A task and the numbers that both libraries learn it with."""

    env_id: str
    steps: int
    """The budget, environment steps a seed."""
    n_envs: int
    n_steps: int
    """Steps of each environment in a rollout."""
    terms: dict[str, float]
    """The reward as repaint's terms."""
    decay: bool = False
    """Whether learning rate and clip range fall to 0 in a straight line."""
    ppo: dict[str, Any] = field(default_factory=dict)
    """By repaint's names."""
    hidden: tuple[int, ...] = (64, 64)
    activation: str = "tanh"
    log_std_init: float = 0.0
    init: str = "orthogonal"
    """How weights are drawn: uniform is PyTorch's way, `ortho_init=False` in the other library."""
    normalize: bool = False
    """Whether observations and rewards are normalised."""
    max_grad_norm: float = 0.5
    n_seeds: int = 10
    """How many of each library, from 0; more where seeds differ much and cost little."""


VECNORMALIZE = {"obs_clip": 10.0, "obs_min_std": 1e-4}
"""Its defaults where observations are normalised: it divides by √(σ² + 10⁻⁸)."""

TASKS = {
    "CartPole": Numbers(
        "CartPole-v1", 10_000, 8, 32, {"reward": 1.0}, decay=True, n_seeds=50,
        ppo={"minibatch_size": 256, "gae_lambda": 0.8, "gamma": 0.98, "n_epochs": 20,
             "ent_coef": 0.0, "learning_rate": 1e-3, "clip_range": 0.2},
    ),
    "Pendulum": Numbers(
        "Pendulum-v1", 100_000, 4, 1024, {"reward": 1.0},
        ppo={"minibatch_size": 64, "gae_lambda": 0.95, "gamma": 0.9, "n_epochs": 10,
             "ent_coef": 0.0, "learning_rate": 1e-3, "clip_range": 0.2},
    ),
    "HalfCheetah": Numbers(
        "HalfCheetah-v5", 300_000, 1, 512, {"reward": 1.0},
        ppo={"minibatch_size": 64, "gae_lambda": 0.92, "gamma": 0.98, "n_epochs": 20,
             "ent_coef": 0.000401762, "learning_rate": 2.0633e-5, "clip_range": 0.1,
             "vf_coef": 0.58096},
        hidden=(256, 256), activation="relu", log_std_init=-2.0, init="uniform", normalize=True,
        max_grad_norm=0.8,
    ),
}  # fmt: skip


def area(returns: Sequence[float], lengths: Sequence[int]) -> float:
    """Return the mean over the steps of some episodes of the return of the step's episode."""
    return float(np.average(returns, weights=lengths))


def sb3(task: str, seed: int) -> list[float]:
    """Train one seed with Stable-Baselines3; return its area, (1,)."""
    warnings.simplefilter("ignore")
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.vec_env import VecNormalize

    torch.set_num_threads(1)
    numbers = TASKS[task]
    ppo = {_SB3_NAMES.get(name, name): value for name, value in numbers.ppo.items()}
    if numbers.decay:
        for name in ("learning_rate", "clip_range"):
            ppo[name] = _falling(ppo[name])
    env: Any = make_vec_env(numbers.env_id, numbers.n_envs, seed=seed)
    if numbers.normalize:
        env = VecNormalize(env, gamma=numbers.ppo["gamma"])
    policy: dict[str, Any] = {
        "net_arch": list(numbers.hidden), "log_std_init": numbers.log_std_init,
        "activation_fn": {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}[numbers.activation],
        "ortho_init": numbers.init == "orthogonal",
    }  # fmt: skip
    learner = PPO(
        "MlpPolicy", env, n_steps=numbers.n_steps, max_grad_norm=numbers.max_grad_norm,
        policy_kwargs=policy, device="cpu", seed=seed, stats_window_size=10**6, **ppo,
    )  # fmt: skip
    learner.learn(numbers.steps)
    episodes = learner.ep_info_buffer or []
    return [area([one["r"] for one in episodes], [one["l"] for one in episodes])]


_SB3_NAMES = {"minibatch_size": "batch_size"}


def _falling(first: float) -> Callable[[float], float]:
    return lambda left: left * first


def repaint(task: str, seeds: Sequence[int], *, defaults: bool = False) -> list[float]:
    """Train seeds side by side with repaint; return their areas."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.policies.networks import ActorCritic

    card = card_of(TASKS[task], defaults)
    student = ActorCritic(spaces_of(card), card.net, len(seeds))
    learner = Learner.fresh(student, list(seeds), card.ppo.learning_rate)
    episodes: list[list[tuple[float, int]]] = [[] for _ in seeds]
    for stats in train(card, learner, course_of(card, (), len(seeds))):
        assert stats.rollout is not None
        for s, total, length in zip(*stats.rollout.episodes(), strict=True):
            episodes[s].append((total, length))
        if learner.env_steps.min() >= TASKS[task].steps:
            break
    return [area(*zip(*own, strict=True)) for own in episodes]


def card_of(numbers: Numbers, defaults: bool) -> Any:
    """Return the card with these numbers, or with our defaults of normalising and clipping."""
    from repaint_cli.tasks.card import TaskCard

    n_steps = numbers.n_steps * numbers.n_envs
    iterations = -(-numbers.steps // n_steps)
    ppo = numbers.ppo | {
        "n_steps": n_steps, "n_envs": numbers.n_envs, "n_iterations": 2 * iterations,
        "continue_episodes": True,
    }  # fmt: skip
    if numbers.decay:
        ppo |= {"learning_rate_decay": iterations, "clip_decay": iterations}
    data: dict[str, Any] = {
        "name": numbers.env_id, "summary": "Beside Stable-Baselines3.",
        "env": {"simulator": "gymnasium", "id": numbers.env_id, "backend": "gymnasium"},
        "reward": numbers.terms, "ppo": ppo,
        "net": {"hidden": numbers.hidden, "activation": numbers.activation,
                "log_std_init": numbers.log_std_init},
    }  # fmt: skip
    if not defaults:
        data["net"] |= {
            "init": numbers.init, "obs_normalize": numbers.normalize, **VECNORMALIZE
        }  # fmt: skip
        data["ppo"] |= {
            "max_grad_norm": numbers.max_grad_norm, "normalize_rewards": numbers.normalize
        }  # fmt: skip
    return TaskCard.parse(data, "a benchmark")


LIBRARIES = ("sb3", "repaint", "repaint, defaults")


def measure(task: str, processes: int) -> None:
    """Train the seeds that the file lacks, and add each area to it as soon as it is known."""
    known = {(row["library"], int(row["seed"])) for row in read() if row["task"] == task}
    missing = {
        library: [s for s in range(TASKS[task].n_seeds) if (library, s) not in known]
        for library in LIBRARIES
    }
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        jobs: dict[Future[list[float]], tuple[str, list[int]]] = {}
        for library in LIBRARIES[1:]:
            for part in range(processes):
                if seeds := missing[library][part::processes]:
                    learning = pool.submit(repaint, task, seeds, defaults="defaults" in library)
                    jobs[learning] = library, seeds
        for seed in missing["sb3"]:
            jobs[pool.submit(sb3, task, seed)] = "sb3", [seed]
        for job in as_completed(jobs):
            add(task, *jobs[job], job.result())


def add(task: str, library: str, seeds: Sequence[int], areas: Sequence[float]) -> None:
    """Add areas to the file."""
    rows = read() + [
        {"task": task, "library": library, "seed": str(seed), "area": f"{number:.6g}"}
        for seed, number in zip(seeds, areas, strict=True)
    ]
    rows.sort(key=lambda r: (list(TASKS).index(r["task"]), r["library"], int(r["seed"])))
    with RESULTS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, ("task", "library", "seed", "area"), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read() -> list[dict[str, str]]:
    """Return the rows of what was measured."""
    if not RESULTS.is_file():
        return []
    with RESULTS.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def difference(ours: np.ndarray, others: np.ndarray) -> tuple[float, float, float]:
    """Return how much more the mean of one is, % of the other's size, and its 95 % interval.

    Both sides are resampled by themselves: percentile bootstrap.
    """
    rng = np.random.default_rng(0)
    means = [rng.choice(side, (10_000, len(side))).mean(1) for side in (ours, others)]
    size = 100 / abs(others.mean())
    low, high = np.quantile(size * (means[0] - means[1]), (0.025, 0.975))
    return float(size * (ours.mean() - others.mean())), float(low), float(high)


def table() -> Table:
    """Return each task's areas, a row per library."""
    rows = []
    for task, numbers in TASKS.items():
        areas = {
            library: np.array(
                [float(r["area"]) for r in read() if (r["task"], r["library"]) == (task, library)]
            )
            for library in LIBRARIES
        }
        for library, own in areas.items():
            if len(own):
                area = "{:.1f} [{:.1f}, {:.1f}]".format(*mean_ci(own))
                gap = "{:+.0f} % [{:+.0f}, {:+.0f}]".format(*difference(own, areas["sb3"]))
                gap = "" if library == "sb3" else gap
                rows.append((task, f"{numbers.steps:,}", str(len(own)), library, area, gap))
    return Table(("task", "steps", "seeds", "library", "area [95 %]", "− sb3"), rows)


def main() -> None:
    """Measure a task, or print what was measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--measure", choices=TASKS, help="train the seeds of this task that are not measured yet"
    )
    parser.add_argument("--processes", type=int, default=2, help="how many train at once")
    chosen = parser.parse_args()
    if chosen.measure:
        measure(chosen.measure, chosen.processes)
    Console().print(drawn(table()))
    print("mean area of all seeds [95 % interval]")


if __name__ == "__main__":
    main()
