"""Settings of the mini-games: what they choose, and what is refused in a line."""

import re
from pathlib import Path

import pytest

from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.errors import CardError
from repaint_cli.tasks.card_files import read_task

FIND = "find-and-defeat-zerglings"
GAME = "build-marines env.camera=map env.engine=pysc2"
GAME_FIND = f"{FIND} env.engine=pysc2"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (["env.map=the-moon"], "env.map: .*'build-marines'.* found 'the-moon'"),
        (["env.map_size=-60"], "env.map_size: .* greater than or equal to 40, found -60"),
        (["env.map=build-marines", "env.map_size=50"], "the map build-marines has its own"),
        (["env.scvs=0"], "env.scvs: .* greater than or equal to 1, found 0"),
        (["env.scvs=65"], "env.scvs: .* less than or equal to 64, found 65"),
        (["env.minutes=0"], "env.minutes: .* greater than or equal to 0.01, found 0"),
        (["env.minutes=-1"], "env.minutes: .* found -1"),
        (["env.minerals=0"], "env.minerals: .* found 0"),
        (["env.zerglings=0"], "env.zerglings: .* found 0"),
        (["env.zerglings=41"], "env.zerglings: .* found 41"),
        (["env.map=build-marines", "env.zerglings=3"], "no zerglings on the map build-marines"),
        (["env.engine=fake"], "env.engine: .* found 'fake'"),
        (["env.layers=all"], "env.layers: .* found 'all'"),
        (["env.award_on=start"], "env.award_on: .* found 'start'"),
        (["env.scv_after_build=dance"], "env.scv_after_build: .* found 'dance'"),
    ],
)  # fmt: skip
def test_a_game_that_cannot_be_is_refused_in_a_line(settings, message):
    with pytest.raises(CardError, match=message) as caught:
        read_task("build-marines-fdz").with_settings(settings)
    assert "\n" not in str(caught.value)


def test_settings_reach_the_map():
    env = StarCraftSimulator(
        simulator="starcraft", map="build-marines-fdz", map_size=50, minutes=2, scvs=3,
        minerals=1800, scv_after_build="mine", award_on="order", illegal_site="ignored",
        zerglings=7, respawn=False,
    )  # fmt: skip
    spec = env.spec
    assert spec.region == (7, 7, 57, 57)
    assert spec.camera.width == 52
    assert (spec.steps, spec.start_scvs, spec.minerals, spec.zerglings) == (240, 3, 1800, 7)
    assert (spec.scv_after_build, spec.award_on) == ("mine", "order")
    assert not spec.respawn
    assert not spec.illegal_site_is_unavailable


@pytest.mark.parametrize(
    ("task", "steps"),
    [("build-marines", 1800), ("build-marines-fdz", 1800), ("find-and-defeat-zerglings", 360)],
)
def test_games_last_as_long_as_the_maps_scripts_say(task, steps):
    assert read_task(task).env.longest_episode() == steps


def test_what_follows_from_the_map_may_be_said():
    task = read_task("build-marines-fdz")
    said = task.with_settings(["env.minutes=15", "env.zerglings=40", "env.map_size=60"])
    assert said.task == task.task
    assert said.with_settings(["env.zerglings=39"]).task != task.task
    assert read_task("build-marines").env.settled().map_size is None


def test_the_larger_maps_camera_shows_62_units_whatever_the_maps_size():
    task = read_task("build-marines-fdz")
    assert task.env.camera == "large"
    assert task.with_settings(["env.camera=map"]).task == task.task
    small = task.with_settings(["env.map_size=40"])
    assert small.env.spec.camera == task.env.spec.camera == (32, 32, 62)
    own = small.with_settings(["env.camera=map"])
    assert own.env.spec.camera == (32, 32, 42)
    assert own.task != small.task
    marines = read_task("build-marines")
    assert marines.with_settings(["env.camera=map"]).task != marines.task


# -- settings that nobody reads


