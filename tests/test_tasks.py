"""Task cards: read, extended, changed, copied."""

import json
from pathlib import Path
from shutil import copyfile

import gymnasium
import numpy as np
import pytest
from small_tasks import Reach, guess, reach

from repaint_cli.errors import CardError, NotFound
from repaint_cli.files.paths import shipped_tasks
from repaint_cli.tasks.card import TaskCard
from repaint_cli.tasks.card_files import read_task
from repaint_cli.tasks.card_text import to_toml

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "tracks"

gymnasium.register("repaint-tests/Endless-v0", Reach, disable_env_checker=True)

CARD = """
summary = "A test."
[env]
simulator = "gymnasium"
id = "Reacher-v5"
[reward]
reward_dist = 1.0
"""


@pytest.fixture
def card(home):
    """Write a card and read it as a user's."""

    def write(text):
        (home / "mine.toml").write_text(text)
        return read_task("mine.toml")

    return write


def test_a_card_is_named_after_its_file(card):
    assert card(CARD).name == "mine"
    assert {read_task(name).name for name in shipped_tasks()} == set(shipped_tasks())


def test_a_card_that_extends_another_says_only_what_is_new(card):
    mine, base = card('extends = "reacher"\n[reward]\nreward_ctrl = 2\n'), read_task("reacher")
    assert mine.reward == {"reward_dist": 1.0, "reward_ctrl": 2.0}
    assert mine.model_copy(update={"name": base.name, "reward": base.reward}) == base


@pytest.mark.parametrize("base", ['"racher"', '["reacher"]', "1"])
def test_a_card_extends_only_shipped_ones(card, base):
    with pytest.raises(NotFound, match=r"unknown task .* see: repaint tasks list"):
        card(f"extends = {base}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (CARD + "[ppo]\ngama = 0.9", r"mine\.toml: unknown key 'ppo\.gama'"),
        (CARD.replace("id =", "identity ="), r"env\.id: Field required"),
        (CARD.replace("[reward]", 'track = "oval"\n[reward]'), r"unknown key 'env\.track'"),
        (CARD.replace("gymnasium", "mujoco"), r"env: .*'gymnasium', 'racer'.*"),
        (
            CARD.replace('"gymnasium"', '["gymnasium"]'),
            "env: expected simulator to be one of",
        ),
        (CARD.replace('"gymnasium"', "{}"), "env: expected simulator to be one of"),
        (
            'extends = "reacher"\n[env]\nsimulator = ["racer"]',
            "env: expected simulator to be one of",
        ),
        (CARD.replace('simulator = "gymnasium"', ""), "env: expected simulator to be one of"),
        (CARD.replace("1.0", "nan"), r"reward\.reward_dist: .* finite number, found nan"),
        (CARD.replace("1.0", "0"), "reward: at least one weight must differ from 0"),
        (CARD.replace("reward_dist = 1.0", ""), "reward: at least one weight must differ from 0"),
        (CARD + "[ppo]\ngamma = 1.5", r"ppo\.gamma: .* less than or equal to 1, found 1\.5"),
        ("summary = ", "mine.toml: Invalid value"),
        ('extends = "reacher"\n[summary]\nx = 1', "summary: .* valid string"),
        ('extends = "reacher"\nreward = 1', "reward: .* valid dictionary"),
    ],
)
def test_a_wrong_card_is_refused_with_the_key(card, text, message):
    with pytest.raises(CardError, match=message) as caught:
        card(text)
    assert "\n" not in str(caught.value)


