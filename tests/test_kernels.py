"""The cache of compiled kernels knows when what a kernel uses has changed."""

import os
import subprocess
import sys
from pathlib import Path

CALLER = """
from repaint_cli.kernels import kernel
from helper import STEP, twice

@kernel
def call(x):
    return twice(x) + STEP

if __name__ == "__main__":
    print(call(10), call.stats.cache_hits[call.signatures[0]] if call.stats.cache_hits else 0)
"""
HELPER = """
from repaint_cli.kernels import kernel

STEP = {step}

@kernel
def twice(x):
    return {factor} * x
"""


def test_a_kernel_is_compiled_again_when_a_file_beside_it_changes(tmp_path):
    (tmp_path / "caller.py").write_text(CALLER, encoding="utf-8")
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
           "PYTHONPATH": str(Path(__file__).parents[1])}  # fmt: skip
    found = []
    for step, factor in ((1, 2), (1, 2), (5, 30)):
        text = HELPER.format(step=step, factor=factor)
        helper = tmp_path / "helper.py"
        if not helper.exists() or helper.read_text(encoding="utf-8") != text:
            helper.write_text(text, encoding="utf-8")
        done = subprocess.run(
            [sys.executable, "caller.py"], cwd=tmp_path, env=env, capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        found.append(done.stdout.split())
    assert found == [["21", "0"], ["21", "1"], ["305", "0"]]
