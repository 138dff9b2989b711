"""A sign of life: what is being done, how far it is, how long the rest takes."""

import io
import os
import pty
import re
import subprocess
import sys
from time import perf_counter, sleep

import numpy as np
import pytest
from numba.core.event import trigger_event
from rich.console import Console
from small_learners import learner_of, training
from small_tasks import guess, reach

from repaint_cli import activity, kernels
from repaint_cli.cli import live as live_module
from repaint_cli.cli.live import Pace, live
from repaint_cli.runs.comparison_words import duration


@pytest.fixture
def clock(monkeypatch):
    class Clock:
        now = 100.0

        def __call__(self):
            return self.now

    clock = Clock()
    monkeypatch.setattr(live_module, "monotonic", clock)
    return clock


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0.2 s"), (9.96, "10 s"), (42, "42 s"), (99.4, "99 s"), (100, "1.7 min"),
     (186, "3.1 min"), (2520, "42 min"), (9000, "2.5 h"), (float("nan"), "-")],
)  # fmt: skip
def test_durations_are_for_people(seconds, text):
    assert duration(seconds) == text


def paced(clock, seconds, compiling=0.0):
    pace = Pace(lambda: clock.now - (compiling if clock.now > 100 else 0.0))
    for one in seconds:
        clock.now += one
        pace.add()
    return pace


def test_what_is_left_is_known_after_the_first_iteration_where_it_is_long(clock):
    assert paced(clock, [40.0]).left(59) == pytest.approx(40 * 59)


def test_a_short_first_iteration_does_not_count_nor_does_compiling(clock):
    assert paced(clock, [3.0]).left(59) is None
    assert paced(clock, [3.0, 0.2]).left(58) == pytest.approx(0.2 * 58)
    clock.now = 100.0
    assert paced(clock, [36.0], compiling=33.0).left(59) is None
    clock.now = 100.0
    assert paced(clock, [60.0], compiling=20.0).left(2) == pytest.approx(80)


def test_what_is_left_falls_within_an_iteration_and_follows_the_newest_ones(clock):
    pace = paced(clock, [40.0] * 3 + [80.0] * 10)
    assert pace.left(10) == pytest.approx(800)
    clock.now += 30
    assert pace.left(10) == pytest.approx(770)
    clock.now += 5000
    assert pace.left(1) == 0


@pytest.mark.parametrize("growth", [1.0, 1.01, 0.99])
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_what_is_left_is_right_within_a_third_from_the_second_iteration_on(clock, growth, noise):
    rng = np.random.default_rng(0)
    seconds = 20 * growth ** np.arange(30) * np.exp(noise * rng.standard_normal(30))
    pace = Pace(lambda: clock.now)
    for k, one in enumerate(seconds[:-1], 1):
        clock.now += one
        pace.add()
        if k >= 2:
            assert pace.left(30 - k) == pytest.approx(seconds[k:].sum(), rel=1 / 3)


def test_the_clock_of_a_training_stands_while_code_is_compiled():
    began, clock = perf_counter(), kernels.training_clock()
    with trigger_event("numba:compile"):
        sleep(0.05)
    clock = kernels.training_clock() - clock
    assert perf_counter() - began - clock >= 0.05
    assert clock >= 0


def drawn(console, **options):
    """What a terminal of 80 columns shows at this moment."""
    with live(console, **options):
        pass
    return console.file.getvalue()


def terminal():
    return Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)


def test_a_terminal_shows_each_activity_within_80_columns(clock):
    with activity.doing("repaint-joint · racer-advanced"):
        activity.progress(112, 1200, "iterations")
        activity.now()[0].begun = clock.now - 4805
        with activity.doing("learning"):
            activity.progress(1120, 1260, "batches")
            shown = drawn(terminal(), left=lambda: 11_100, note=lambda: "return 3")
    lines = [re.sub(r"\x1b\[[\d?]*\w", "", line).rstrip() for line in shown.splitlines()]
    outer = [line for line in lines if line.startswith("repaint-joint")]
    assert outer[-1].endswith("112/1,200 iterations 1:20:05, 3.1 h left")
    assert any("  learning" in line and "1,120/1,260 batches" in line for line in lines)
    assert "  return 3" in lines
    assert max(map(len, lines)) <= 80