@pytest.mark.parametrize(
    ("task", "settings", "message"),
    [
        ("build-marines", ['env.game_version="4.10"'], "no env.game_version, as only env.engine"),
        ("build-marines", ["env.game_process=one"], "env.game_process=each, as only env.engine"),
        ("build-marines", ["env.map_file=a.SC2Map"], "no env.map_file, as only env.engine pysc2"),
        ("build-marines", ["env.respawn=false"], "env.respawn=true, as there are no zerglings on"),
        (FIND, ["env.scvs=3"], f"expected env.scvs=12, as nothing is built on the map {FIND}"),
        (FIND, ["env.minerals=9"], "env.minerals=1500, as nothing is built"),
        (FIND, ["env.scv_after_build=mine"], "env.scv_after_build=idle, as nothing is built"),
        (FIND, ["env.award_on=order"], "env.award_on=complete, as nothing is built"),
        (FIND, ["env.illegal_site=ignored"], "env.illegal_site=unavailable, as nothing is built"),
        (GAME, ["env.scvs=3"], "expected env.scvs=12, as only env.engine mini reads it"),
        (GAME, ["env.illegal_site=ignored"], "env.illegal_site=unavailable, as only env.engine"),
        (GAME_FIND, ["env.zerglings=3"], "expected no env.zerglings, as only env.engine mini"),
        (GAME_FIND, ["env.respawn=false"], "env.respawn=true, as only env.engine mini reads it"),
    ],
)
def test_a_setting_that_nobody_reads_is_refused(task, settings, message):
    name, *before = task.split()
    card = read_task(name).with_settings(before)
    with pytest.raises(CardError, match=re.escape(message)):
        card.with_settings(settings)


def test_defaults_that_nobody_reads_may_be_said():
    said = ["env.scvs=12", "env.respawn=true", "env.award_on=complete", "env.game_process=each"]
    for name in ("build-marines", "build-marines-fdz", FIND):
        read_task(name).with_settings(said)
    read_task(FIND).with_settings(["env.engine=pysc2", "env.zerglings=25"])


@pytest.mark.parametrize("name", ["build-marines", FIND])
def test_the_game_itself_has_no_other_camera(name):
    task = read_task(name)
    with pytest.raises(CardError, match=r"cannot be moved; set env\.camera=map, or"):
        task.with_settings(["env.engine=pysc2", "env.camera=large"])
    for setting in ("env.camera=map", "env.map_file=mine.SC2Map"):
        assert task.with_settings(["env.engine=pysc2", setting]).env.engine == "pysc2"


def test_a_version_without_quotation_marks_is_refused():
    task = read_task("build-marines").with_settings(["env.camera=map", "env.engine=pysc2"])
    with pytest.raises(CardError, match=r"as in --set 'env\.game_version=\"4\.10\"', found 4\.1"):
        task.with_settings(["env.game_version=4.10"])
    assert task.with_settings(['env.game_version="4.10"']).env.game_version == "4.10"


def test_a_map_in_ones_home_folder_is_found(home, monkeypatch):
    monkeypatch.setenv("HOME", str(home / "me"))
    for card in ("here", "elsewhere/there"):
        path = home / f"{card}.toml"
        path.parent.mkdir(exist_ok=True)
        text = 'extends = "build-marines"\nsummary = "It."\n[env]\nengine = "pysc2"\n'
        path.write_text(text + 'map_file = "~/mine.SC2Map"\n')
        assert read_task(f"{card}.toml").env.map_file == str(home / "me" / "mine.SC2Map")
    task = read_task("here.toml").with_settings(["env.map_file=~/other.SC2Map"])
    assert task.env.map_file == str(home / "me" / "other.SC2Map")


def test_the_cards_of_the_manual_can_be_read(home):
    page = (Path(__file__).parents[1] / "docs" / "starcraft-real.md").read_text(encoding="utf-8")
    cards = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    assert len(cards) == 2
    for text in cards:
        (home / "my-game.toml").write_text(text)
        assert read_task("my-game.toml").env.engine == "pysc2"
