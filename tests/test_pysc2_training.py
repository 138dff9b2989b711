"""Training in the game itself, and it beside our simulator, on PySC2's test environment."""

import numpy as np
import pytest
from small_pysc2 import SCV, frame, play

from repaint_cli.envs.starcraft import engines
from repaint_cli.envs.starcraft.pysc2 import maps
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.tasks.card_files import read_task

__all__ = ["play"]

STEPS = 6
SHORT = (
    "env.engine=pysc2", "env.camera=map", "env.minutes=0.05", "net.conv=[[2,8,8],[4,4,2]]",
    "net.vector=4", "net.dense=8", "ppo.n_epochs=1",
)  # fmt: skip
N_EPISODES, EVALUATED, SCORED = 2, 4, 2
"""What the shipped card plays at once: in a rollout, in an evaluation, and in a score."""


class Passing:
    """Frames of a game in which nothing happens but that time passes."""

    def __init__(self, **settings):
        self.response = frame(**settings)

    def __len__(self):
        return 1_000_000

    def __getitem__(self, i):
        self.response.observation.game_loop = 8 * i
        return self.response


def base():
    """Layers that show a command centre and an SCV."""
    types = np.zeros((84, 84), int)
    types[24:43, 20:40], types[30, 12] = 18, SCV
    return {"unit_type": types, "player_relative": (types > 0).astype(int)}


@pytest.fixture
def games(play):
    """The class of the game's processes, which keeps how many there were, and at most at once."""
    made = play()
    made.script, made.most = Passing(layers=base(), abilities=(319, 524)), 0
    first = made.__init__

    def count(self, **settings):
        first(self, **settings)
        made.most = max(made.most, sum(not one.closed for one in made.made))

    made.__init__ = count
    return made


def test_both_engines_play_a_build_order_to_the_same_end(games, monkeypatch):
    ends = []

    def timelines(engine, **settings):
        events = list(real(engine, **settings))
        ends.append(events[-1].loop)
        return events

    real = engines.timelines
    monkeypatch.setattr(engines, "timelines", timelines)
    monkeypatch.setattr(maps, "SAFE_LOOPS", 80)  # of a process that plays all episodes
    settings = {"simulator": "starcraft", "engine": "pysc2", "game_process": "one", "minutes": 0.2}
    lines = engines.side_by_side(StarCraftSimulator(**settings), "pysc2")
    assert ends == [192] * 2
    assert lines[0].split() == ["pysc2,", "s", "mini,", "s"]
    assert games.made[0].settings["agent_interface_format"].camera_width_world_units == 24


def test_the_shipped_card_trains_in_the_game(home, repaint, games):
    settings = [word for setting in SHORT for word in ("--set", setting)]
    said = repaint("train-teacher", "--task", "build-marines", "--iterations", 2, *settings)
    assert said.code == 0, said.err
    assert games.most == EVALUATED
    assert all(game.closed for game in games.made)
    assert len(games.made) == 1 + 2 * N_EPISODES + 2 * EVALUATED + SCORED
    looked_at, *played = (len(game.calls) for game in games.made)  # to see that it starts
    assert (looked_at, set(played)) == (1, {STEPS})


@pytest.mark.parametrize(("process", "minutes", "steps"), [
    ("each", None, 1800), ("one", None, 1680), ("one", 2, 240),
])  # fmt: skip
def test_an_episode_is_as_long_as_it_is_said_to_be(games, process, minutes, steps):
    env = StarCraftSimulator(
        simulator="starcraft", engine="pysc2", game_process=process, minutes=minutes
    )
    assert env.longest_episode() == steps
    env.make(1, True, None).reset(seed=1)
    assert games.made[0].settings["game_steps_per_episode"] == 8 * steps


def test_a_score_starts_few_games(games):
    assert read_task("build-marines").env.score_episodes == 20
    game = read_task("build-marines").with_settings(list(SHORT))
    assert game.env.score_episodes == SCORED
