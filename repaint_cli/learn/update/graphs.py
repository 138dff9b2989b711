"""The update on a GPU: each minibatch is one replay of a graph that is recorded once an update.

Same samples, same order, same numbers to rounding as `epochs`, but of fixed shapes: every minibatch
is full, and what pads its last one weighs 0. Small networks are bound by how fast kernels are
launched; a graph launches all of a minibatch at once, and none waits for the GPU. A seed's policy
and critic share nothing, so each has a stream of its own.
"""

import gc
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import fields, replace
from math import isfinite
from typing import Any

import numpy as np
import torch
from torch import Tensor

from repaint_cli.activity import advance, progress
from repaint_cli.errors import DivergedError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.side_by_side import check
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.epochs import at, follow, loss_of, shuffle
from repaint_cli.learn.update.spec import Networks, UpdateSpec
from repaint_cli.policies.distributions import Distribution
from repaint_cli.policies.networks import ActorCritic

WARM_UP = 3
"""Steps before the graph is recorded: libraries choose their kernels and take memory in them."""


def applies_to(student: ActorCritic, spec: UpdateSpec) -> bool:
    """Tell whether a student lies on a GPU, and every minibatch does the same."""
    stops = isfinite(spec.target_kl) and spec.networks == "both" and student.net.shared
    return student.device.type == "cuda" and spec.instances is None and not stops


def take_steps(
    student: ActorCritic,
    optimizer: RowAdam,
    samples: Samples,
    spec: UpdateSpec,
    rngs: Sequence[np.random.Generator],
) -> dict[str, np.ndarray]:
    """Take the gradient steps of an update; see `update.update`.

    Raises:
        DivergedError: a loss is not finite; all steps of that epoch have been taken.
    """
    apart = spec.networks == "both" and not student.net.shared
    parts: list[Networks] = ["policy", "critic"] if apart else [spec.networks]
    jobs = []
    for s, n in enumerate(samples.counts.tolist()):
        own, alone = samples.alone(s), spec.alone(s, n)
        orders = torch.cat([shuffle(own, [rngs[s]]) for _ in range(spec.ppo.n_epochs)])
        for part in parts if n else ():
            networks = student.alone(s), optimizer.alone(s)
            jobs.append(NetworkUpdate(s, *networks, own, replace(alone, networks=part), orders))
    progress(0, sum(job.n_steps for job in jobs), "batches")
    try:
        for _ in range(spec.ppo.n_epochs):
            _take_epoch(jobs)
    finally:  # nothing goes on behind an error
        for job in jobs:
            job.wait()
    return _together(jobs, len(rngs))


def _take_epoch(jobs: "Sequence[NetworkUpdate]") -> None:
    """Take an epoch's steps of all jobs, in turn, and look at them."""
    for j in range(max((job.per_epoch for job in jobs), default=0)):
        for job in jobs:
            if j < job.per_epoch and not job.stopped:
                job.step()
            advance()
        check()
    for job in jobs:
        job.end_epoch()