def test_a_terminal_shows_that_something_starts_and_nothing_at_the_end(clock):
    assert "starting" in drawn(terminal())
    console = terminal()
    with live(console), activity.doing("drawing"):
        pass
    assert "drawing" not in console.file.getvalue().splitlines()[-1]


def test_compiling_is_shown_in_the_line_of_what_waits_for_it(clock):
    with activity.doing("training"), activity.doing("collecting"):
        shown = drawn(terminal(), compiling=lambda: True)
    assert "  collecting, compiling" in shown
    assert "training, compiling" not in shown
    assert "compiling" not in drawn(terminal())


def test_compiling_is_known_while_a_kernel_is_compiled(monkeypatch):
    seen = []
    start = kernels.event.TimingListener.on_start
    monkeypatch.setattr(
        kernels.event.TimingListener, "on_start",
        lambda self, one: (start(self, one), seen.append(kernels.compiling())),
    )  # fmt: skip
    kernels.numba.njit(lambda x: x + 1)(1)
    assert (seen[-1], kernels.compiling()) == (True, False)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_terminal_shows_that_libraries_are_loaded_before_they_are(home, terminal):
    words = ["repaint", "train-teacher", "--task", "reacher", "--set", "ppo.n_steps=3"]
    code = (
        f"import sys; sys.argv = {words}\n"
        "from repaint_cli.cli import live\n"
        "live.activity.doing = lambda name, doing=live.activity.doing: (\n"
        "    print(name, 'torch' in sys.modules, file=sys.__stderr__), doing(name))[1]\n"
        "from repaint_cli.cli.app import main; main()"
    )
    reading, writing = pty.openpty() if terminal else os.pipe()
    done = subprocess.run(
        [sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE, text=True
    )
    os.close(writing)
    assert done.returncode == 3, done.stderr
    assert done.stderr.startswith("loading libraries False\n")
    shown = os.read(reading, 10_000)
    os.close(reading)
    assert (b"loading libraries" in shown) == terminal


def test_names_of_strangers_are_spelled_out(clock):
    with activity.doing("\x1b]0;mine\x07 [bold]"):
        shown = drawn(terminal())
    assert "\x1b]0" not in shown
    assert "[bold" in shown


def test_nothing_is_shown_where_there_is_no_terminal():
    with activity.doing("learning"):
        assert drawn(Console(file=io.StringIO(), width=80)) == ""


@pytest.mark.parametrize(
    ("task", "wanted"),
    [
        (reach(n_iterations=1, compiled=False),
         {("collecting", 72, 72, "steps"), ("learning", 6, 6, "batches")}),
        (guess(n_iterations=1, compiled=False), {("collecting", 4, 4, "episodes")}),
    ],
)  # fmt: skip
def test_training_says_what_it_does(monkeypatch, task, wanted):
    said = set()

    def noting(say):
        def noted(*args):
            say(*args)
            own = activity.now()[-1]
            said.add((own.name, own.done, own.total, own.unit))

        return noted

    for module, name in (("rollout.extent", "progress"), ("update.epochs", "advance")):
        noted = noting(getattr(activity, name))
        monkeypatch.setattr(f"repaint_cli.learn.{module}.{name}", noted)
    for _ in training(task, learner_of(task, [0])):
        pass
    assert wanted <= said
    assert activity.now() == []


def test_an_activity_ends_with_an_error():
    with pytest.raises(ZeroDivisionError), activity.doing("dividing"):
        raise ZeroDivisionError
    assert activity.now() == []
    activity.progress(1, 2, "of nothing")
