"""Of several processes one owns a run, whichever of the steps between takes long."""

import pytest
from delayed import Delayed
from small_runs import files_below
from test_resume import SCRATCH, assert_same
from test_runs import record_of, rows_of

from repaint_cli.errors import StoreError
from repaint_cli.files.lock import folder_lock
from repaint_cli.runs.new_folder import make_new

BEFORE_THE_LOCK = "repaint_cli.files.lock._acquire"
WITH_THE_LOCK = [
    pytest.param("repaint_cli.runs.start.read_run", marks=pytest.mark.slow),
    "repaint_cli.runs.experiment.restore",
    pytest.param("repaint_cli.runs.experiment.settle", marks=pytest.mark.slow),
    pytest.param("repaint_cli.runs.carry_out.draw_run", marks=pytest.mark.slow),
]
NAMING = "repaint_cli.runs.new_folder._renamed"
WHILE_IT_BEGINS = [
    pytest.param("repaint_cli.runs.start.checked_seeds", marks=pytest.mark.slow),
    pytest.param("repaint_cli.runs.new_folder.folder_lock", marks=pytest.mark.slow),
    pytest.param("repaint_cli.runs.experiment.start_csv", marks=pytest.mark.slow),
    NAMING,
]


def test_a_resume_that_is_late_for_its_lock_reads_what_another_has_done(repaint, lay, home):
    lay(*SCRATCH)
    late = Delayed(["transfer", "--resume", "run"], BEFORE_THE_LOCK)
    late.wait()
    assert repaint("transfer", "--resume", "run", "--iterations", 4).code == 0
    assert late.go_on() == 0
    lay(*SCRATCH, "--run", "calm", "--iterations", 4)
    assert_same(home / "run", home / "calm")


@pytest.mark.parametrize("place", WITH_THE_LOCK)
def test_a_run_that_another_process_goes_on_with_is_refused(repaint, lay, home, place):
    lay(*SCRATCH)
    first = Delayed(["transfer", "--resume", "run", "--iterations", 3], place)
    first.wait()
    before = files_below(home / "run")
    said = repaint("transfer", "--resume", "run", "--iterations", 4)
    assert (said.code, said.err.count("\n")) == (StoreError.exit_code, 1)
    assert "run is being written by another process; wait for it" in said.err
    assert files_below(home / "run") == before
    assert first.go_on() == 0
    assert (record_of(home / "run")["state"], len(rows_of(home / "run"))) == ("finished", 3)


@pytest.mark.parametrize("place", WHILE_IT_BEGINS)
def test_three_runs_that_begin_in_a_second_have_folders_of_their_own(home, place):
    words = SCRATCH[: SCRATCH.index("--run")] + SCRATCH[SCRATCH.index("--run") + 2 :]
    commands = [Delayed(words, place) for _ in range(3)]
    for command in commands:
        command.wait()
    assert [command.go_on() for command in commands] == [0, 0, 0]
    runs = sorted((home / "runs" / "reacher").iterdir())
    assert [run.name for run in runs] == [
        "scratch-20210718-120000", "scratch-20210718-120000-2", "scratch-20210718-120000-3",
    ]  # fmt: skip
    for run in runs[1:]:
        assert_same(runs[0], run)


def test_of_two_runs_of_one_name_one_begins(home):
    commands = [Delayed(SCRATCH, NAMING) for _ in range(2)]
    for command in commands:
        command.wait()
    assert [command.go_on() for command in commands] == [0, StoreError.exit_code]
    assert [path.name for path in home.iterdir() if path.name != "home"] == ["run"]


def test_the_folders_of_two_comparisons_are_two(home):
    assert [make_new(home / "runs" / "compare").name for _ in range(2)] == ["compare", "compare-2"]


def test_an_evaluation_of_a_run_that_trains_has_a_folder_of_its_own(repaint, lay, home):
    lay(*SCRATCH)
    before = files_below(home / "run")
    with folder_lock(home / "run"):
        said = repaint("eval", "run")
    assert said.code == 0
    assert files_below(home / "run") == before
    (folder,) = (home / "runs" / "reacher").iterdir()
    assert folder.name.startswith("eval-run-")
    assert f"wrote {folder.relative_to(home)}/: eval.json" in said.out
