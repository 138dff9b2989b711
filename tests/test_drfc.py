"""`repaint tasks from-drfc`: settings and files of DeepRacer-for-Cloud as a card."""

import json
import shutil
import tomllib
from pathlib import Path

import pytest

from repaint_cli.cli.from_drfc import card_text, track_of
from repaint_cli.envs.racer.deepracer.drfc import read_run_env
from repaint_cli.errors import CardError, NotFound, StoreError
from repaint_cli.tasks.card_files import read_task

TRACK = Path(__file__).parents[1] / "tasks" / "racer" / "tracks" / "wide-loop.npy"
TRIAL = """
# my run
export DR_WORLD_NAME=my_world  # a comment
DR_RACE_TYPE='TIME_TRIAL'
DR_CAR_NAME=Fast
DR_DISPLAY_NAME=$DR_CAR_NAME
DR_LOCAL_S3_MODEL_PREFIX=models/my-model
DR_TRAIN_START_POSITION_OFFSET=0.25
DR_TRAIN_ROUND_ROBIN_ADVANCE_DIST=0.1
DR_TRAIN_MIN_EVAL_TRIALS=7
DR_TRAIN_BEST_MODEL_METRIC=reward
DR_EVAL_NUMBER_OF_TRIALS=5
DR_EVAL_MAX_RESETS=30
DR_EVAL_OFF_TRACK_PENALTY=3.0
DR_EVAL_RESET_BEHIND_DIST=-0.5
DR_OA_NUMBER_OF_OBSTACLES=6
"""
OBJECTS = "DR_WORLD_NAME=w\nDR_RACE_TYPE=OBJECT_AVOIDANCE\nDR_OA_NUMBER_OF_OBSTACLES=4\n"
BOTS = "DR_WORLD_NAME=w\nDR_RACE_TYPE=HEAD_TO_BOT\nDR_H2B_NUMBER_OF_BOT_CARS=3\n"


def read(tmp_path, text):
    path = tmp_path / "run.env"
    path.write_text(text)
    return read_run_env(path)


@pytest.fixture
def run(tmp_path):
    """A folder with a run's settings and files."""
    folder = tmp_path / "custom_files"
    folder.mkdir()
    (tmp_path / "run.env").write_text(TRIAL)
    shutil.copy(TRACK, folder / "my_world.npy")
    (folder / "reward_function.py").write_text("def reward_function(params):\n    return 1.0\n")
    actions = [{"steering_angle": 0, "speed": 1}, {"steering_angle": 20, "speed": 2}]
    (folder / "model_metadata.json").write_text(json.dumps({"action_space": actions}))
    (folder / "hyperparameters.json").write_text(json.dumps({"batch_size": 128, "num_epochs": 4}))
    return tmp_path


def test_a_run_becomes_a_card_beside_its_files(repaint, run):
    said = repaint("tasks", "from-drfc", run / "run.env", run / "custom_files")
    assert said.code == 0, said.err
    card = read_task(str(run / "custom_files" / "my-model.toml"))
    assert card.env.track == str(run / "custom_files" / "my_world.npy")
    assert card.env.car == "sim5"
    assert card.env.actions == ((0, 1), (20, 2))
    assert (card.env.start_offset, card.env.start_spacing) == (0.25, 0.1)
    assert (card.ppo.minibatch_size, card.ppo.n_epochs) == (128, 4)
    assert card.reward_code.name == "reward_function.py"
    evaluated = card.eval
    assert (evaluated.episodes, evaluated.best, evaluated.laps) == (7, "return", 5)
    assert (evaluated.max_resets, evaluated.off_track_penalty) == (30, 3.0)
    assert evaluated.reset_behind == -0.5
    assert (card.env.n_boxes, card.env.n_bots) == (0, 0)
    text = (run / "custom_files" / "my-model.toml").read_text()
    assert "# DR_DISPLAY_NAME = Fast: it changes nothing that is simulated" in text
    assert "# DR_OA_NUMBER_OF_OBSTACLES = 6: it is of the race type OBJECT_AVOIDANCE" in text
    assert "3 settings have no counterpart" in said.out
    assert "next: repaint tasks check" in said.out


