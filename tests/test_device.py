"""Learning on a device: the graphs' fixed shapes, and that no minibatch asks the host for a value.

The device is torch's "meta", whose tensors have no values: whoever asks for one fails.
"""

import json
import re
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from small_runs import QUICK
from torch.testing import assert_close

from repaint_cli.errors import DeviceError, DivergedError, UsageError
from repaint_cli.learn.rollout.gae import Samples
from repaint_cli.learn.rollout.observations import Observations
from repaint_cli.learn.update import epochs, graphs
from repaint_cli.learn.update.adam import RowAdam
from repaint_cli.learn.update.spec import UpdateSpec
from repaint_cli.learn.update.update import update
from repaint_cli.policies import devices
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.compound import Compound
from repaint_cli.policies.devices import HOST
from repaint_cli.policies.distributions import Categorical, Gaussian
from repaint_cli.policies.image_network import convolve_patches
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.spaces import Spaces
from repaint_cli.settings import PPOConfig

PPO = PPOConfig(minibatch_size=8, n_epochs=3, learning_rate=1e-3, stacked=False)
META = torch.device("meta")
CAMERA = Spaces((24, 32, 1), 4, True), NetConfig(kind="cnn", conv=((4, 4, 2),), dense=16, pool=1)
SHARED = CAMERA[0], CAMERA[1].model_copy(update={"shared": True})
VECTOR = Spaces((3,), 2, False), NetConfig(hidden=(16,))
COMPOUND = (
    Spaces((24, 32, 1), 9, True, sizes=(3, 6), uses=((False,), (True,), (True,))),
    CAMERA[1].model_copy(update={"shared": "all"}),
)
KINDS = pytest.mark.parametrize(
    "kind", [CAMERA, SHARED, VECTOR, COMPOUND], ids=["camera", "shared", "vector", "compound"]
)


def drawn(kind, n_seeds=2, device="cpu"):
    student = ActorCritic(*kind, n_seeds, device)
    if device == "cpu":
        student.initialize(generators(n_seeds))
    return student


def generators(n=2):
    return [np.random.default_rng(s) for s in range(n)]


def samples_of(kind, *counts):
    """Samples of S seeds, drawn at random."""
    spaces, rng, longest = kind[0], np.random.default_rng(5), max(counts)

    def draw(*shape):
        return torch.from_numpy(rng.normal(size=(len(counts), longest, *shape)).astype(np.float32))

    obs = draw(*spaces.obs_shape)
    if spaces.image:
        obs = (obs * 40 + 120).clamp(0, 255).to(torch.uint8)
    numbers = [len(spaces.sizes)] if spaces.sizes else []
    acted = rng.integers(spaces.sizes or spaces.n_actions, size=(len(counts), longest, *numbers))
    return Samples(
        observations=Observations(list(obs)),
        rows=torch.arange(longest).repeat(len(counts), 1),
        actions=torch.from_numpy(acted) if spaces.discrete else draw(2),
        behavior_log_probs=draw() / 5 - 1.4,
        advantages=draw(),
        returns=draw(),
        rewards=draw(),
        counts=torch.tensor(counts),
    )


def teacher_at(kind, samples):
    torch.manual_seed(7)
    numbers = torch.randn(*samples.rows.shape, kind[0].n_actions)
    if sizes := kind[0].sizes:
        return Compound.from_logits(numbers, sizes, torch.tensor([[0.0], [1.0], [1.0]]))
    if kind[0].discrete:
        return Categorical.from_logits(numbers)
    return Gaussian(numbers, torch.zeros(len(numbers), 1, 2))


def specs(kind, samples):
    """What an update may follow."""
    teacher = teacher_at(kind, samples)
    yield UpdateSpec(PPO, 0.2)
    yield UpdateSpec(PPO, 0.2, teacher=teacher, beta=torch.tensor([0.3, 0.0]), policy_scale=0.5)
    yield UpdateSpec(PPO, 0.2, loss="instance", networks="policy")
    yield UpdateSpec(PPO, 0.2, loss="distillation", networks="policy", teacher=teacher)
    penalised = PPO.model_copy(
        update={"objective": "trpo", "kl_weight": 1.0, "weight_decay": 0.1, "max_grad_norm": 0.5}
    )
    yield UpdateSpec(penalised, 0.2)


