"""Reward functions of DeepRacer users, run as they are."""

import csv
import re

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from small_learners import learner_of
from small_reward_card import CARD

from repaint_cli.envs.racer.deepracer.reward_file import RewardFile
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError
from repaint_cli.learn.seeding import Purpose
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.similarity import cosine

pytestmark = pytest.mark.usefixtures("unpainted")  # no picture of a run is looked at

CENTRE = """
import math

def reward_function(params):
    if not params["all_wheels_on_track"]:
        return 1e-3
    half = params["track_width"] / 2
    return float(max(1e-3, 1 - math.fabs(params["distance_from_center"]) / half))
"""
COUNTER = """
calls = 0

def reward_function(params):
    global calls
    calls += 1
    return calls
"""


def paying(source, n=2, **kwargs):
    return RewardFile(RacerVectorEnv(load_track("oval"), n, **kwargs), "reward.py", source)


@pytest.fixture
def mine(home):
    """A task with a reward function of one's own, in the folder."""
    (home / "reward.py").write_text(CENTRE)
    (home / "mine.toml").write_text(CARD)
    return "mine.toml"


def test_it_pays_what_the_function_says(mine):
    env = read_task(mine).make_env(2)
    env.reset(seed=[1, 2])
    for _ in range(4):
        _, reward, *_, info = env.step(np.full(2, 9))
        racer = env.unwrapped
        all_params = [racer.params(row) for row in range(2)]
        expected = [
            max(1e-3, 1 - p["distance_from_center"] * 2 / p["track_width"]) for p in all_params
        ]
        np.testing.assert_allclose(reward, expected)
        np.testing.assert_allclose(info["function"], expected)


def test_each_environment_has_a_module_that_outlives_its_episodes():
    env = paying(COUNTER, max_steps=3)
    env.reset(seed=1)
    paid = [env.step(np.full(2, 7))[-1]["function"].tolist() for _ in range(8)]
    assert paid == [[k, k] for k in (1, 2, 3, 0, 4, 5, 6, 0)]  # a reset's step earns nothing


EPISODES = """
episodes = 0

def reward_function(params):
    global episodes
    episodes += params["steps"] == 1
    return float(episodes)
"""


def rows_of(run):
    return list(csv.DictReader((run / "metrics.csv").read_text().splitlines()))


def test_variables_last_from_iteration_to_iteration_and_begin_anew_at_a_resume(repaint, home, mine):
    (home / "reward.py").write_text(EPISODES)
    said = repaint("train-teacher", "--task", mine, "--iterations", 2, "--run", "run")
    assert said.code == 0, said.err
    rows = rows_of(home / "run")
    for name in ("episode_return", "eval_return"):  # each copy plays an episode an iteration
        assert [float(row[name]) for row in rows] == pytest.approx([6.0, 12.0])
    assert "begin" not in said.out
    said = repaint("train-teacher", "--resume", "run", "--iterations", 3)
    line = "warning: reward.py remembers, as its variables episodes change, and they begin anew: "
    assert line + "from here on this is another run than one without a stop" in said.out
    rows = rows_of(home / "run")
    assert float(rows[2]["eval_return"]) == pytest.approx(6.0)


def test_copies_of_teachers_and_students_have_variables_of_their_own():
    functions = []
    first = RewardFile(RacerVectorEnv(load_track("oval"), 2), "r.py", COUNTER, functions)
    first.reset(seed=1)
    first.step(np.full(2, 7))
    again = RewardFile(RacerVectorEnv(load_track("oval"), 3), "r.py", COUNTER, functions)
    again.reset(seed=1)
    assert again.step(np.full(3, 7))[-1]["function"].tolist() == [2, 2, 1]
    learner = learner_of(read_task("cartpole"), [0])
    mine, theirs = (learner.functions_of(of, 4) for of in (Purpose.TRAIN, Purpose.TEACHER))
    assert mine is not theirs
    assert mine is learner.functions_of(Purpose.TRAIN, 4)


def test_cars_that_park_from_the_beginning_are_not_asked():
    env = RacerVectorEnv(load_track("oval"), 4, autoreset_mode=AutoresetMode.DISABLED)
    rewarded = RewardFile(env, "reward.py", COUNTER)
    rewarded.reset(seed=0, options={"parked": [False, True, True, False]})
    for _ in range(3):
        *_, info = rewarded.step(np.full(4, 2))
    assert info["function"].tolist() == [3, 0, 0, 3]