class NetworkUpdate:
    """The steps of one seed's networks, recorded after the first ones where that is possible."""

    def __init__(
        self,
        seed: int,
        student: ActorCritic,
        optimizer: RowAdam,
        samples: Samples,
        spec: UpdateSpec,
        orders: Tensor,
    ) -> None:
        """Begin before the first step.

        Args:
            seed: its number among the seeds.
            student: it alone, S = 1.
            optimizer: its own.
            samples: its own, without padding, (1, n).
            spec: which of its networks move, and how.
            orders: of the samples in each epoch, (epochs, n).
        """
        self.seed, self.stopped, self.done = seed, False, 0
        self._student, self._optimizer, self._spec, self._read = student, optimizer, spec, 0
        n, device = orders.shape[1], student.device
        size = min(spec.ppo.minibatch_size, n)
        self.per_epoch = -(-n // size)
        reach = torch.arange(self.per_epoch * size).clamp(max=n - 1)
        positions = orders[:, reach].reshape(-1, size)  # (steps, b)
        self.n_steps = len(positions)
        everywhere = positions.reshape(1, -1).to(device)
        self._samples, self._teacher = at(samples, spec, everywhere, samples.counts)
        left = n - size * torch.arange(self.per_epoch)
        counts = left.clamp(max=size).repeat(len(orders), 1)
        self._counts = counts.reshape(-1).to(device)
        self._next = torch.zeros(1, dtype=torch.int64, device=device)
        self._names: list[str] = []
        self._log = torch.empty(0, device=device)  # loss and metrics of each step
        self._graph: Any = None
        self._stream: Any = None
        if device.type == "cuda":
            self._stream = torch.cuda.Stream()  # type: ignore[no-untyped-call]
            self._stream.wait_stream(torch.cuda.current_stream())

    def step(self) -> None:
        """Take the next step; nothing is waited for."""
        with torch.cuda.stream(self._stream) if self._stream else nullcontext():
            if self._graph is None and self._stream and self.done == WARM_UP:
                self._record()
            if self._graph is None:
                self._take_step()
            else:
                self._graph.replay()
        self.done += 1

    def _record(self) -> None:
        """Record a step, which is not taken."""
        self._graph = torch.cuda.CUDAGraph()
        gc.disable()  # what it would free meanwhile ends a recording
        try:
            with torch.cuda.graph(self._graph, stream=self._stream):
                self._take_step()
        finally:
            gc.enable()

    def _take_step(self) -> None:
        """Take the step that `_next` counts, which lies on the device as all that changes."""
        student, spec = self._student, self._spec
        columns = {name: self._part(column) for name, column in self._samples.columns.items()}
        counts = self._counts.index_select(0, self._next)
        batch = replace(self._samples, counts=counts, **columns)
        loss, metrics = loss_of(student, batch, self._part(self._teacher), spec)
        if not self._names:
            self._names = ["loss", *metrics]
            self._log = loss.new_zeros(self.n_steps, len(self._names))
        numbers = torch.stack([loss.detach(), *(part.detach() for part in metrics.values())], 1)
        self._log.index_copy_(0, self._next, numbers)
        moving = torch.ones(1, dtype=torch.bool)
        follow(student, self._optimizer, loss, moving, moving, spec)
        self._next += 1

    def _part(self, column: Any) -> Any:
        """Return the minibatch that `_next` counts, (1, b, …), of a column in order (1, B, …)."""
        if isinstance(column, Distribution):
            tensors = {field.name: getattr(column, field.name) for field in fields(column)}
            parts: Any = {
                name: self._part(tensor) for name, tensor in tensors.items()
                if isinstance(tensor, Tensor) and tensor.shape[:2] == self._samples.rows.shape
            }  # fmt: skip
            return replace(column, **parts)
        if column is None:
            return None
        return column.view(self.n_steps, -1, *column.shape[2:]).index_select(0, self._next)

    def wait(self) -> None:
        """Wait for the steps that were begun."""
        if self._stream:
            self._stream.synchronize()

    def end_epoch(self) -> None:
        """Wait for the epoch's steps, check their losses, and stop a policy that went too far.

        Raises:
            DivergedError: a loss is not finite; it names the first of its parts that is not.
        """
        self.wait()
        epoch, self._read = self.numbers[self._read :], self.done
        diverged = ~np.isfinite(epoch[:, 0])
        if diverged.any():
            first = epoch[diverged.argmax()]
            bad = np.flatnonzero(~np.isfinite(first))  # the loss, and perhaps parts of it
            m = int(bad[:2][-1])
            raise DivergedError.of_loss(self._names[m], float(first[m]), self.seed)
        if self._spec.moves_policy and isfinite(self._spec.target_kl) and len(epoch):
            mean = epoch[:, self._names.index("approx_kl")].mean()
            self.stopped = self.stopped or bool(mean > self._spec.target_kl)

    @property
    def numbers(self) -> np.ndarray:
        """The loss and the metrics of every step that was taken, (steps, M)."""
        return self._log[: self.done].cpu().numpy()

    def metrics(self) -> dict[str, float]:
        """Return the means of the metrics over the steps, by name."""
        means = dict(zip(self._names, self.numbers.mean(0), strict=True))
        of_moved = self._spec.of_moved({n: np.array(mean) for n, mean in means.items()})
        return {name: float(mean) for name, mean in of_moved.items() if name != "loss"}


def _together(jobs: Sequence[NetworkUpdate], n_seeds: int) -> dict[str, np.ndarray]:
    """Return the metrics of all jobs, (S,) each; nan of a seed that took no step."""
    together: dict[str, np.ndarray] = {}
    for job in jobs:
        for name, mean in job.metrics().items():
            own = together.setdefault(name, np.full(n_seeds, np.nan, np.float32))
            own[job.seed] = mean
    return together
