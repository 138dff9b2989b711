"""Jobs side by side: on all cores, in order, with one thread of torch each, ended by Ctrl-C."""

import os
from functools import partial
from threading import Barrier, Event, current_thread

import numpy as np
import pytest
import torch

from repaint_cli import activity
from repaint_cli.errors import DivergedError
from repaint_cli.learn.evaluation import spaces_of
from repaint_cli.learn.learner import Learner
from repaint_cli.learn.ppo import train
from repaint_cli.learn.side_by_side import check, one_thread, side_by_side
from repaint_cli.learn.transfer.courses import course_of
from repaint_cli.learn.update.epochs import seed_by_seed
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.tasks.card_files import read_task
from repaint_cli.threads import blas, cores


@pytest.mark.parametrize("text", ["", "0", "many", "-1"])
def test_all_cores_work_unless_a_number_is_set(monkeypatch, text):
    monkeypatch.setenv("OMP_NUM_THREADS", text)
    assert cores() == len(os.sched_getaffinity(0))
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert cores() == 3


def test_one_thread_is_one_of_torch_and_one_of_blas():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with blas().limit(limits=2):
            with one_thread():
                assert torch.get_num_threads() == 1
                assert blas_threads() == {1}
            assert torch.get_num_threads() == 2
            assert blas_threads() == {2}
    finally:
        torch.set_num_threads(before)


def test_first_weights_are_drawn_with_one_thread_of_blas(monkeypatch):
    card, seen = read_task("racer-inner").with_settings(["net.dense=16"]), []
    network, qr = ActorCritic(spaces_of(card), card.net, 1), np.linalg.qr

    def spy(drawn):
        seen.append(blas_threads())
        return qr(drawn)

    monkeypatch.setattr(np.linalg, "qr", spy)
    with blas().limit(limits=2):
        network.initialize([np.random.default_rng(0)])
        assert blas_threads() == {2}
    assert len(seen) > 4
    assert all(threads == {1} for threads in seen)


def blas_threads():
    return {library["num_threads"] for library in blas().info()}


def test_as_many_jobs_work_at_a_time_as_there_are_cores(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    meeting = Barrier(3)

    def job(number):
        meeting.wait(timeout=30)  # passes only where three wait at once
        return number, torch.get_num_threads()

    assert side_by_side([partial(job, i) for i in range(6)]) == [(i, 1) for i in range(6)]


def test_what_the_first_of_them_raises_is_raised_when_all_have_ended():
    ended = []

    def job(number):
        ended.append(number)
        if number:
            raise ValueError(f"job {number}")

    with pytest.raises(ValueError, match="job 1"):
        side_by_side([partial(job, i) for i in range(4)])
    assert sorted(ended) == [0, 1, 2, 3]


def test_an_interruption_of_the_main_thread_ends_all_jobs(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    runs, ended = Event(), []

    def endless():
        try:
            while True:
                runs.set()
                check()
        finally:
            ended.append(current_thread())

    def interrupting():
        runs.wait(30)
        raise KeyboardInterrupt  # as the main thread raises it while it waits

    with pytest.raises(KeyboardInterrupt):
        side_by_side([interrupting, endless])
    assert len(ended) == 1


@pytest.mark.parametrize("together", [False, True])
def test_a_loss_that_is_not_finite_names_its_seed(together):
    def job(s):
        if s == 2:
            raise DivergedError.of_loss("policy_loss", np.nan, 0)
        return {"policy_loss": np.array([float(s)], np.float32)}

    with pytest.raises(DivergedError) as caught:
        seed_by_seed([job], 3, together)
    assert caught.value.row == 2
    metrics = seed_by_seed([job, lambda s: {"value_loss": np.ones(1)} if s else {}], 2, together)
    assert metrics["policy_loss"].tolist() == [0, 1]
    np.testing.assert_equal(metrics["value_loss"], [np.nan, 1])


@pytest.mark.parametrize("setting", ["net.shared=false", "net.shared=true", "net.precision=bf16"])
def test_cameras_learn_the_same_bits_whatever_the_number_of_threads(monkeypatch, setting):
    small = ["ppo.n_episodes=2", "ppo.n_epochs=2", "ppo.n_iterations=1", "net.dense=16"]
    card = read_task("racer-inner").with_settings([*small, setting])
    spaces, learned = spaces_of(card), []
    before = torch.get_num_threads()
    try:
        for n in (1, 3):
            monkeypatch.setenv("OMP_NUM_THREADS", str(n))
            torch.set_num_threads(n)
            learner = Learner.fresh(ActorCritic(spaces, card.net, 2), [100, 101], 3e-4)
            (stats,) = train(card, learner, course_of(card, (), 2))
            losses = {n: values for n, values in stats.metrics.items() if n.endswith("_loss")}
            learned.append((learner.student.storage.numpy(), losses))
    finally:
        torch.set_num_threads(before)
    (one, losses), (three, others) = learned
    assert one.tobytes() == three.tobytes()
    np.testing.assert_equal(losses, others)


def test_the_bar_of_an_update_counts_the_steps_of_all_threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "4")
    with activity.doing("learning"):
        activity.progress(0, 4000, "batches")
        side_by_side([lambda: [activity.advance() for _ in range(1000)]] * 4)
        assert activity.now()[-1].done == 4000
