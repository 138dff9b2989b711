"""What `check.py` measures of the learner: agreement with the CPU, repeatability, speed."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import torch

from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.update import epochs, graphs
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.spec import Networks, UpdateSpec
from repaint_cli.policies.devices import make_deterministic
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.policies.weights import load
from repaint_cli.runs.owner import new_run
from repaint_cli.runs.start import plan_teacher
from repaint_cli.settings import PPOConfig
from repaint_cli.tasks.card_files import read_task


class Measured(NamedTuple):
    """A number, and what it may be at most, if anything."""

    what: str
    case: str
    value: float
    unit: str
    limit: float | str = ""


CAMERA = Spaces((120, 160, 1), 5, True)
MINIBATCH = 64


def student_of(n_seeds: int, device: str, pool: int = 2) -> ActorCritic:
    """Return drawn networks of the shape that `racer-inner` has."""
    net = read_task("racer-inner").with_settings([f"net.pool={pool}"]).net
    student = ActorCritic(CAMERA, net, n_seeds, device)
    student.initialize(generators(n_seeds))
    return student


def generators(n: int) -> list[np.random.Generator]:
    """Return a generator for each seed."""
    return [np.random.default_rng(s) for s in range(n)]


def samples_of(n_seeds: int, n: int, last: int | None = None) -> Samples:
    """Return n samples of each seed, drawn at random; the last one's are so many."""
    rng, shape = np.random.default_rng(9), (n_seeds, n)

    def draw(size: float = 1.0, mean: float = 0.0) -> torch.Tensor:
        return torch.from_numpy(rng.normal(mean, size, shape).astype(np.float32))

    images = rng.integers(0, 256, (n, *CAMERA.obs_shape), np.uint8)
    return Samples(
        observations=Observations([torch.from_numpy(images)] * n_seeds),
        rows=torch.arange(n).repeat(n_seeds, 1),
        actions=torch.from_numpy(rng.integers(CAMERA.n_actions, size=shape)),
        behavior_log_probs=draw(0.1, -1.6),
        advantages=draw(), returns=draw(), rewards=draw(),
        counts=torch.tensor([n] * (n_seeds - 1) + [last or n]),
    )  # fmt: skip


def spec_of(n_epochs: int) -> UpdateSpec:
    """Return PPO with the card's learning rate."""
    ppo = read_task("racer-inner").ppo.model_copy(
        update={"n_epochs": n_epochs, "minibatch_size": MINIBATCH}
    )
    assert isinstance(ppo, PPOConfig)
    return UpdateSpec(ppo, 0.2)


def learn(way: Any, student: ActorCritic, samples: Samples, n_epochs: int) -> torch.Tensor:
    """Take an update's steps from empty moments; return the weights on the host."""
    spec = spec_of(n_epochs).to(student.device)
    optimizer = RowAdam(student, spec.ppo.learning_rate)
    own = samples.to(student.device)
    way.take_steps(student, optimizer, own, spec, generators(student.n_seeds))
    return student.storage.detach().cpu()


def agreement() -> Iterator[Measured]:
    """Yield how far an update ends from the CPU's, and whether two are equal bit for bit."""
    samples, first = samples_of(2, 650, 600), student_of(2, "cpu").storage.clone()
    on_cpu = learn(epochs, student_of(2, "cpu"), samples, 1)
    moved = (on_cpu - first).norm()
    for name, way in (("as written", epochs), ("graphs", graphs)):
        ends = [learn(way, student_of(2, "cuda"), samples, 1) for _ in range(2)]
        apart = float((ends[0] - on_cpu).norm() / moved)
        yield Measured("update: distance to the CPU's", name, apart, "of the way", 1e-3)
        off = int((ends[0] != ends[1]).sum())
        yield Measured("update: differs in a second one", name, off, "weights", 0)


def waiting() -> Iterator[Measured]:
    """Yield whether an epoch's steps wait for the GPU nowhere."""
    student, samples, spec = student_of(1, "cuda"), samples_of(1, 640), spec_of(1)
    own = samples.to(student.device)
    orders = torch.arange(640).unsqueeze(0)
    job = graphs.NetworkUpdate(
        0, student, RowAdam(student, 1e-4), own, spec.to(student.device), orders
    )
    job.step()  # libraries begin
    waits = 0.0
    for part in (
        range(1, graphs.WARM_UP),
        [graphs.WARM_UP],
        range(graphs.WARM_UP + 1, job.n_steps),
    ):
        torch.cuda.set_sync_debug_mode("default" if len(part) == 1 else "error")  # it is recorded
        try:
            for _ in part:
                job.step()
        except RuntimeError:
            waits = 1.0
    torch.cuda.set_sync_debug_mode("default")
    yield Measured("update: waits within an epoch", "graphs", waits, "", 0)