def test_parked_cars_are_not_asked():
    env = paying(COUNTER, max_steps=2, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=1)
    paid = [env.step(np.full(2, 7))[-1]["function"].tolist() for _ in range(4)]
    assert paid == [[1, 1], [2, 2], [0, 0], [0, 0]]


BROKEN = [
    (
        "def reward_function(params):\n    return 1 / 0",
        "reward.py:2: ZeroDivisionError.*at step 1",
    ),
    ("def reward_function(params):\n    return params['sped']", "reward.py:2: KeyError: 'sped'"),
    ("import nothing_of_this_name", "reward.py:1: ModuleNotFoundError: No module named"),
    ("def reward_function(params)\n    pass", "reward.py:1: SyntaxError: expected ':'"),
    ("def reward_function(params):\n    exit(3)", "reward.py:2: SystemExit: 3"),
    ("def reward(params):\n    return 1", r"expected def reward_function\(params\), found none"),
    (
        "def reward_function(on_track, x, y):\n    return 1",
        "one of 3 arguments as before 2019",
    ),
    ("def reward_function(params):\n    return None", "within ±100,000 .* found None .at step 1"),
    (
        "def reward_function(params):\n    return float('nan')",
        "found nan .at step 1 of",
    ),
    (
        "\ndef reward_function(params):\n    return 100001",
        "reward.py:2: .* found 100001 .at step 1",
    ),
]


@pytest.mark.parametrize(("source", "message"), BROKEN, ids=range(len(BROKEN)))
def test_what_goes_wrong_is_named_with_file_line_and_step(source, message):
    def drive():
        env = paying(source)
        env.reset(seed=1)
        env.step(np.full(2, 7))

    with pytest.raises(CardError, match=message):
        drive()


def test_the_limit_itself_is_allowed():
    env = paying("def reward_function(params):\n    return -100000")
    env.reset(seed=1)
    assert env.step(np.full(2, 7))[-1]["function"].tolist() == [-1e5, -1e5]


def test_it_trains_transfers_from_a_lane_teacher_and_its_teacher_runs_no_code(repaint, mine, home):
    trained = repaint("train-teacher", "--task", mine)
    assert trained.code == 0
    (following,) = re.findall("next: repaint (.*) --render-offscreen", trained.out)
    assert repaint(*following.split()).code == 0
    said = repaint("eval", "mine")
    assert said.code == CardError.exit_code
    assert "never run from a teacher's file; name the task: --task my-task.toml" in said.err
    (home / "reward.py").write_text(CENTRE.replace("1e-3", "2e-3"))
    said = repaint("eval", "mine", "--task", mine)
    assert said.code == 0
    assert f"next: repaint similarity {mine}" in said.out
    assert repaint("transfer", "--teacher", "mine", "--task", mine, "--iterations", 2).code == 0


def test_a_lane_teacher_fits_a_reward_function(repaint, mine):
    settings = ["--set", "net.conv=[[32,8,4],[64,4,2],[64,3,1]]", "--set", "net.dense=512"]
    said = repaint("transfer", "--teacher", "racer-inner", "--task", mine, *settings)
    assert (said.code, said.err) == (0, "")


def test_the_card_refuses_what_cannot_be(repaint, mine, home):
    (home / "mine.toml").write_text(CARD.replace('"reward.py"', '"none.py"'))
    assert "cannot read none.py: No such file" in repaint("tasks", "check", mine).err
    (home / "mine.toml").write_text(CARD.replace("[net]", "lane = 1\n\n[net]"))
    said = repaint("tasks", "check", mine).err
    assert "a reward function stands alone: leave out lane beside reward.py; what it pays" in said
    assert "can be multiplied, by scale = 1e-3" in said
    for scale, found in (("0", "0"), ("-1", "-1")):
        (home / "mine.toml").write_text(CARD.replace("[net]", f"scale = {scale}\n\n[net]"))
        said = repaint("tasks", "check", mine)
        assert (said.code, said.out) == (CardError.exit_code, "")
        assert found in said.err
    (home / "mine.toml").write_text(CARD.replace("[net]", "scale = 'small'\n\n[net]"))
    assert "expected a valid number" in repaint("tasks", "check", mine).err
    (home / "mine.toml").write_text('extends = "reacher"\n[reward]\nfunction = "reward.py"')
    assert "a reward function needs the racer's params" in repaint("tasks", "check", mine).err


