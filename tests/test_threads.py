"""How many threads work, and that those which wait do not spin."""

import os
import subprocess
import sys

import pytest

from repaint_cli.policies.architecture import NetConfig
from repaint_cli.policies.networks import threads_for
from repaint_cli.threads import cores


@pytest.mark.parametrize("text", ["", "0", "many", "-1"])
def test_all_cores_work_unless_a_number_is_set(monkeypatch, text):
    monkeypatch.setenv("OMP_NUM_THREADS", text)
    assert cores() == len(os.sched_getaffinity(0))
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert cores() == 3


def test_dense_networks_have_one_thread_of_torch_and_convolutions_all(monkeypatch):
    monkeypatch.setattr("torch.get_num_threads", lambda: 7)
    assert threads_for(NetConfig()) == 1
    assert threads_for(NetConfig(kind="cnn")) == 7


PROGRAM = """
import os, sys
from repaint_cli.__main__ import main
sys.argv = ["repaint", "--version"]
try:
    main()
except SystemExit:
    print("torch" in sys.modules, os.environ["GOMP_SPINCOUNT"])
"""


@pytest.mark.parametrize("own", [{}, {"GOMP_SPINCOUNT": "7"}], ids=["unset", "set"])
def test_waiting_is_decided_before_torch_is_imported_unless_the_user_did(own):
    bare = {name: value for name, value in os.environ.items() if name != "GOMP_SPINCOUNT"}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=bare | own, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == f"False {own.get('GOMP_SPINCOUNT', '2000')}"
