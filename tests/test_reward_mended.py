"""A reward function that fails in mid-run costs the iteration; a mended one goes on."""

import csv
import json

import pytest
import small_reward_card

from repaint_cli.errors import CardError

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

CARD = small_reward_card.CARD.replace("n_iterations = 1", "n_iterations = 4")
LATE = """
episodes = 0

def reward_function(params):
    global episodes
    episodes += params["steps"] == 1
    return 1 / (LAST - episodes)
"""
FAILS = LATE.replace("LAST", "3")  # each car drives an episode an iteration
MENDED = LATE.replace("LAST", "99")


def lines(run):
    return list(csv.DictReader((run / "metrics.csv").read_text().splitlines()))


def record(run):
    return json.loads((run / "run.json").read_text())


@pytest.fixture
def mine(home):
    (home / "reward.py").write_text(FAILS)
    (home / "mine.toml").write_text(CARD)
    return home


def test_a_failure_costs_the_iteration_and_the_mended_run_goes_on(repaint, mine):
    said = repaint("train-teacher", "--task", "mine.toml", "--run", "run", "--seed", 1)
    assert said.code == CardError.exit_code
    (line,) = said.err.splitlines()
    assert line.startswith("error: reward.py:7: ZeroDivisionError: division by zero (at step 1 of ")
    wanted = f"iteration 2 is the last, and kept; mend {mine}/reward.py and go on"
    assert f"the reward function failed: {wanted}" in said.out
    assert said.out.splitlines()[-1] == "next: repaint train-teacher --resume run"
    run = mine / "run"
    assert [row["iteration"] for row in lines(run)] == ["1", "2"]
    assert (run / "seed-1.safetensors").is_file()
    assert (run / "curves.png").is_file()
    assert record(run)["state"] == "interrupted"
    assert record(run)["failure"] in line

    (mine / "reward.py").write_text(MENDED)
    said = repaint("train-teacher", "--resume", "run")
    assert said.code == CardError.exit_code
    assert f"{mine}/reward.py has changed since it failed (reward.py:7: Zero" in said.err
    assert said.err.rstrip().endswith("with its new text: repaint tasks trust run")
    said = repaint("tasks", "trust", "run", "--yes")
    assert said.out == f"{MENDED}\nallowed: the reward function reward.py\n"
    said = repaint("train-teacher", "--resume", "run")
    assert said.code == 0, said.err
    note = "the run goes on with the new text of reward.py; iterations 1 to 2 had another"
    assert f"warning: {note}" in said.out
    assert [row["iteration"] for row in lines(run)] == ["1", "2", "3", "4"]
    assert record(run)["task"]["reward_code"]["source"] == MENDED
    assert record(run)["failure"] == ""
    assert record(run)["mended"] == [2]
    assert record(run)["state"] == "finished"
    assert (run / "deepracer/seed-1/reward_function.py").read_text() == MENDED
    said = repaint("train-teacher", "--resume", "run", "--iterations", 5)
    assert said.code == 0, said.err
    assert "new text" not in said.out
    assert record(run)["mended"] == [2]


def test_a_run_whose_function_did_not_fail_keeps_its_text(repaint, mine):
    (mine / "reward.py").write_text(MENDED)
    said = repaint("train-teacher", "--task", "mine.toml", "--run", "run", "--iterations", 1)
    assert said.code == 0, said.err
    (mine / "reward.py").write_text(FAILS)
    said = repaint("train-teacher", "--resume", "run", "--iterations", 4)
    assert said.code == 0, said.err
    words = "reward.py has changed; the run goes on with the text that it began with"
    assert f"warning: {words}" in said.out
    assert record(mine / "run")["task"]["reward_code"]["source"] == MENDED


def test_a_function_that_is_not_mended_fails_again_and_says_so(repaint, mine):
    """Its variables begin anew, so that it comes further: two episodes of each car."""
    repaint("train-teacher", "--task", "mine.toml", "--run", "run", "--iterations", 9)
    said = repaint("train-teacher", "--resume", "run")
    assert said.code == CardError.exit_code
    assert "warning: reward.py is as it was when it failed: reward.py:7: ZeroDiv" in said.out
    assert len(lines(mine / "run")) == 4


def test_a_first_iteration_that_fails_can_be_mended_too(repaint, mine):
    (mine / "reward.py").write_text(LATE.replace("LAST - episodes", "4 - params['steps']"))
    said = repaint("train-teacher", "--task", "mine.toml", "--run", "run")
    assert said.code == CardError.exit_code
    assert "the reward function failed: no iteration is done; mend " in said.out
    assert said.out.splitlines()[-1] == "next: repaint train-teacher --resume run"
    (mine / "reward.py").write_text(MENDED)
    repaint("tasks", "trust", "run", "--yes")
    said = repaint("train-teacher", "--resume", "run", "--iterations", 1)
    assert said.code == 0, said.err
    assert len(lines(mine / "run")) == 1
