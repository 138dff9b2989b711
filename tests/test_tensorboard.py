"""TensorBoard's events of runs that go on have every iteration once."""

import pytest
from test_runs import SCRATCH, rows_of

pytest.importorskip("tensorboard")

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

MORE = ["transfer", "--resume", "run", "--iterations"]


def returns_in(folder):
    """Steps and values of eval_return, as TensorBoard shows them."""
    events = EventAccumulator(str(folder / "tensorboard" / "seed-0")).Reload()
    times = [event.wall_time for event in events.Scalars("eval_return")]
    assert times == sorted(times)
    return {event.step: event.value for event in events.Scalars("eval_return")}


def assert_complete(folder, k):
    found = returns_in(folder)
    assert list(found) == list(range(1, k + 1))
    wanted = [float(row["eval_return"]) for row in rows_of(folder)]
    assert list(found.values()) == pytest.approx(wanted, rel=1e-5)


def test_a_run_that_began_with_events_goes_on_with_them(repaint, home):
    repaint(*SCRATCH, "--tensorboard")
    said = repaint(*MORE, 3)
    assert "tensorboard" in said.out.splitlines()[-2]
    repaint(*MORE, 4, "--tensorboard")
    assert_complete(home / "run", 4)


def test_events_that_begin_late_begin_with_the_run(repaint, lay, home):
    lay(*SCRATCH)
    assert not (home / "run" / "tensorboard").exists()
    repaint(*MORE, 3, "--tensorboard")
    assert_complete(home / "run", 3)


def test_events_that_a_kill_took_along_are_written_again(repaint, home):
    repaint(*SCRATCH, "--tensorboard")
    for path in (home / "run" / "tensorboard" / "seed-0").iterdir():
        path.write_bytes(path.read_bytes()[:100])
    repaint(*MORE, 3)
    assert_complete(home / "run", 3)
    assert len(list((home / "run" / "tensorboard" / "seed-0").iterdir())) == 1


def test_without_tensorboard_a_run_goes_on_and_says_so(repaint, home, monkeypatch):
    repaint(*SCRATCH, "--tensorboard")
    with monkeypatch.context() as patch:
        patch.setattr("repaint_cli.runs.trackers.tracking.is_installed", lambda _: False)
        said = repaint(*MORE, 3)
    assert said.code == 0
    assert "warning: TensorBoard is not installed: its curves go on when" in said.out
    assert list(returns_in(home / "run")) == [1, 2]
    repaint(*MORE, 4)
    assert_complete(home / "run", 4)
