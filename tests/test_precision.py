"""Networks that read images in bfloat16: near float32, the same every time, kept by a run."""

import json

import numpy as np
import pytest
import torch
import torch.nn.functional as F  # noqa: N812
from small_learners import learner_of, spec_of, training
from small_runs import QUICK_LAP, weights_of
from small_tasks import guess

from repaint_cli.engines.train_methods import plan_methods
from repaint_cli.errors import CardError
from repaint_cli.learn.rollout.gae import to_samples
from repaint_cli.learn.update.objectives import representation_loss
from repaint_cli.policies import precision
from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.images import brightness
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.policies.precision import resolved, slowness_warnings
from repaint_cli.policies.spaces import Spaces
from repaint_cli.runs.start import plan_teacher, plan_transfer
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo.store import read_teacher

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

PICTURE = Spaces((60, 80, 1), 5, discrete=True)
CNN = NetConfig(kind="cnn", pool=1, conv=((8, 8, 4), (16, 4, 2)), dense=64)
ROUNDING = 2.0**-9
"""How far a number at most moves, relative to its size, when it is rounded to bfloat16."""


@pytest.fixture
def cpu(monkeypatch):
    """Have the CPU instructions for bfloat16, or none."""
    return lambda has: monkeypatch.setattr(precision, "is_native", lambda: has)


def network(in_precision="float32", n_seeds=1):
    student = ActorCritic(PICTURE, CNN, n_seeds).in_precision(in_precision)
    student.initialize([np.random.default_rng(seed) for seed in range(n_seeds)])
    return student


def pictures(n, n_seeds=1):
    drawn = np.random.default_rng(0).integers(0, 256, (n_seeds, n, *PICTURE.obs_shape), np.uint8)
    return torch.from_numpy(drawn)


def in_bf16(task):
    return task.with_settings(["net.precision=bf16"])


def test_float32_is_computed_as_it_is_written():
    student, obs = network(), pictures(7)
    parameters = {name: weight.detach()[0] for name, weight in student.weights.items()}
    x = brightness(obs[0], 1)
    for layer, stride in (("conv0", 4), ("conv1", 2)):
        weight, bias = (parameters[f"value.{layer}.{part}"] for part in ("weight", "bias"))
        x = torch.relu(F.conv2d(x, weight, bias, stride))
    x = x.flatten(1)
    for layer in ("dense", "head"):
        weight, bias = (parameters[f"value.{layer}.{part}"] for part in ("weight", "bias"))
        x = torch.addmm(bias, x if layer == "dense" else torch.relu(x), weight)
    with torch.no_grad():
        assert torch.equal(student.value(obs)[0], x[:, 0])


def test_the_arithmetic_is_bfloat16s_and_what_goes_in_and_comes_out_is_not():
    exact, rounded, obs = network(), network("bf16"), pictures(7)
    assert rounded.storage.dtype == rounded.gradients.dtype == torch.float32
    values, others = exact.value(obs), rounded.value(obs)
    assert others.dtype == torch.float32
    assert not torch.equal(values, others)
    policy = rounded.policy(obs)
    assert policy.log_probs.dtype == torch.float32
    np.testing.assert_allclose(policy.log_probs.exp().sum(-1).detach(), 1, atol=1e-6)
    back = rounded.in_precision("float32")
    assert torch.equal(back.value(obs), values)
    back.storage.fill_(0.0)  # in the same memory
    assert not rounded.value(obs).any()


@pytest.mark.parametrize("networks", ["policy", "critic"])
def test_loss_and_gradient_are_float32s_but_for_rounding(networks):
    """Results of the first convolution, weights and results of the second and of the dense layer
    are rounded, forwards and backwards: at most 16 roundings lie on a path, independent of each
    other, so that their relative errors add up to √16 of one; twice that is allowed.
    """
    task = guess(image=True, n_episodes=8)
    learner = learner_of(task, [3])
    (rollout,) = [learner.collect(task, 1)]
    samples = to_samples(rollout, learner.student.value, task.ppo)
    spec, losses, gradients = spec_of(task.ppo, networks=networks), [], []
    for name in ("float32", "bf16"):
        student = learner.student.in_precision(name)
        student.gradients.zero_()
        loss, _ = representation_loss(student, samples, None, spec)
        loss.sum().backward()
        losses.append(loss.item())
        gradients.append(student.gradients.clone().double())
    apart = (gradients[1] - gradients[0]).norm() / gradients[0].norm()
    assert 0 < apart < 8 * ROUNDING
    assert losses[1] == pytest.approx(losses[0], rel=8 * ROUNDING, abs=1e-3)


def test_a_policy_learns_by_the_probabilities_with_which_it_acted():
    """Minibatches are of other sizes than the batches in which cars act, so sums may be added in
    another order: the first ratio π/μ is 1 but for the rounding of what the dense layer puts out.
    """
    task = in_bf16(read_task("racer-inner")).with_settings(
        ["ppo.n_episodes=4", "env.max_steps=40", "net.conv=[[8,8,4],[16,4,2]]", "net.dense=64"]
    )
    learner = learner_of(task, [0])
    learner.student.weights["policy.head.weight"].data.mul_(100)  # as of a policy that has learned
    rollout = learner.collect(task, 1)
    samples = to_samples(rollout, learner.student.value, task.ppo)
    policy = learner.student.policy(samples.observations.take(samples.rows))
    ratios = (policy.log_prob(samples.actions).detach() - samples.behavior_log_probs).exp()
    assert (ratios - 1).abs().max() < 0.1 * task.ppo.clip_range
    exact = learner.student.in_precision("float32")
    with torch.no_grad():
        other = exact.policy(samples.observations.take(samples.rows)).log_prob(samples.actions)
    assert (other - samples.behavior_log_probs).abs().mean() > (ratios.log()).abs().mean()