def test_two_functions_have_no_cosine(mine, home):
    one = read_task(mine)
    assert cosine(one, one) == 1
    (home / "reward.py").write_text(COUNTER)
    assert cosine(one, read_task(mine)) is None


def test_a_byte_order_mark_is_no_part_of_a_file(repaint, mine, home):
    """Python reads a module with one; editors put it before cards and JSON, too."""
    (home / "reward.py").write_text(CENTRE, encoding="utf-8-sig")
    card = CARD.replace("[env]", '[env]\nmodel_metadata = "actions.json"')
    (home / "mine.toml").write_text(card, encoding="utf-8-sig")
    (home / "actions.json").write_text(
        '{"action_space": [{"steering_angle": 0, "speed": 1}]}', encoding="utf-8-sig"
    )
    task = read_task(mine)
    assert task.reward_code.source == CENTRE
    assert task.env.actions == ((0, 1),)
    (home / "reward.py").write_bytes(CENTRE.encode("utf-16"))
    assert "expected UTF-8, found other bytes" in repaint("tasks", "check", mine).err


BIG = "def reward_function(params):\n    print('step', params['steps'])\n    return 2e4\n"


def test_a_scale_makes_of_its_pay_a_reward_that_a_critic_learns(repaint, mine, home):
    (home / "reward.py").write_text(BIG)
    said = repaint("tasks", "check", mine)
    assert "warning: returns of 1.2e+05 are large" in said.out
    assert "in [reward], scale = 1e-03 beside the function helps" in said.out
    (home / "mine.toml").write_text(CARD.replace("[net]", "scale = 1e-3\n\n[net]"))
    said = repaint("tasks", "check", mine)
    assert "are large" not in said.out
    assert "reward terms of a step: function 2e+04" in said.out  # what the function pays
    assert read_task(mine).reward == {"function": 1e-3}
    assert read_task(mine).with_settings(["reward.scale=0.5"]).reward == {"function": 0.5}


def test_a_run_learns_from_what_is_scaled_and_logs_what_was_paid(repaint, mine, home):
    (home / "reward.py").write_text(BIG)
    (home / "mine.toml").write_text(CARD.replace("[net]", "scale = 1e-3\n\n[net]"))
    said = repaint("train-teacher", "--task", mine, "--run", "run")
    assert said.code == 0, said.err
    (row,) = rows_of(home / "run")
    assert float(row["episode_return"]) == pytest.approx(6 * 20)
    assert float(row["eval_return"]) == pytest.approx(6 * 20)
    (log,) = (home / "run").glob("deepracer/seed-0/training-simtrace/*.csv")
    paid = {line["reward"] for line in csv.DictReader(log.read_text().splitlines())}
    assert paid == {"20000"}
    notes = [line for line in said.out.splitlines() if line.startswith("note: the environment")]
    first, last = notes
    printed = (home / "run" / "environment.log").read_text().count("\n")
    assert re.search("printed [0-9]+ lines so far, such as 'step 1.0', to run/environment", first)
    assert last == f"note: the environment printed {printed} lines to run/environment.log"
    assert "step 1" not in said.out.replace(first, "")
    said = repaint("eval", "run")
    assert "reward.py paid 1.2e+05 an episode; the return is 0.001 × that" in said.out
    assert "0.001 × the function in reward.py" in repaint("zoo", "show", "mine").out


def test_a_function_that_keeps_nothing_is_resumed_without_a_word(repaint, mine):
    repaint("train-teacher", "--task", mine, "--run", "run")
    said = repaint("train-teacher", "--resume", "run", "--iterations", 2)
    assert said.code == 0, said.err
    assert "remembers" not in said.out


def test_the_check_names_what_is_kept(repaint, mine, home):
    (home / "reward.py").write_text(EPISODES)
    line = repaint("tasks", "check", mine).out.splitlines()[-1]
    assert line.startswith(
        "note: reward.py remembers, as its variables change: episodes; they last as "
    )


SPEEDS = "def reward_function(params):\n    return {0.5: 1.0, 1.0: 2.0}[params['speed']]\n"


def test_a_table_of_listed_speeds_pays_also_under_noise(repaint, mine, home):
    (home / "reward.py").write_text(SPEEDS)
    assert repaint("train-teacher", "--task", mine, "--run", "run").code == 0
    said = repaint("eval", "run", "--noise", "paper", "--set", "eval.action_noise=0.5")
    assert said.code == 0, said.err
