"""Results are printed as soon as they are there: a file that cannot be written costs no numbers."""

import json

import pytest
from small_runs import QUICK, QUICK_LAP, add_teacher

import repaint_cli
from repaint_cli.errors import StoreError, UsageError
from repaint_cli.runs import compare as comparing

SCRATCH = ["transfer", "--task", "reacher", "--method", "scratch", *QUICK]


@pytest.fixture
def run(repaint, lay, home):
    """A run, beside a file that is no folder."""
    lay(*SCRATCH, "--run", "run")
    (home / "file").write_text("no folder")
    return home / "run"


@pytest.mark.parametrize("words", [["--output", "file/x.png"], ["--report", "file/report"]])
def test_a_comparison_is_printed_before_its_files(repaint, run, words):
    said = repaint("compare", "run", *words)
    assert said.code == StoreError.exit_code
    assert said.err.startswith("error: cannot ")
    assert said.err.count("\n") == 1
    assert said.out.startswith("reacher, compared with scratch\n")
    assert "over 2 iterations" in " ".join(said.out.split())
    assert "wrote" not in said.out
    printed = repaint("compare", "run", "--json", *words)
    assert printed.code == StoreError.exit_code
    assert [row["run"] for row in json.loads(printed.out)["runs"]] == ["scratch"]


def test_paths_that_cannot_be_drawn_cost_no_table(repaint, run):
    words = ["compare", "run", "--trajectories", "--output", "file/x.png"]
    said = repaint(*words)
    assert said.code == StoreError.exit_code
    assert said.out.startswith("reacher: scratch\n")
    assert "wrote" not in said.out
    printed = repaint(*words, "--json")
    assert (printed.code, printed.out) == (StoreError.exit_code, "")


def test_each_run_s_table_is_printed_once_it_has_played(repaint, lay, run, monkeypatch):
    lay(*SCRATCH, "--run", "two")
    real, calls = comparing.evaluate, []

    def stops_at_the_second(*args, **options):
        calls.append(args)
        if len(calls) == 2:
            raise StoreError("stopped")
        return real(*args, **options)

    monkeypatch.setattr(comparing, "evaluate", stops_at_the_second)
    said = repaint("compare", "run", "two", "--trajectories")
    assert said.err == "error: stopped\n"
    assert said.out.count("reacher: scratch") == 1


def test_an_evaluation_is_printed_before_its_files(repaint, run):
    (run / "eval.json").mkdir()
    said = repaint("eval", "run")
    assert said.code == StoreError.exit_code
    assert said.out.startswith("reacher · scratch · iteration 2\n")
    assert "return" in said.out
    assert "wrote" not in said.out


def test_the_functions_call_back_before_anything_is_written(home):
    add_teacher(home / "home" / "zoo")
    noted = []

    def note(*results):
        noted.append((results, sorted(path.name for path in home.iterdir())))

    evaluation = repaint_cli.evaluate("old-hand", episodes=2, on_episodes=note)
    assert noted.pop() == ((evaluation.policies, evaluation.episodes), ["home"])
    settings = ["ppo.n_steps=204", "ppo.n_envs=4", "ppo.n_epochs=1", "eval.episodes=2"]
    repaint_cli.transfer("reacher", method="scratch", iterations=1, settings=settings, folder="run")
    before = ["home", "run", "runs"]
    compared = repaint_cli.compare(["run"], on_comparison=note)
    assert noted.pop() == ((compared.comparison,), before)
    (played,) = repaint_cli.play_runs(["run"], on_run=note)
    assert noted.pop() == ((played,), ["compare.png", *before])


@pytest.mark.parametrize("n_episodes", [0, -1])
def test_a_film_has_an_episode(home, n_episodes):
    evaluation = repaint_cli.evaluate("reacher-gentle", episodes=2)
    message = f"expected --video-episodes of at least 1, found {n_episodes}"
    with pytest.raises(UsageError, match=message):
        evaluation.film(n_episodes)


def test_a_film_that_cannot_be_made_costs_no_numbers(repaint, home):
    repaint("transfer", "--method", "scratch", "--task", "racer-inner", "--run", "run", *QUICK_LAP)
    (home / "run" / "video.mp4").mkdir()
    said = repaint("eval", "run", "--render-offscreen")
    assert said.code == StoreError.exit_code
    assert said.out.startswith("racer-inner · scratch")
