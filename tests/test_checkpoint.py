"""Weights in and out: strict, to the bit, and a learner that goes on as if nothing had happened."""

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from small_learners import course_for, learner_of, teachers_of, untrained_teacher, with_transfer
from small_tasks import guess, reach

from repaint_cli.errors import CheckpointError
from repaint_cli.files.headers import KEY
from repaint_cli.learn.ppo import train
from repaint_cli.learn.transfer.courses import Measured, Scheduled
from repaint_cli.learn.transfer.measurements import Measurements
from repaint_cli.learn.transfer.teachers import Teacher
from repaint_cli.policies.weights import load, load_policy, policy_tensors, save
from repaint_cli.runs.checkpoint import load_learner, load_networks, save_learner
from repaint_cli.tasks.transfer_settings import TransferConfig

TASKS = pytest.mark.parametrize("make", [reach, guess])


def copies(student):
    return {name: leaf.detach().clone() for name, leaf in policy_tensors(student).items()}


def equal(one, other):
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


@TASKS
def test_a_learner_saved_half_way_goes_on_bit_for_bit(tmp_path, make):
    select = {"scale": "student-batch", "threshold": 0.0}  # needs the student's last batch

    def begun():
        learner = learner_of(make(), [3, 5])
        task = with_transfer(make(select=select), TransferConfig())
        return learner, course_for(task, learner, teachers_of(untrained_teacher(task, 2)))

    def run(learner, course, n_iterations):
        task = make(n_iterations=n_iterations, select=select)
        list(train(with_transfer(task, TransferConfig()), learner, course))
        return learner, course

    straight, _ = run(*begun(), 4)
    save_learner(tmp_path / "half", *run(*begun(), 2), {})
    resumed, course = begun()
    load_learner(tmp_path / "half", resumed, course)
    assert resumed.iteration == 2
    run(resumed, course, 4)
    assert equal(copies(straight.student), copies(resumed.student))
    assert equal(straight.optimizer.state(), resumed.optimizer.state())
    assert straight.env_steps.tolist() == resumed.env_steps.tolist()


def test_what_relevance_and_automatic_transfer_go_by_is_kept(tmp_path):
    def task_of(n_iterations):
        task = reach(n_iterations=n_iterations, select={"rule": "rbt", "share": 0.5})
        return with_transfer(task, TransferConfig())

    def begun(kind, *more):
        task, learner = task_of(4), learner_of(reach(), [3, 5])
        teacher = Teacher(untrained_teacher(task, 2), weights=np.array([1.0, 0.5]))
        return learner, kind(task, [teacher], 2, *more)

    def measurements(earned):
        return Measurements(np.zeros((2, 2)), [np.full((2, 2), earned)])

    def run(learner, course, n_iterations):
        list(train(task_of(n_iterations), learner, course))
        return learner, course

    straight, _ = run(*begun(Scheduled), 4)
    learner, half = run(*begun(Scheduled), 3)  # an instance iteration comes next
    _, measured = begun(Measured, measurements(1.0))
    measured.last = half.last
    save_learner(tmp_path / "half", learner, measured, {})
    _, other = begun(Measured, measurements(2.0))
    resumed, course = begun(Scheduled)
    load_learner(tmp_path / "half", resumed, other)
    assert equal(other.measurements.state(), measured.measurements.state())
    load_learner(tmp_path / "half", resumed, course)
    run(resumed, course, 4)
    assert equal(copies(straight.student), copies(resumed.student))


def test_a_part_of_another_shape_is_refused(tmp_path):
    learner, task = learner_of(reach(), [0]), with_transfer(reach(), TransferConfig())
    course = course_for(task, learner, teachers_of(untrained_teacher(task, 2)))
    save_learner(tmp_path / "it", learner, course, {})
    tensors, notes = load(tmp_path / "it")
    save(tmp_path / "it", tensors | {"after_instance": torch.zeros(2)}, notes)
    with pytest.raises(CheckpointError, match="lacks a part or has a wrong one"):
        load_learner(tmp_path / "it", learner, course)


@TASKS
def test_networks_alone_can_be_read_from_a_learner(tmp_path, make):
    learner, other = learner_of(make(), [0, 1]), learner_of(make(), [7, 8])
    save_learner(tmp_path / "file", learner, course_for(make(), learner), {})
    load_networks(tmp_path / "file", other.student)
    assert equal(copies(learner.student), copies(other.student))


def test_one_seeds_leaves_go_into_every_seed():
    one, three = learner_of(reach(), [4]).student, learner_of(reach(), [0, 1, 2]).student
    load_policy(three, policy_tensors(one, 0), "a test")
    for name, leaf in policy_tensors(three).items():
        assert all(torch.equal(leaf[s], policy_tensors(one)[name][0]) for s in range(3))


def test_other_seeds_are_refused(tmp_path):
    learner, other = learner_of(reach(), [0, 1]), learner_of(reach(), [0, 2])
    course = course_for(reach(), learner)
    save_learner(tmp_path / "file", learner, course, {})
    with pytest.raises(CheckpointError, match=r"holds seeds \[0, 1\], wanted \[0, 2\]"):
        load_learner(tmp_path / "file", other, course)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t: t.pop("policy.0.bias"), "leaf 'policy.0.bias' is missing in the file"),
        (lambda t: t.update(extra=torch.zeros(1)), "leaf 'extra' is unknown to the network"),
        (
            lambda t: t.update({"value.0.weight": torch.zeros(2, 8)}),
            r"leaf 'value.0.weight' is \(2, 8\) float32 in the file, \(2, 16\) float32 in the",
        ),
        (
            lambda t: t.update({"value.0.bias": torch.zeros(16).double()}),
            r"'value.0.bias' is \(16,\) float64 in the file, \(16,\) float32 in the network",
        ),
    ],
)
def test_leaves_that_do_not_fit_are_named_and_nothing_is_loaded(spoil, message):
    student, leaves = (
        learner_of(reach(), [0]).student,
        policy_tensors(untrained_teacher(reach()), 0),
    )
    before = copies(student)
    spoil(leaves)
    with pytest.raises(CheckpointError, match=f"a test: .*{message}"):
        load_policy(student, leaves, "a test")
    assert equal(before, copies(student))


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
def test_numbers_that_are_not_finite_are_refused(tmp_path, number):
    save(tmp_path / "file", {"fine": torch.zeros(3), "ill": torch.tensor([0, number])}, {})
    with pytest.raises(CheckpointError, match="leaf 'ill' holds numbers that are not finite"):
        load(tmp_path / "file")


def test_what_is_saved_is_safetensors_and_its_header_json(tmp_path):
    save(tmp_path / "file", {"x": torch.arange(3.0)}, {"a": [1, None, "ζ"]})
    with safe_open(tmp_path / "file", framework="pt") as file:
        assert set(file.metadata()) == {KEY}
    tensors, header = load(tmp_path / "file")
    assert header == {"a": [1, None, "ζ"]}
    assert equal(tensors, {"x": torch.arange(3.0)})


def test_a_foreign_file_is_refused(tmp_path):
    save_file({"x": torch.zeros(3)}, tmp_path / "file")
    with pytest.raises(CheckpointError, match="was not written by repaint"):
        load(tmp_path / "file")