def speed(seeds: Sequence[int] = (1, 8), pools: Sequence[int] = (2, 1)) -> Iterator[Measured]:
    """Yield what a minibatch of every seed takes, and how many steps a second that is."""
    for pool in pools:
        for n_seeds in seeds:
            what = f"pool {pool}, {n_seeds} seeds"
            yield from _speed("as written", what, n_seeds, *_written(n_seeds, pool))
            yield from _speed("graphs", what, n_seeds, *_replayed(n_seeds, pool))


def _speed(way: str, what: str, n_seeds: int, seconds: float, n_steps: int) -> Iterator[Measured]:
    """Yield how long a step took of n_steps, and how many environment steps a second that is."""
    n_epochs = read_task("racer-inner").ppo.n_epochs
    rate = MINIBATCH * n_seeds * n_steps / seconds / n_epochs
    what = f"update: {what}"
    yield Measured(what, way, 1000 * seconds / n_steps, "ms a minibatch of every seed")
    yield Measured(what, way, rate, f"environment steps/s at {n_epochs} epochs")


def _written(n_seeds: int, pool: int) -> tuple[float, int]:
    """Return how long the update as written takes, s, and its steps."""
    student, n_steps = student_of(n_seeds, "cuda", pool), 20
    learn(epochs, student, samples_of(n_seeds, 4 * MINIBATCH), 1)  # kernels are chosen
    samples = samples_of(n_seeds, n_steps * MINIBATCH).to(student.device)
    torch.cuda.synchronize()
    began = perf_counter()
    learn(epochs, student, samples, 1)
    torch.cuda.synchronize()
    return perf_counter() - began, n_steps


def _replayed(n_seeds: int, pool: int) -> tuple[float, int]:
    """Return how long replays of the graphs take, s, and how many there were of each."""
    student, n_steps, n = student_of(n_seeds, "cuda", pool), 90, 100 * MINIBATCH
    samples, spec = samples_of(1, n).to(student.device), spec_of(1).to(student.device)
    optimizer, orders = RowAdam(student, spec.ppo.learning_rate), torch.arange(n).unsqueeze(0)
    parts: tuple[Networks, ...] = ("policy", "critic")
    jobs = [
        graphs.NetworkUpdate(
            s, student.alone(s), optimizer.alone(s), samples, replace(spec, networks=part), orders
        )
        for s in range(n_seeds) for part in parts
    ]  # fmt: skip

    def step(times: int) -> None:
        for _ in range(times):
            for job in jobs:
                job.step()
        torch.cuda.synchronize()

    step(graphs.WARM_UP + 2)
    began = perf_counter()
    step(n_steps)
    return perf_counter() - began, n_steps


def end_to_end() -> Iterator[Measured]:
    """Yield whether two trainings are equal, and what learning takes with the cars on the GPU."""
    with TemporaryDirectory() as folder:
        two = ["ppo.n_iterations=2"]
        small = [_trained(Path(folder) / name, two, seeds=[100, 101]) for name in ("a", "b")]
        off = sum(not torch.equal(one, small[1][0][name]) for name, one in small[0][0].items())
        case = "2 seeds, 20 episodes"
        yield Measured("training: differs in a second one", case, off, "tensors", 0)
        yield Measured("training", case, small[0][1], "environment steps/s")
        many = {"n_episodes": None, "n_envs": 4096, "n_steps": 4096 * 64, "n_epochs": 1}
        _, rate = _trained(Path(folder) / "many", two, **many)
        yield Measured("training", "4,096 cars, 64 steps, 1 epoch", rate, "environment steps/s")


def _trained(
    folder: Path, settings: list[str], seeds: Sequence[int] = (100,), **ppo: int | None
) -> tuple[dict[str, torch.Tensor], float]:
    """Return a run's checkpoint, and the environment steps a second of its second iteration."""
    card = read_task("racer-inner").with_settings([*settings, "eval.episodes=2"])
    card = card.model_copy(update={"ppo": card.ppo.model_copy(update=ppo)})
    plan = plan_teacher(card, seeds, f"check-{folder.name}", True, folder, 1, "cuda")
    with new_run(plan) as experiment:
        _, second = experiment.run()
    tensors, _ = load(folder / "checkpoint.safetensors")
    return tensors, float(second.stats.metrics["steps_per_second"][0])


def measurements() -> Iterator[Measured]:
    """Yield all measurements of the learner."""
    make_deterministic("cuda")
    for part in (agreement, waiting, speed, end_to_end):
        yield from part()
