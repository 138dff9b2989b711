"""What the pieces of an update cost: a gradient step both ways, tanh three ways.

    python benchmarks/pieces.py

Microseconds. A step is one minibatch of 64 with 27 observations and 8 actions, a policy and a
critic of 64-64 or 256-256 tanh units, within a whole update of one seed.
"""

from collections.abc import Callable, Iterator
from contextlib import nullcontext
from functools import partial
from time import perf_counter
from typing import Any
from unittest.mock import Mock, patch

import numpy as np
import torch
from turns import Measurements, Table, median, run, span

from repaint_cli.kernels import fastmath_kernel
from repaint_cli.learn.update.compiled.kernels import tanh

OBS, ACTIONS, SAMPLES, NUMBERS = 27, 8, 2048, 4096


def step(compiled: bool, width: int = 64, own_blas_threads: bool = False) -> float:
    """Return the time of a gradient step."""
    from repaint_cli.learn import side_by_side
    from repaint_cli.learn.rollout.gae import Samples
    from repaint_cli.learn.rollout.observations import Observations
    from repaint_cli.learn.update.adam import RowAdam
    from repaint_cli.learn.update.spec import UpdateSpec
    from repaint_cli.learn.update.update import update
    from repaint_cli.policies.architecture import NetConfig
    from repaint_cli.policies.networks import ActorCritic
    from repaint_cli.policies.spaces import Spaces
    from repaint_cli.settings import PPOConfig

    student = ActorCritic(
        Spaces((OBS,), ACTIONS, discrete=False), NetConfig(hidden=(width, width)), 1
    )
    student.initialize([np.random.default_rng(0)])
    optimizer, draw = RowAdam(student, 3e-4), partial(torch.randn, generator=torch.manual_seed(0))
    each = [draw(1, SAMPLES) for _ in range(4)]
    samples = Samples(
        Observations([draw(SAMPLES, OBS)]), torch.arange(SAMPLES).unsqueeze(0),
        draw(1, SAMPLES, ACTIONS), *each, torch.tensor([SAMPLES]),
    )  # fmt: skip
    ppo = PPOConfig(compiled=compiled)
    spec = UpdateSpec(ppo, ppo.clip_range)
    free = Mock(limit=lambda limits: nullcontext())
    with patch.object(side_by_side, "_blas", lambda: free) if own_blas_threads else nullcontext():
        for _ in range(2):  # the first compiles
            started = perf_counter()
            update(student, optimizer, samples, spec, [np.random.default_rng(0)])
            taken = perf_counter() - started
    return 1e6 * taken / (ppo.n_epochs * SAMPLES / ppo.minibatch_size)


@fastmath_kernel
def fill(x: np.ndarray, y: np.ndarray) -> None:
    """Put the hyperbolic tangents of x into y, (n,) each."""
    for i in range(len(x)):
        y[i] = tanh(x[i])


def tangents(how: str, times: int = 2000) -> float:
    """Return the time of the hyperbolic tangents of a layer's 4,096 numbers."""
    x = np.random.default_rng(0).normal(0, 2, NUMBERS).astype(np.float32)
    y, tensor = np.empty_like(x), torch.from_numpy(x)
    torch.set_num_threads(1)
    calls: dict[str, Callable[[], Any]] = {
        "torch": lambda: torch.tanh(tensor),
        "numpy": lambda: np.tanh(x, out=y),
        "ours": lambda: fill(x, y),
    }
    calls[how]()
    started = perf_counter()
    for _ in range(times):
        calls[how]()
    return 1e6 * (perf_counter() - started) / times


SIDES: dict[str, Callable[[], float]] = {
    "a step, autograd": partial(step, False),
    "a step, by hand": partial(step, True),
    "a step of 256 units, autograd": partial(step, False, 256),
    "a step of 256 units, by hand, BLAS with its threads": partial(step, True, 256, True),
    "a step of 256 units, by hand": partial(step, True, 256),
    "tanh of 4,096, torch": partial(tangents, "torch"),
    "tanh of 4,096, numpy": partial(tangents, "numpy"),
    "tanh of 4,096, by hand": partial(tangents, "ours"),
}


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield every side beside the one by hand."""
    rows = []
    for side, taken in measured.items():
        least = measured[f"{side.split(', ')[0]}, by hand"]
        rows.append((side, median(taken, ".1f"), span(taken / least, ".1f")))
    yield Table(("piece", "µs", ": by hand"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