def test_the_card_may_lie_elsewhere(repaint, run):
    output = run / "mine" / "card.toml"
    output.parent.mkdir()
    words = ("--output", output, "--track", run / "custom_files" / "my_world.npy")
    assert repaint("tasks", "from-drfc", run / "run.env", run / "custom_files", *words).code == 0
    env = tomllib.loads(output.read_text())["env"]
    assert env["track"] == "../custom_files/my_world.npy"
    assert read_task(str(output)).env.actions == ((0, 1), (20, 2))


def test_boxes_have_drfcs_defaults(tmp_path):
    card = read(tmp_path, OBJECTS).card
    assert card == {"env.n_boxes": 4, "env.object_gap": 2.0, "env.random_objects": False}
    places = read(tmp_path, OBJECTS + 'DR_OA_OBJECT_POSITIONS="0.23,-1;0.46,1"\n').card
    assert (places["env.n_boxes"], places["env.object_places"]) == (2, [[0.23, -1], [0.46, 1]])
    given = read(tmp_path, OBJECTS + 'DR_OA_OBJECT_POSITIONS="0.23,-1"\n')
    (why,) = given.unread.values()
    assert why == "DR_OA_OBJECT_POSITIONS = 0.23,-1 outranks it"
    cars = read(tmp_path, OBJECTS + "DR_OA_IS_OBSTACLE_BOT_CAR=True\n").card
    assert (cars["env.n_bots"], cars["env.bot_speed"], cars["env.crash"]) == (4, 0.0, "any")
    assert "env.n_boxes" not in cars


def test_bots_have_drfcs_defaults(tmp_path):
    assert read(tmp_path, BOTS).card == {
        "env.n_bots": 3, "env.object_gap": 2.0, "env.random_objects": False, "env.bot_speed": 0.2,
        "env.bot_lane_changes": False, "env.bot_change_length": 1.0, "env.bot_waits": [3.0, 5.0],
    }  # fmt: skip
    more = "DR_H2B_IS_LANE_CHANGE=True\nDR_H2B_LOWER_LANE_CHANGE_TIME=1.5\n"
    changing = read(tmp_path, BOTS + more).card
    assert (changing["env.bot_lane_changes"], changing["env.bot_waits"]) == (True, [1.5, 5.0])


@pytest.mark.parametrize(
    ("line", "wanted"),
    [
        ("DR_TRAIN_CHANGE_START_POSITION=False", {"env.start_spacing": 0.0}),
        ("DR_TRAIN_REVERSE_DIRECTION=True", {"env.direction": "reverse"}),
        ("DR_TRAIN_ALTERNATE_DRIVING_DIRECTION=True", {"env.direction": "alternate"}),
        ("DR_EVAL_IS_CONTINUOUS=False", {"eval.max_resets": 0}),
        ("DR_TRAIN_BEST_MODEL_METRIC=progress", {"eval.best": "progress"}),
        ("DR_TRAIN_MAX_STEPS_PER_ITERATION=9000", {"ppo.max_steps": 9000}),
        ("DR_ENABLE_DOMAIN_RANDOMIZATION=True", {"env.random_light": 0.3,
                                                 "env.random_colours": 0.1}),
        ("DR_TRAIN_MIN_EVAL_TRIALS=", {}),
    ],
)  # fmt: skip
def test_each_setting_has_its_counterpart(tmp_path, line, wanted):
    settings = read(tmp_path, f"DR_WORLD_NAME=w\n{line}\n")
    assert settings.card == wanted
    assert settings.unread == {}


