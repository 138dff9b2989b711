"""Ctrl-C and SIGTERM: code of users that swallows them, steps that never return, children."""

import os
import signal
import subprocess
import sys
import time
from functools import partial

import pytest
from failing_env import card
from small_runs import add_teacher
from test_adverse_conditions import PATH
from test_runs import record_of

from repaint_cli import interruption
from repaint_cli.policies.spaces import Spaces

BARE = """
import time

def reward_function(params):
    try:
        open("at-work", "w").close()
        time.sleep(0.02)
        return float(params["speed"])
    except:
        return 1e-3
"""
LAPS = """extends = "racer-inner"
[reward]
function = "mine.py"
[env]
max_steps = 6
[ppo]
n_episodes = 10
n_epochs = 1
[net]
conv = [[4, 8, 8]]
dense = 8
[eval]
episodes = 2
"""
LINE = Spaces((2,), 1, discrete=False)
TRAIN = ["transfer", "--method", "scratch", "--task", "bad.toml", "--run", "run"]


def started(words, *, ignored=False):
    """Type a command in a shell's foreground, or in its background, where SIGINT is ignored."""
    handler = signal.SIG_IGN if ignored else signal.SIG_DFL
    child = subprocess.Popen(
        [sys.executable, "-m", "repaint_cli", *map(str, words)], text=True,
        env=os.environ | {"PYTHONPATH": PATH, "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=partial(signal.signal, signal.SIGINT, handler), start_new_session=True,
    )  # fmt: skip
    CHILDREN.append(child)
    return child


CHILDREN = []


@pytest.fixture(autouse=True)
def _no_child_stays():
    """A child that a failing test leaves would keep a core for ever."""
    yield
    while CHILDREN:
        with CHILDREN.pop() as child:
            child.kill()


def processes_of(group):
    """Tell whether a group of processes has any left."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


def wait_for(path):
    while not path.exists():
        time.sleep(0.05)


def ended(child):
    """Wait for a process; get its exit code and what it printed."""
    out, err = child.communicate(timeout=60)
    return child.returncode, out, err


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_bare_except_swallows_no_signal(home, number, code):
    (home / "mine.py").write_text(BARE)
    (home / "bad.toml").write_text(LAPS)
    child = started([*TRAIN, "--iterations", 99])
    wait_for(home / "run" / "checkpoint.safetensors")
    (home / "at-work").unlink(missing_ok=True)
    wait_for(home / "at-work")
    child.send_signal(number)
    child.send_signal(number)  # as `timeout` does: they count as one
    returned, out, err = ended(child)
    assert (returned, err) == (code, "")
    assert out.splitlines()[-1] == "next: repaint transfer --resume run"
    assert record_of(home / "run")["state"] == "interrupted"


@pytest.mark.parametrize("words", [TRAIN, ["eval", "old-hand", "--task", "bad.toml"]])
def test_a_step_that_swallows_all_and_never_returns_ends_at_the_second(home, words):
    (home / "bad.toml").write_text(card("deaf"))
    (home / "good.toml").write_text(card())
    if words[0] == "eval":
        add_teacher(home / "home" / "zoo", task=str(home / "good.toml"), spaces=LINE)
    child = started(words)
    wait_for(home / "deaf")
    child.send_signal(signal.SIGTERM)
    with pytest.raises(subprocess.TimeoutExpired):
        child.wait(2 * interruption.AT_ONCE)
    child.send_signal(signal.SIGTERM)
    assert ended(child)[0] == 143


def test_in_the_background_ctrl_c_is_not_heard_and_sigterm_is(home):
    (home / "bad.toml").write_text(card("hangs"))
    child = started(TRAIN, ignored=True)
    wait_for(home / "run" / "metrics.csv")
    child.send_signal(signal.SIGINT)
    with pytest.raises(subprocess.TimeoutExpired):
        child.wait(1)
    child.send_signal(signal.SIGTERM)
    assert ended(child)[0] == 143


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        pytest.param(signal.SIGINT, marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, marks=pytest.mark.slow),
    ],
)
def test_processes_that_train_methods_end_with_the_command(home, number):
    (home / "bad.toml").write_text(card("deaf"))
    (home / "good.toml").write_text(card())
    add_teacher(home / "home" / "zoo", task=str(home / "good.toml"), spaces=LINE)
    words = ["compare", "--task", "bad.toml", "--teacher", "old-hand", "--jobs", 2]
    child = started([*words, "--methods", "scratch,kickstart"])
    wait_for(home / "deaf")
    child.send_signal(number)
    assert ended(child)[0] == {signal.SIGKILL: -9}.get(number, 128 + number)
    deadline = time.monotonic() + 30
    while processes_of(child.pid):
        assert time.monotonic() < deadline
        time.sleep(0.1)