@KINDS
def test_steps_of_fixed_shapes_are_those_of_the_update_as_written(kind):
    samples = samples_of(kind, 21, 9)
    samples = replace(samples, behavior=teacher_at(kind, samples))
    for spec in specs(kind, samples):
        students, metrics = [], []
        for way in (epochs, graphs):
            student = drawn(kind)
            optimizer = RowAdam(student, PPO.learning_rate)
            metrics.append(way.take_steps(student, optimizer, samples, spec, generators()))
            students.append(student)
        assert_close(students[0].storage, students[1].storage, rtol=1e-4, atol=2e-6)
        assert (students[0].storage != drawn(kind).storage).any()
        assert metrics[0].keys() == metrics[1].keys()
        for name, means in metrics[0].items():
            np.testing.assert_allclose(metrics[1][name], means, rtol=1e-3, atol=1e-5, err_msg=name)


def test_a_policy_stops_at_the_same_epoch():
    samples, kind = samples_of(VECTOR, 21, 9), VECTOR
    ppo = PPO.model_copy(update={"target_kl": 1e-6, "n_epochs": 6})
    ends = []
    for way in (epochs, graphs):
        student = drawn(kind)
        optimizer = RowAdam(student, PPO.learning_rate)
        way.take_steps(student, optimizer, samples, UpdateSpec(ppo, 0.2), generators())
        ends.append((student.storage, optimizer.steps))
    assert torch.equal(ends[0][1], ends[1][1])
    assert ends[0][1][0].max() < ends[0][1][1].max()  # policies stopped, critics went on
    assert_close(ends[0][0], ends[1][0], rtol=1e-4, atol=2e-6)


def test_a_seed_without_samples_takes_no_step():
    samples = samples_of(CAMERA, 9, 9)
    samples = replace(samples, counts=torch.tensor([9, 0]))
    student = drawn(CAMERA)
    before = student.storage.clone()
    spec = UpdateSpec(PPO, 0.2, loss="instance", networks="policy")
    metrics = graphs.take_steps(student, RowAdam(student, 1e-3), samples, spec, generators())
    assert np.isnan(metrics["policy_loss"]).tolist() == [False, True]
    assert torch.equal(student.storage[1], before[1])


def test_a_loss_that_is_not_finite_is_noticed_at_the_end_of_the_epoch():
    samples, student = samples_of(CAMERA, 9, 9), drawn(CAMERA)
    samples.returns[1, 2] = torch.nan
    with pytest.raises(DivergedError, match="a finite value_loss, found nan") as caught:
        graphs.take_steps(
            student, RowAdam(student, 1e-3), samples, UpdateSpec(PPO, 0.2), generators()
        )
    assert caught.value.row == 1


@KINDS
def test_no_step_asks_a_device_for_a_value(kind):
    samples = samples_of(kind, 9, 9)
    samples = replace(samples, behavior=teacher_at(kind, samples))
    for spec in specs(kind, samples):
        student = drawn(kind, device="meta")
        orders = torch.arange(9).repeat(PPO.n_epochs, 1)
        job = graphs.NetworkUpdate(
            0, student.alone(0), RowAdam(student, 1e-3).alone(0),
            samples.to(META).alone(0), spec.to(META).alone(0, 9), orders,
        )  # fmt: skip
        for _ in range(job.n_steps):
            job.step()
        with pytest.raises((NotImplementedError, RuntimeError)):
            job.end_epoch()  # which asks


def test_the_update_as_written_asks_a_device_for_nothing_either(monkeypatch):
    samples, ppo = samples_of(CAMERA, 9, 9), PPO
    student = drawn(CAMERA, device="meta")
    optimizer = RowAdam(student, 1e-3, joint=True)
    steps = []
    step = optimizer.alone(0).step.__func__
    monkeypatch.setattr(RowAdam, "step", lambda *args: (steps.append(1), step(*args)))
    spec = UpdateSpec(ppo, 0.2, instances=samples_of(CAMERA, 5, 5), instance_scale=0.1)
    monkeypatch.setattr(epochs, "side_by_side", lambda jobs: [job() for job in jobs])
    with pytest.raises((NotImplementedError, RuntimeError), match="meta"):
        update(student, optimizer, samples, spec, generators())
    assert len(steps) == 2  # the first policy's epoch, at whose end losses are looked at


def test_a_minibatch_is_no_larger_than_what_there_is():
    samples = samples_of(VECTOR, 21, 9)
    spec, student = UpdateSpec(PPO.model_copy(update={"minibatch_size": 10**9}), 0.2), drawn(VECTOR)
    metrics = graphs.take_steps(student, RowAdam(student, 1e-3), samples, spec, generators())
    assert np.isfinite(metrics["policy_loss"]).all()


