"""Training steps per second on StarCraft II: repaint, the bound, and what others report.

    python benchmarks/training_starcraft.py

The paper's numbers: two games an iteration, 6 epochs of minibatches of 64, SC2LE's first network,
whose layers policy and critic share. Games last 90 seconds, 180 steps. The bound is what the
arithmetic alone needs, bare convolutions in torch's fastest layout, and then the simulator alone,
all on two cores. The game itself does about 28 steps a second and process, without learning, by
PySC2's documentation; Reaver, another project, logs 512 a second of many games with images of
16 × 16. The first iteration is not counted.
"""

from collections.abc import Iterator
from functools import partial
from time import perf_counter

import numpy as np
import torch
from arithmetic import Network, seconds_of_a_pass
from torch import nn
from turns import Measurements, Table, median, run, span

from repaint_cli.tasks.card_files import read_task

SETTINGS = ["env.minutes=1.5"]
EPOCHS, MINIBATCH, ITERATIONS = 6, 64, 2
SCREEN, CHANNELS, VECTORS, OUTPUTS = 84, (9, 3), 12, 7 + 84 + 84 + 1
GAMES = 2
PYSC2, REAVER = 28.0, 512.0
"""Steps per second that others report."""


def repaint(seeds: int, precision: str) -> float:
    """Train two iterations of so many seeds; return steps per second over all of them."""
    from repaint_cli.learn.evaluation import spaces_of
    from repaint_cli.learn.learner import Learner
    from repaint_cli.learn.ppo import train
    from repaint_cli.learn.transfer.courses import course_of
    from repaint_cli.policies.networks import ActorCritic

    card = read_task("build-marines").with_settings([*SETTINGS, f"net.precision={precision}"])
    student = ActorCritic(spaces_of(card), card.net, seeds)
    learner = Learner.fresh(student, list(range(seeds)), card.ppo.learning_rate)
    iterations = train(card, learner, course_of(card, (), seeds))
    next(iterations)
    before, started = learner.env_steps.sum(), perf_counter()
    for _ in range(ITERATIONS):
        next(iterations)
    return float((learner.env_steps.sum() - before) / (perf_counter() - started))


def bound(precision: str) -> float:
    """Return the steps per second of bare arithmetic and simulation, two seeds side by side."""
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    learn, look = (_seconds(dtype, MINIBATCH, backward) / MINIBATCH for backward in (True, False))
    act = _seconds(dtype, GAMES, backward=False) / GAMES
    return 2 / (EPOCHS * learn + look + act + simulation())


class Layers(nn.Module):
    """SC2LE's first network with a critic's head, bare."""

    def __init__(self, dtype: torch.dtype) -> None:
        super().__init__()
        self.first = nn.ModuleList(nn.Conv2d(n, 16, 8, 4) for n in CHANNELS)
        self.second = nn.ModuleList(nn.Conv2d(16, 32, 4, 2).to(dtype) for _ in CHANNELS)
        self.vector = nn.Linear(VECTORS, 64)
        self.dense = nn.Linear(2 * 9 * 9 * 32 + 64, 256).to(dtype)
        self.heads = nn.Linear(256, OUTPUTS)
        self.dtype = dtype

    def forward(self, images: list[torch.Tensor], vector: torch.Tensor) -> torch.Tensor:
        """Return the outputs of all heads (B, 176)."""
        features = [
            torch.relu(second(torch.relu(first(x)).to(self.dtype))).flatten(1)
            for first, second, x in zip(self.first, self.second, images, strict=True)
        ]
        features.append(torch.tanh(self.vector(vector)).to(self.dtype))
        return self.heads(torch.relu(self.dense(torch.cat(features, 1))).float())


def _seconds(dtype: torch.dtype, batch: int, backward: bool, times: int = 20) -> float:
    """Return the time of a pass over a batch, on one of two cores that both work."""

    def make() -> Network:
        layers = Layers(dtype).to(memory_format=torch.channels_last)
        images = [
            torch.rand(batch, n_in, SCREEN, SCREEN).to(memory_format=torch.channels_last)
            for n_in in CHANNELS
        ]
        vector = torch.rand(batch, VECTORS)
        return layers, lambda: layers(images, vector)

    return seconds_of_a_pass(make, backward=backward, times=times)


def simulation(steps: int = 200) -> float:
    """Return the seconds per step of two games played at random."""
    env = read_task("build-marines").make_env(GAMES)
    actions = [env.action_space.sample() for _ in range(steps)]
    env.reset(seed=0)
    env.step(actions[0])  # compiles
    started = perf_counter()
    for action in actions:
        env.step(action)
    return (perf_counter() - started) / (steps * GAMES)


PRECISIONS = ("float32", "bf16")
SIDES = {
    f"{name}, {precision}": partial(measure, precision)
    for precision in PRECISIONS
    for name, measure in (
        ("repaint, S = 1", partial(repaint, 1)), ("repaint, S = 2", partial(repaint, 2)),
        ("bound", bound),
    )
}  # fmt: skip


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield steps per second beside the bound and what others report."""
    rows = []
    for side, rates in measured.items():
        most = measured[f"bound, {side.rpartition(', ')[2]}"]
        shares = 100 * rates / most
        rows.append((
            side, median(rates, ",.0f"), span(shares, ".0f"), f"{np.median(rates) / PYSC2:.1f}",
            f"{np.median(rates) / REAVER:.2f}",
        ))  # fmt: skip
    yield Table(("training", "steps/s", "% of bound", ": PySC2's 28", ": Reaver's 512"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
