"""What the pieces of an update cost: a gradient step both ways, tanh three ways; cameras' steps.

    python benchmarks/pieces.py

Microseconds. A step is one minibatch of 64 with 27 observations and 8 actions, a policy and a
critic of 64-64 or 256-256 tanh units, within a whole update of one seed. A camera's step, in
milliseconds, is one of a policy of 120 × 160 pixels and 10 actions on one thread, with the paper's
three convolutions at `net.pool` 2 or 1, or with two small ones at 4, in either precision.
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
IMAGE, IMAGES = (120, 160, 1), 512
CAMERA_NETS: dict[str, dict[str, Any]] = {
    "net.pool 2": {"pool": 2},
    "net.pool 1": {"pool": 1},
    "small": {"conv": ((16, 8, 4), (32, 4, 2)), "dense": 128, "pool": 4},
}
PRECISIONS = ("float32", "bf16")


def step(compiled: bool, width: int = 64, own_blas_threads: bool = False) -> float:
    """Return the time of a gradient step, µs."""
    from repaint_cli.learn import side_by_side
    from repaint_cli.policies.architecture import NetConfig
    from repaint_cli.policies.spaces import Spaces
    from repaint_cli.settings import PPOConfig

    draw = partial(torch.randn, generator=torch.manual_seed(0))
    obs, actions = draw(SAMPLES, OBS), draw(1, SAMPLES, ACTIONS)
    spaces, net = Spaces((OBS,), ACTIONS, discrete=False), NetConfig(hidden=(width, width))
    free = Mock(limit=lambda limits: nullcontext())
    with patch.object(side_by_side, "_blas", lambda: free) if own_blas_threads else nullcontext():
        return 1e6 * seconds(spaces, net, obs, actions, PPOConfig(compiled=compiled), "both")


def camera_step(precision: str, net: str) -> float:
    """Return the time of a gradient step of a policy that reads images, ms."""
    from repaint_cli.policies.architecture import NetConfig
    from repaint_cli.policies.spaces import Spaces
    from repaint_cli.settings import PPOConfig

    generator, size = torch.manual_seed(0), (IMAGES, *IMAGE)
    images = torch.randint(256, size, generator=generator, dtype=torch.uint8)
    actions = torch.randint(10, (1, IMAGES), generator=generator)
    config = NetConfig.model_validate({"kind": "cnn", "precision": precision, **CAMERA_NETS[net]})
    spaces, ppo = Spaces(IMAGE, 10, discrete=True), PPOConfig(n_epochs=3)
    return 1e3 * seconds(spaces, config, images, actions, ppo, "policy")


def seconds(
    spaces: Any, net: Any, obs: torch.Tensor, actions: torch.Tensor, ppo: Any, networks: Any
) -> float:
    """Return the time of a gradient step within a second update, s."""
    from repaint_cli.learn.rollout.gae import Samples
    from repaint_cli.learn.rollout.observations import Observations
    from repaint_cli.learn.update.adam import RowAdam
    from repaint_cli.learn.update.spec import UpdateSpec
    from repaint_cli.learn.update.update import update
    from repaint_cli.policies.networks import ActorCritic

    student, n = ActorCritic(spaces, net, 1), len(obs)
    student.initialize([np.random.default_rng(0)])
    optimizer, generator = RowAdam(student, 3e-4), torch.manual_seed(1)
    each = [torch.randn(1, n, generator=generator) for _ in range(4)]
    rows, counts = torch.arange(n).unsqueeze(0), torch.tensor([n])
    samples = Samples(Observations([obs]), rows, actions, *each, counts)
    spec = UpdateSpec(ppo, ppo.clip_range, networks=networks)
    for _ in range(2):  # the first compiles
        started = perf_counter()
        update(student, optimizer, samples, spec, [np.random.default_rng(0)])
        taken = perf_counter() - started
    return taken / (ppo.n_epochs * n / ppo.minibatch_size)


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


PIECES: dict[str, Callable[[], float]] = {
    "a step, autograd": partial(step, False),
    "a step, by hand": partial(step, True),
    "a step of 256 units, autograd": partial(step, False, 256),
    "a step of 256 units, by hand, BLAS with its threads": partial(step, True, 256, True),
    "a step of 256 units, by hand": partial(step, True, 256),
    "tanh of 4,096, torch": partial(tangents, "torch"),
    "tanh of 4,096, numpy": partial(tangents, "numpy"),
    "tanh of 4,096, by hand": partial(tangents, "ours"),
}
SIDES = PIECES | {
    f"{net}, {precision}": partial(camera_step, precision, net)
    for net in CAMERA_NETS for precision in PRECISIONS
}  # fmt: skip


def tables(measured: Measurements) -> Iterator[Table]:
    """Yield every piece beside the one by hand, and cameras' steps in both precisions."""
    rows = []
    for side in PIECES:
        taken, least = measured[side], measured[f"{side.split(', ')[0]}, by hand"]
        rows.append((side, median(taken, ".1f"), span(taken / least, ".1f")))
    yield Table(("piece", "µs", ": by hand"), rows)
    rows = []
    for net in CAMERA_NETS:
        slow, fast = (measured[f"{net}, {precision}"] for precision in PRECISIONS)
        rows.append((net, median(slow, ".2f"), median(fast, ".2f"), span(slow / fast, ".2f")))
    yield Table(("a camera's step, ms", *PRECISIONS, "float32 : bf16"), rows)


if __name__ == "__main__":
    run(__file__, __doc__, SIDES, tables)
