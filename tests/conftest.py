import gc
import os
import shutil
import sys
from dataclasses import dataclass
from importlib.util import find_spec

import pytest
from hypothesis import settings

from repaint_cli.cli.app import main


class _NoTorch:
    """The last to be asked for a module: a test that comes to need torch is skipped."""

    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == "torch":
            pytest.skip("needs torch, which `make test-light` leaves out", allow_module_level=True)


# one thread of BLAS, as of torch, also of what tests start, and before numpy is loaded: on a busy
# machine two wait for each other by spinning, and take a hundred times as long as one
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

if find_spec("torch"):
    import torch

    torch.set_num_threads(1)
else:
    sys.meta_path.append(_NoTorch)

settings.register_profile("repaint", deadline=None, max_examples=50, derandomize=True)
settings.load_profile("repaint")


def pytest_configure(config):
    # gradients are views into one buffer on purpose; pytest's filters replace the one nets.py sets
    config.addinivalue_line("filterwarnings", "ignore:grad and param do not obey the gradient")


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Look for garbage among what a test makes, and not again and again among all the modules."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture
def batches_of(monkeypatch):
    """Have every call of a loss, by name, note its batch of samples."""

    from repaint_cli.learn.update import epochs

    def spy_on(name):
        batches, loss = [], getattr(epochs, name)

        def spy(student, batch, *rest):
            batches.append(batch)
            return loss(student, batch, *rest)

        monkeypatch.setattr(epochs, name, spy)
        return batches

    return spy_on


@pytest.fixture
def home(tmp_path, monkeypatch):
    """An empty folder to be in, with an empty zoo of the user's own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("REPAINT_HOME", str(tmp_path / "home"))
    return tmp_path


@pytest.fixture
def unpainted(monkeypatch):
    """Write blank pictures: a figure is made as ever, but not painted, a third of a short run.

    For tests that look at no picture; those of test_figures.py, test_cli.py, test_runs.py are
    painted.
    """
    from matplotlib.figure import Figure

    from repaint_cli.report import style

    save = style.save
    monkeypatch.setattr(style, "save", lambda _, path: save(Figure(figsize=(0.1, 0.1)), path))


@dataclass
class Said:
    code: int
    out: str
    err: str


@pytest.fixture
def repaint(home, monkeypatch, capsys):
    """Type a command in an empty folder; get its exit code and what it printed."""

    def type_in(*words):
        monkeypatch.setattr(sys, "argv", ["repaint", *map(str, words)])
        capsys.readouterr()
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code or 0
        return Said(code, *capsys.readouterr())

    return type_in


_TRAINED = {}
"""Folders of runs by the words that trained them, but for where."""


@pytest.fixture
def lay(repaint, home, tmp_path_factory, monkeypatch):
    """Lay a run from scratch where `--run` says, as if its command were typed here.

    The same words are typed once for all tests, in a folder of their own.
    """

    def lay_run(*words):
        place, rest, each = "", (), map(str, words)
        for word in each:
            if word == "--run":  # of two, the second counts
                place = next(each)
            else:
                rest += (word,)
        if rest not in _TRAINED:
            folder = tmp_path_factory.mktemp("trained")
            with monkeypatch.context() as patch:
                patch.chdir(folder)
                patch.setenv("REPAINT_HOME", str(folder / "home"))
                assert repaint(*rest, "--run", "run").code == 0
            _TRAINED[rest] = folder / "run"
        shutil.copytree(_TRAINED[rest], home / place, copy_function=shutil.copy)

    return lay_run