def test_a_card_that_is_not_text_is_refused(home):
    (home / "mine.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(CardError, match=r"mine\.toml: .*utf-8"):
        read_task("mine.toml")


@pytest.mark.parametrize(
    ("setting", "section", "value"),
    [
        ("env.backend=gymnasium", "env", "gymnasium"),
        ("reward.reward_ctrl=-2", "reward", -2.0),
        ("net.hidden=[32, 16]", "net", (32, 16)),
        ("ppo.gamma=0.98", "ppo", 0.98),
        ("transfer.alpha_1=0.5", "transfer", 0.5),
        ("select.scale=student-batch", "select", "student-batch"),
        ("eval.episodes=3", "eval", 3),
    ],
)
def test_a_setting_of_any_section_changes_that_and_nothing_else(setting, section, value):
    before = read_task("reacher")
    after = before.with_settings([setting])
    key = setting.partition(".")[2].partition("=")[0]
    was, now = before.model_dump(), after.model_dump()
    assert now[section].pop(key) == value
    assert was[section].pop(key) != value
    assert was == now


def test_of_two_settings_the_last_counts():
    assert read_task("reacher").with_settings(["ppo.gamma=0.5", "ppo.gamma=0.7"]).ppo.gamma == 0.7


def test_settings_that_depend_on_each_other_are_checked_together():
    settings = ["reward.reward_dist=0", "reward.reward_ctrl=2"]
    assert read_task("reacher").with_settings(settings).reward["reward_ctrl"] == 2


@pytest.mark.parametrize("name", sorted(shipped_tasks()))
def test_a_copied_card_is_the_same_task(repaint, home, name):
    assert repaint("tasks", "copy", name, "copy.toml").code == 0
    copy = read_task("copy.toml")
    assert copy.name == "copy"
    assert copy.model_copy(update={"name": name}) == read_task(name)


@pytest.mark.parametrize("name", sorted(shipped_tasks()))
def test_a_shown_card_is_the_same_card_in_80_columns(repaint, home, name):
    shown = repaint("tasks", "show", name).out
    (home / f"{name}.toml").write_text(shown)
    assert read_task(f"{name}.toml") == read_task(name)
    lines = shown.splitlines()
    assert max(len(line) for line in lines if not line.startswith("summary")) <= 80
    keys = [line.partition(" ")[0] for line in lines if line and line[0] not in "#[] "]
    absent = [line.split()[1] for line in lines if line.endswith(" is absent")]
    data = read_task(name).model_dump(exclude={"name", "reward_code"})
    sections = [part for part in data.values() if isinstance(part, dict)]
    assert sorted(keys + absent) == sorted(["summary", *(key for part in sections for key in part)])


def test_a_shown_card_of_ones_own_is_the_same_card(repaint, home, monkeypatch):
    (home / "reward.py").write_text("def reward_function(params):\n\treturn 1.0  # é\n")
    card = 'extends = "racer-inner"\nsummary = "odd \\u001b[2J \\u202e, \\\\ and é"\n'
    (home / "own.toml").write_text(card + '[reward]\nfunction = "reward.py"\n')
    shown = repaint("tasks", "show", "own.toml").out
    assert shown.replace("\n", "").isprintable()
    (home / "copies").mkdir()
    (home / "copies" / "own.toml").write_text(shown)
    assert read_task("copies/own.toml") == read_task("own.toml")
    monkeypatch.setenv("FORCE_COLOR", "1")
    assert repaint("tasks", "show", "own.toml").out == shown  # a file has no colours


def test_a_list_fits_a_terminal_and_80_columns_in_a_file(repaint, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    whole = repaint("tasks", "list").out
    monkeypatch.delenv("COLUMNS")
    wrapped = repaint("tasks", "list").out
    assert max(map(len, wrapped.splitlines())) <= 80
    assert len(wrapped.splitlines()) > len(whole.splitlines())
    assert sorted(wrapped.split()) == sorted(whole.split())


def test_toml_keeps_odd_names_and_texts(home):
    odd = reach().model_copy(
        update={"summary": 'say "a\\b"\n\té', "reward": {"run/x": 1.0, "two words": -1e-9}}
    )
    (home / "reach.toml").write_text(to_toml(odd))
    assert read_task("reach.toml") == odd


def test_toml_keeps_arguments_and_shapes(home):
    task = guess(image=True)
    (home / "guess.toml").write_text(to_toml(task))
    assert read_task("guess.toml") == task


def test_a_card_survives_json():
    for name in shipped_tasks():
        card = read_task(name)
        assert TaskCard.parse(json.loads(card.model_dump_json()), "json") == card


@pytest.mark.parametrize(
    ("settings", "advice"),
    [
        (["ppo.n_envs=41"], "at least 51 .* found 2048 / 41; try --set ppo.n_envs=40$"),
        (["ppo.n_steps=50"], "found 50 / 40; try --set ppo.n_envs=1 --set ppo.n_steps=51$"),
        (["ppo.n_steps=39"], "expected ppo.n_steps of at least ppo.n_envs, a step of .*, found "
         "39 and 40; try --set ppo.n_envs=39$"),
    ],
)  # fmt: skip
def test_what_is_too_short_for_a_rollout_is_refused_and_the_advice_works(settings, advice):
    card = read_task("reacher").with_settings(settings)
    if "n_steps=39" not in settings[0]:
        card.check_rollout()  # goes on with its episodes
        card = card.with_settings(["ppo.continue_episodes=false"])
    with pytest.raises(CardError, match=advice) as caught:
        card.check_rollout()
    advised = card.with_settings(str(caught.value).partition("try --set ")[2].split(" --set "))
    advised.check_rollout()


@pytest.mark.parametrize(
    ("env_id", "message"),
    [
        ("repaint-tests/Endless-v0", "has no time limit, .* register it with max_episode_steps"),
        ("Nothing-v0", "gymnasium has no environment 'Nothing-v0'"),
        ("nothing:Nothing-v0", "gymnasium has no environment 'nothing:Nothing-v0'"),
    ],
)
def test_environments_must_exist_and_end(env_id, message):
    with pytest.raises(CardError, match=message):
        read_task("reacher").with_settings([f"env.id={env_id}"]).check_rollout()


def test_evaluation_starts_are_spread_and_training_starts_go_on():
    card = read_task("racer-inner")
    assert card.start_options(2, 4, None)["lap_fraction"] == [0, 0.25, 0.5, 0.75] * 2
    first, second = (card.start_options(1, 3, k)["lap_fraction"] for k in (1, 2))
    assert first + second == pytest.approx([0, 0.05, 0.1, 0.15, 0.2, 0.25])
    assert read_task("reacher").start_options(2, 4, None) is None


def test_tasks_check_says_what_a_sound_card_is(repaint):
    said = repaint("tasks", "check", "reacher")
    assert said.code == 0
    assert "reacher is sound: 10 observations and 2 continuous actions" in said.out
    assert "reward_dist -0." in said.out


def test_tasks_list_and_show_name_everything(repaint):
    head, *lines = repaint("tasks", "list").out.splitlines()
    listed = [line for line in lines if not line.startswith(" ")]
    assert head.split() == ["task", "simulator", "training", "what", "it", "is"]
    assert [line.split()[0] for line in listed] == list(shipped_tasks())
    (inner,) = (line for line in listed if line.startswith("racer-inner "))
    assert inner.split(maxsplit=6)[1:6] == ["racer", "70", "×", "20", "episodes"]
    shown = repaint("tasks", "show", "racer-inner").out
    for word in (
        "[ppo]",
        "gamma = 0.999",
        "lane = 1.0",
        'track = "reinvent-like"',
        "γ, the discount",
    ):
        assert word in shown


def real(name):
    path = REAL / f"{name}.npy"
    if not path.exists():
        pytest.skip(f"needs {path}, a track of DeepRacer's")
    return path


@pytest.mark.parametrize("name", ["Albert", "Oval_track", "Tokyo_Training_track", "reinvent_base"])
def test_a_file_of_waypoints_is_a_track(name):
    task = read_task("racer-inner").with_settings([f"env.track={real(name)}", "env.max_steps=5"])
    env = task.make_env(2)
    images, _ = env.reset(seed=[1, 2])
    assert images.std() > 10
    env.step(np.full(2, 7))


def test_a_tracks_file_is_found_from_other_folders(home, monkeypatch):
    np.save(home / "mine.npy", np.load(TRACKS / "oval.npy"))
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\nsummary = "x"\n[env]\ntrack = "mine.npy"\n'
    )
    by_card = read_task("mine.toml")
    by_option = read_task("racer-inner").with_settings(["env.track=mine.npy"])
    (home / "elsewhere").mkdir()
    monkeypatch.chdir(home / "elsewhere")
    for task in (by_card, by_option):
        assert task.make_env(1).unwrapped.tracks[0].length == pytest.approx(12)


def test_checking_a_track_says_what_it_is_and_draws_it(repaint, home):
    copyfile(real("Albert"), "mine.npy")
    said = repaint("tasks", "check", "mine.npy")
    assert said.code == 0
    assert "51.39 m long, 1.067 m wide, driven clockwise, tightest radius 0.84 m" in said.out
    assert (home / "mine.png").read_bytes().startswith(b"\x89PNG")


def nearly_closed():
    """The oval whose borders end 2 cm beside their start."""
    rows = np.load(TRACKS / "oval.npy")
    rows[-1, 2:] += 0.02
    return rows


def test_what_was_mended_in_a_track_is_said_where_it_is_checked_and_trained_on(repaint, home):
    np.save("mine.npy", nearly_closed())
    said = repaint("tasks", "check", "mine.npy")
    assert (said.code, said.err) == (0, "")
    note = "closed by moving row 100 onto row 0, 28 mm away (rows count from 0)"
    assert f"\nnote: {note}\n" in said.out
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\n[env]\ntrack = "mine.npy"\nmax_steps = 20\n'
    )
    said = repaint("tasks", "check", "mine.toml")
    assert said.code == 0
    assert said.out.startswith("warning: no lap can be finished: it ")
    assert f"\nnote: track 'mine': {note}\n" in said.out
    assert "takes 180 steps at the fastest action's 1 m/s, and env.max_steps is 20; " in said.out
    card = read_task("mine.toml")
    assert card.env.notes() == [f"track 'mine': {note}"]
    assert read_task("racer-inner").env.notes() == []


@pytest.mark.parametrize("write", [
    lambda path: path.write_text("x, y"),
    lambda path: path.write_bytes(b""),
    lambda path: np.save(path, {"x": 1}, allow_pickle=True),
])  # fmt: skip
def test_a_file_that_is_no_array_is_no_track(repaint, home, write):
    write(home / "mine.npy")
    said = repaint("tasks", "check", "mine.npy")
    assert (said.code, said.err.count("\n")) == (3, 1)
    assert "expected an array (N, 6) of waypoints" in said.err


def test_waypoints_that_are_no_road_say_why(repaint, home):
    np.save(home / "mine.npy", np.zeros((9, 4)))
    said = repaint("tasks", "check", "mine.npy")
    assert said.code == 3
    assert (
        "error: mine.npy: track 'mine': expected an array of shape (N, 6), found (9, 4)" in said.err
    )
    assert repaint("tasks", "check", "none.npy").code == 2