def test_each_setting_without_one_has_its_reason(tmp_path):
    names = ("DR_EVAL_OPP_CAR_NAME", "DR_LOCAL_S3_BUCKET", "DR_LOCAL_S3_PRETRAINED", "MY_OWN")
    settings = read(tmp_path, "DR_WORLD_NAME=w\n" + "".join(f"{name}=1\n" for name in names))
    reasons = list(settings.unread.values())
    for reason, words in zip(reasons, ("another model", "local files", "repaint transfer",
                                       "not DeepRacer-for-Cloud's"), strict=True):  # fmt: skip
        assert words in reason


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected DR_WORLD_NAME"),
        ("DR_WORLD_NAME=w\nDR_RACE_TYPE=HEAD_TO_MODEL", "expected DR_RACE_TYPE to be one of"),
        ("DR_WORLD_NAME=w\nnonsense", "run.env:2: expected NAME=value, found 'nonsense'"),
        ("DR_WORLD_NAME='w", "run.env:1: expected NAME=value"),
        (OBJECTS + "DR_OA_OBJECT_POSITIONS=here", "DR_OA_OBJECT_POSITIONS has a value that"),
        ("DR_WORLD_NAME=w\nDR_EVAL_IS_CONTINUOUS=perhaps", "DR_EVAL_IS_CONTINUOUS has a value"),
        ("DR_WORLD_NAME=w\nDR_TRAIN_BEST_MODEL_METRIC=luck", "cannot have, 'luck'"),
    ],
)
def test_what_cannot_be_read_is_named(tmp_path, text, words):
    with pytest.raises(CardError) as error:
        read(tmp_path, text)
    assert words in str(error.value)


def test_empty_settings_are_absent_ones(tmp_path):
    text = OBJECTS + "DR_OA_IS_OBSTACLE_BOT_CAR=\nDR_RACE_TYPE=OBJECT_AVOIDANCE\n"
    settings = read(tmp_path, text + "DR_LOCAL_S3_MODEL_PREFIX=\nDR_EVAL_IS_CONTINUOUS=\n")
    assert settings.model == "my-task"
    assert settings.card["env.n_boxes"] == 4
    cars = OBJECTS + "DR_OA_NUMBER_OF_OBSTACLES=\nDR_OA_IS_OBSTACLE_BOT_CAR=True\n"
    assert read(tmp_path, cars).card["env.n_bots"] == 0


def test_a_folder_without_a_reward_function_is_refused(repaint, run):
    (run / "custom_files" / "reward_function.py").unlink()
    said = repaint("tasks", "from-drfc", run / "run.env", run / "custom_files")
    assert said.code == NotFound.exit_code
    assert "reward_function.py, found none; name its folder" in said.err
    assert not (run / "custom_files" / "my-model.toml").exists()


def test_what_else_is_absent_is_said(repaint, run):
    (run / "custom_files" / "hyperparameters.json").unlink()
    said = repaint("tasks", "from-drfc", run / "run.env", run / "custom_files")
    assert said.code == 0
    assert "hyperparameters.json is absent: the card has racer-inner's" in said.out


def test_nothing_is_written_where_something_is_missing_or_there(repaint, run):
    command = ("tasks", "from-drfc", run / "run.env", run / "custom_files")
    track = run / "custom_files" / "my_world.npy"
    track.rename(run / "elsewhere.npy")
    said = repaint(*command)
    assert said.code == NotFound.exit_code
    assert "--track FILE names them elsewhere" in said.err
    (run / "elsewhere.npy").rename(track)
    (run / "custom_files" / "model_metadata.json").write_text("{")
    assert repaint(*command).code == CardError.exit_code
    card = run / "custom_files" / "my-model.toml"
    assert not card.exists()
    card.write_text("mine")
    said = repaint(*command)
    assert said.code == StoreError.exit_code
    assert card.read_text() == "mine"


def test_the_example_becomes_a_card(tmp_path):
    """That of `make demo-deepracer`; its track is a shipped one."""
    example = Path(__file__).parents[1] / "examples" / "deepracer"
    folder = example / "custom_files"
    settings = read_run_env(example / "run.env")
    track = track_of(settings.world, folder, None)
    text = card_text(settings, example / "run.env", folder, track, tmp_path / "card.toml")
    (tmp_path / "card.toml").write_text(text)
    card = read_task(str(tmp_path / "card.toml"))
    shipped = read_task("racer-inner")
    assert card.env.track == "reinvent-like"
    assert card.env.actions == shipped.env.actions  # so that a shipped driver teaches it
    other = read_task(str(example / "faster.toml"))
    assert (other.env.track, other.env.actions) == (card.env.track, card.env.actions)