def test_the_same_seeds_learn_the_same_bits_alone_and_beside_others():
    def learned(seeds):
        learner = learner_of(in_bf16(guess(image=True)), seeds)
        list(training(in_bf16(guess(image=True)), learner))
        return learner.student.storage

    both = learned((1, 2))
    assert torch.equal(both, learned((1, 2)))
    assert torch.equal(both[1:], learned((2,)))


@pytest.mark.parametrize(
    ("kind", "wanted", "native", "meant"),
    [
        ("cnn", "auto", True, "bf16"),
        ("cnn", "auto", False, "float32"),
        ("mlp", "auto", True, "float32"),
        ("cnn", "bf16", False, "bf16"),
        ("cnn", "float32", True, "float32"),
    ],
)
def test_auto_is_bf16_where_the_cpu_has_it_and_images_are_read(cpu, kind, wanted, native, meant):
    cpu(native)
    assert resolved(NetConfig(kind=kind, precision=wanted)).precision == meant


@pytest.mark.parametrize("flags", [(), ("avx512_bf16",), ("amx_tile",), None])
def test_a_cpu_is_asked_for_its_instructions(monkeypatch, flags):
    for name in ("avx512_bf16", "amx_tile"):
        function = f"_is_{name}_supported"
        if flags is None:  # an earlier torch
            monkeypatch.delattr(torch.cpu, function, raising=False)
        else:
            answer = name in flags
            monkeypatch.setattr(torch.cpu, function, lambda answer=answer: answer, raising=False)
    assert precision.is_native() == bool(flags)


@pytest.mark.parametrize(
    ("task", "value", "message"),
    [
        ("racer-inner", "fp16", r"net\.precision: expected 'float32', 'bf16' or 'auto', found 'fp"),
        (
            "reacher",
            "bf16",
            r"net\.precision: expected float32 or auto where net\.kind is mlp, fou",
        ),
    ],
)
def test_another_precision_is_refused(task, value, message):
    with pytest.raises(CardError, match=message):
        read_task(task).with_settings([f"net.precision={value}"])


LAP = ["--task", "racer-inner", *QUICK_LAP]


def recorded(folder):
    return json.loads((folder / "run.json").read_text())["task"]["net"]["precision"]


def test_a_run_decides_once_and_goes_on_as_it_began_on_any_cpu(repaint, home, cpu):
    cpu(True)
    auto = ["--method", "scratch", "--set", "net.precision=auto"]
    assert repaint("transfer", *LAP, *auto, "--run", "whole").code == 0
    assert repaint("transfer", *LAP, *auto, "--run", "half", "--iterations", 1).code == 0
    assert recorded(home / "whole") == recorded(home / "half") == "bf16"
    cpu(False)
    said = repaint("transfer", "--resume", "half", "--iterations", 2)
    assert said.code == 0
    line = "the networks compute in bf16, which this CPU has no instructions for: that works, but "
    assert f"warning: {line}is slow; the run keeps it as it began\n" in said.out
    assert recorded(home / "half") == "bf16"
    one, other = (weights_of(home / name / "seed-0.safetensors") for name in ("whole", "half"))
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_what_a_run_begins_with_is_decided_by_the_cpu_that_plans_it(home, cpu):
    card = read_task("racer-inner").with_settings(["net.precision=auto"])
    for native, meant in ((True, "bf16"), (False, "float32")):
        cpu(native)
        plans = [
            plan_teacher(card, [0], None, False, None, 1),
            plan_transfer(card, [], [0], "scratch", "ppo", [], None, 1),
            *plan_methods(card, ["scratch"], [], [0], 1),
        ]
        assert {plan.task.net.precision for plan in plans} == {meant}


def test_networks_that_compute_slowly_are_named(cpu):
    fast, slow = (NetConfig(kind="cnn", precision=name) for name in ("float32", "bf16"))
    cpu(True)
    assert slowness_warnings(slow, {"a": slow}, begun=False) == []
    cpu(False)
    assert slowness_warnings(fast, {"a": fast}, begun=False) == []
    (own,) = slowness_warnings(slow, {"a": fast}, begun=False)
    assert own.endswith("is slow; try --set net.precision=float32")
    (taught,) = slowness_warnings(fast, {"a": slow, "b": fast}, begun=True)
    assert taught.startswith("the networks of a compute in bf16, which this CPU has no instr")


def test_a_teacher_says_how_it_was_trained_and_an_evaluation_how_it_plays(repaint, home, cpu):
    cpu(True)
    repaint("train-teacher", *LAP, "--set", "net.precision=auto", "--name", "rounded")
    path = home / "home" / "zoo" / "rounded.safetensors"
    student, card = read_teacher(path)
    assert card.task.net.precision == student.net.precision == "bf16"
    assert (
        "policy     cnn with convolutions of its own in bf16; " in repaint("zoo", "show", path).out
    )
    played = repaint("eval", "rounded", "--episodes", 2)
    assert "played in bf16 (net.precision)\n" in played.out
    (folder,) = (home / "runs" / "racer-inner").glob("eval-rounded-*")
    assert json.loads((folder / "eval.json").read_text())["precision"] == "bf16"
    exact = repaint("eval", "rounded", "--episodes", 2, "--set", "net.precision=float32")
    assert (exact.code, "played in" in exact.out) == (0, False)
