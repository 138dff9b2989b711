"""Training time per environment step on the camera racer: Stable-Baselines3, repaint, the bound.

    python benchmarks/training_racer.py

One car, 120 × 160 pixels, two networks of three convolutions and 512 units each, the paper's 8
epochs of minibatches of 64, at `net.pool` 2 and 1. Both sides drive the same simulator: repaint 20
cars at once for an episode each, Stable-Baselines3 20 of one car, one after the other, through the
Gymnasium interface. The bound is what the arithmetic alone needs, bare convolutions in torch's
fastest layout, each network on a core of its own, and then the simulator alone. In bf16 repaint has
`net.precision=bf16`, and Stable-Baselines3 has convolutions and the layer of 512 under torch's
autocast: its buffers are numpy's, which has no bfloat16. The first iteration is not counted.
"""

import warnings
from collections.abc import Iterator
from functools import partial
from time import perf_counter
from typing import Any

import gymnasium
import numpy as np
import torch
from arithmetic import Network, seconds_of_a_pass
from torch import nn
from turns import Measurements, Table, median, run, span

from repaint_cli.tasks.card_files import read_task

CARS, EPOCHS, MINIBATCH, SB3_STEPS = 20, 8, 64, 1280
POOLS = (2, 1)


class OneCar(gymnasium.Env[np.ndarray, np.int64]):
    """The racer with one car, as Gymnasium's simplest interface has it."""

    def __init__(self) -> None:
        self._cars = read_task("racer-inner").make_env(1, one_episode=True)
        self.observation_space = self._cars.single_observation_space
        self.action_space = self._cars.single_action_space

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[np.ndarray, Any]:
        """Start a new episode."""
        return self._cars.reset(seed=seed)[0][0], {}

    def step(self, action: np.int64) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Drive for a step."""
        obs, rewards, terminated, truncated, _ = self._cars.step(np.array([action]))
        return obs[0], float(rewards[0]), bool(terminated[0]), bool(truncated[0]), {}


def sb3(pool: int, precision: str) -> float:
    """Train with Stable-Baselines3's CnnPolicy and the same networks; return ms per step."""
    warnings.simplefilter("ignore")
    from stable_baselines3 import PPO
    from stable_baselines3.common.env_util import make_vec_env
    from stable_baselines3.common.torch_layers import BaseFeaturesExtractor

    class Eyes(BaseFeaturesExtractor):
        def __init__(self, space: gymnasium.spaces.Box) -> None:
            super().__init__(space, 512)
            smaller = nn.AvgPool2d(pool) if pool > 1 else nn.Identity()
            self.layers = nn.Sequential(smaller, *convolutions(pool))

        def forward(self, images: torch.Tensor) -> torch.Tensor:
            with torch.autocast("cpu", torch.bfloat16, enabled=precision == "bf16"):
                features = self.layers(images)
            return features.float()

    policy = {"features_extractor_class": Eyes, "share_features_extractor": False, "net_arch": []}
    learner = PPO(
        "CnnPolicy", make_vec_env(OneCar, CARS, seed=0), n_steps=SB3_STEPS // CARS,
        batch_size=MINIBATCH, n_epochs=EPOCHS, ent_coef=0.001, gamma=0.999, policy_kwargs=policy,
        device="cpu", seed=0,
    )  # fmt: skip
    learner.learn(SB3_STEPS // 4)
    started = perf_counter()
    learner.learn(SB3_STEPS)
    return 1000 * (perf_counter() - started) / SB3_STEPS


def convolutions(pool: int) -> list[nn.Module]:
    """Return the paper's three convolutions and the dense layer, for a pooled image."""
    height, width = 120 // pool, 160 // pool
    for kernel, stride in ((8, 4), (4, 2), (3, 1)):
        height, width = (height - kernel) // stride + 1, (width - kernel) // stride + 1
    return [
        nn.Conv2d(1, 32, 8, 4), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU(),
        nn.Conv2d(64, 64, 3, 1), nn.ReLU(), nn.Flatten(), nn.Linear(64 * height * width, 512),
        nn.ReLU(),
    ]  # fmt: skip


def repaint(pool: int, precision: str) -> float:
    """Train two iterations with repaint; return ms per step."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.policies.networks import ActorCritic

    settings = [f"net.pool={pool}", f"net.precision={precision}"]
    card = read_task("racer-inner").with_settings(settings)
    learner = Learner.fresh(ActorCritic(spaces_of(card), card.net, 1), [0], 3e-4)
    iterations = train(card, learner, course_of(card, (), len(learner.seeds)))
    next(iterations)
    before, started = learner.env_steps.sum(), perf_counter()
    next(iterations), next(iterations)
    return 1000 * (perf_counter() - started) / (learner.env_steps.sum() - before)


def bound(pool: int, precision: str) -> float:
    """Return the ms per step of bare arithmetic, of both networks, and bare simulation."""
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    learn = _seconds(pool, dtype, backward=True) / MINIBATCH
    look = _seconds(pool, dtype, backward=False) / MINIBATCH
    return 1000 * (EPOCHS * learn + look + simulation())


def _seconds(pool: int, dtype: torch.dtype, *, backward: bool, times: int = 12) -> float:
    """Return the time of a pass over a minibatch of both networks, each on a core of its own."""

    def make() -> Network:
        layers = nn.Sequential(*convolutions(pool), nn.Linear(512, 10))
        layers = layers.to(memory_format=torch.channels_last)
        first, rest = layers[0], layers[1:].to(dtype)  # the first is faster in float32
        images = torch.rand(MINIBATCH, 1, 120 // pool, 160 // pool)
        return layers, lambda: rest(first(images).to(dtype))

    return seconds_of_a_pass(make, backward=backward, times=times)


def simulation(steps: int = 60) -> float:
    """Return the seconds per step of 20 cars driven at random."""
    env = read_task("racer-inner").make_env(CARS)
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    env.step(rng.integers(10, size=CARS))
    started = perf_counter()
    for _ in range(steps):
        env.step(rng.integers(10, size=CARS))
    return (perf_counter() - started) / (steps * CARS)


HOW = {"sb3": sb3, "repaint": repaint, "bound": bound}
PRECISIONS = ("float32", "bf16")
SIDES = {
    f"pool {pool}: {side}, {precision}": partial(measure, pool, precision)
    for pool in POOLS for side, measure in HOW.items() for precision in PRECISIONS
}  # fmt: skip


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield a table per size of the picture: every side beside Stable-Baselines3, and its bound."""
    for pool in POOLS:
        rows, usual = [], measured[f"pool {pool}: sb3, float32"]
        for side, precision in ((side, precision) for side in HOW for precision in PRECISIONS):
            taken, least = (measured[f"pool {pool}: {one}, {precision}"] for one in (side, "bound"))
            ratios = (span(usual / taken, ".2f"), span(taken / least, ".2f"))
            rows.append((f"{side}, {precision}", median(taken, ".2f"), *ratios))
        yield Table((f"net.pool {pool}", "ms per step", "sb3 : it", "it : bound"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