def test_nothing_goes_on_behind_an_error(monkeypatch):
    waited, samples, student = [], samples_of(CAMERA, 9, 9), drawn(CAMERA)
    monkeypatch.setattr(graphs.NetworkUpdate, "wait", lambda job: waited.append(job.seed))
    monkeypatch.setattr(graphs, "check", Mock(side_effect=KeyboardInterrupt))
    spec = UpdateSpec(PPO, 0.2)
    with pytest.raises(KeyboardInterrupt):
        graphs.take_steps(student, RowAdam(student, 1e-3), samples, spec, generators())
    assert waited == [0, 0, 1, 1]


def test_a_product_of_no_patches_is_nothing():
    ways = (F.conv2d, convolve_patches)
    weight, bias = torch.rand(6, 3, 8, 8), torch.rand(6)
    shapes = [way(torch.rand(0, 3, 33, 21), weight, bias, 4).shape for way in ways]
    assert shapes[0] == shapes[1]


def test_a_product_of_patches_is_the_convolution():
    images, bias = torch.rand(5, 3, 33, 21), torch.rand(6, requires_grad=True)
    weight = torch.rand(6, 3, 8, 8, requires_grad=True)
    outs = [way(images, weight, bias, 4) for way in (F.conv2d, convolve_patches)]
    assert_close(*outs)
    slope = torch.rand_like(outs[0])
    ours, theirs = (torch.autograd.grad(out, (weight, bias), slope) for out in outs)
    assert_close(ours, theirs)


def test_networks_move_to_a_device_and_back_with_all_that_they_are():
    network = drawn(VECTOR, 2)
    network.normalizer.update(0, torch.randn(50, 3))
    assert network.to("cpu") is network
    network.device = META  # as if it lay elsewhere
    copy, network.device = network.to("cpu"), HOST
    assert copy is not network
    assert torch.equal(copy.storage, network.storage)
    assert torch.equal(copy.normalizer.mean, network.normalizer.mean)
    assert_close(copy.value(torch.ones(2, 4, 3)), network.value(torch.ones(2, 4, 3)))
    copy = network.to("meta")
    assert copy.normalizer.mean.device == META
    assert copy.weights["policy.0.weight"].grad is not None
    distribution = network.policy(torch.zeros(2, 4, 3))
    assert distribution.to(HOST) is distribution
    assert distribution.to(META).mean.device == META


def test_a_gpu_that_is_not_there(repaint, home, monkeypatch):
    monkeypatch.setattr(torch.version, "cuda", None)
    said = repaint("train-teacher", "--task", "reacher", "--device", "cuda")
    assert said.code == DeviceError.exit_code
    assert re.search(
        r"--device cuda: torch \S+ is built for the CPU alone; install .*; or leave it out",
        said.err,
    )
    monkeypatch.setattr(torch.version, "cuda", "13.0")
    why = devices.why_no_gpu()  # of a build for the CPU, or of a machine without a GPU
    assert not why or "torch finds no GPU that works (" in why
    said = repaint(
        "transfer", "--task", "reacher", "--method", "scratch", "--device", "tpu", "--run", "run"
    )
    assert said.code == UsageError.exit_code
    assert "expected --device cpu, cuda or auto, found 'tpu'" in said.err
    assert not (home / "runs").exists()
    assert not (home / "run").exists()


def test_a_run_goes_on_where_it_is_told_to(repaint, lay, home, monkeypatch):
    monkeypatch.setattr(torch.version, "cuda", None)
    lay("train-teacher", "--task", "reacher", *QUICK, "--device", "auto", "--run", "run")
    path = home / "run" / "run.json"
    record = json.loads(path.read_text())
    assert record["device"] == "cpu"
    path.write_text(json.dumps(record | {"device": "cuda"}))
    go_on = ["train-teacher", "--resume", "run", "--iterations", 3]
    said = repaint(*go_on)
    assert said.code == DeviceError.exit_code
    assert "the run learned on cuda so far" in said.err
    assert "--device cpu" in said.err
    said = repaint(*go_on, "--device", "cpu")
    assert said.code == 0
    assert (
        "the run goes on on cpu, where cuda learned before: not bit for bit" in said.err + said.out
    )
    assert json.loads(path.read_text())["device"] == "cpu"
