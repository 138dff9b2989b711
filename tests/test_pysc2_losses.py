"""Games that are lost, restarted and started anew: what is kept, and what is said."""

import numpy as np
import pytest
from small_pysc2 import SCV, frame, play, unit

from repaint_cli.envs.output import Output, output_to
from repaint_cli.envs.starcraft.pysc2.engine import RealEngine
from repaint_cli.envs.starcraft.rts.maps import MAPS
from repaint_cli.errors import GameError

__all__ = ["play"]

BUILD = MAPS["build-marines"]
CLICK = np.array([[4, 10, 20]], np.int16)


class Warnings(Output):
    """Keeps warnings."""

    def __init__(self):
        super().__init__()
        self.kept = []

    def warns(self, text):
        self.kept.append(text)


@pytest.fixture
def said():
    output = Warnings()
    with output_to(output):
        yield output.kept


def gone():
    from pysc2.lib import protocol

    return protocol.ConnectionError("Connection already closed. SC2 probably crashed.")


def ended(engine):
    """How a click ended the only game's episode."""
    terms, terminated, truncated = engine.step(CLICK)
    assert terms.shape == (1, 8)
    return terms.any(), bool(terminated[0]), bool(truncated[0])


def test_a_game_that_is_killed_cuts_its_episode_off_and_the_next_one_has_a_new_game(play, said):
    games = play(frame(0, minerals=50), frame(8, minerals=60), gone(), frame(0))
    engine = RealEngine(BUILD, 1)
    engine.reset(np.array([7]))
    assert ended(engine) == (True, False, False)
    assert ended(engine) == (False, False, True)
    assert engine.observe().measurements[0, 0] == 60  # the last one that was seen
    assert said == [
        "StarCraft II was lost in game 1 at step 2 (Connection already closed. SC2 probably "
        "crashed.); the episode is cut off there, and the next one starts the game anew"
    ]
    assert [game.closed for game in games.made] == [True]
    engine.reset(np.array([8]))
    assert [game.settings["random_seed"] for game in games.made] == [7, 8]
    assert ended(engine) == (True, False, False)


def failures():
    """What PySC2 and its connection raise of a game that goes wrong in an episode."""
    import websocket
    from pysc2.lib import protocol, remote_controller

    return [
        protocol.ProtocolError("it says so"), remote_controller.RequestError("it says so", None),
        websocket.WebSocketProtocolException("it says so"), RuntimeError("it says so"),
    ]  # fmt: skip


@pytest.mark.parametrize("error", failures(), ids=lambda error: type(error).__name__)
def test_an_answer_that_is_none_is_a_lost_game_too(play, said, error):
    games = play(frame(0), error)
    engine = RealEngine(BUILD, 1)
    engine.reset(np.array([0]))
    assert ended(engine) == (False, False, True)
    assert "(it says so)" in said[0]
    games.script = (frame(0), error, frame(0))
    engine.reset(np.array([1]))
    engine.reset(np.array([2]))  # the game fails between two episodes, too
    assert "between two episodes (it says so)" in said[1]
    assert len(games.made) == 3


def test_a_game_that_is_lost_between_episodes_is_started_anew(play, said):
    games = play(frame(0), gone())
    engine = RealEngine(BUILD, 1)
    engine.reset(np.array([0]))
    games.script = (frame(0, minerals=70), gone())
    games.made[0].at = 1
    engine.reset(np.array([1]))
    assert len(games.made) == 2
    assert engine.observe().measurements[0, 0] == 70
    assert said[0].startswith("StarCraft II was lost in game 1 between two episodes")


def test_three_losses_in_a_row_are_an_error(play, said):
    play(frame(0), gone())
    engine = RealEngine(BUILD, 1)
    for seed in range(2):
        engine.reset(np.array([seed]))
        assert ended(engine) == (False, False, True)
    engine.reset(np.array([2]))
    message = (
        r"^StarCraft II was lost 3 times in a row, last in game 1 at step 1 \(Connection already "
        r"closed. SC2 probably crashed.\); is there memory for as many games \(ppo.n_episodes, "
        r"eval.episodes\)\?$"
    )
    with pytest.raises(GameError, match=message):
        engine.step(CLICK)
    assert len(said) == 2


def test_a_missing_patch_starts_the_game_anew(play, said):
    workers = [unit(i, SCV) for i in range(12)]
    games = play(frame(0, workers))
    engine = RealEngine(BUILD, 1)
    engine.reset(np.array([0]))
    games.made[0].at, games.made[0].script = 0, (frame(0, workers, idle_worker_count=12),)
    engine.reset(np.array([1]))
    assert [game.closed for game in games.made] == [True, False]
    assert said == [
        "a mineral patch is missing after StarCraft II restarted the map; it starts anew"
    ]


def test_workers_that_idle_in_a_new_game_are_the_maps_own(play, said):
    games = play(frame(0, idle_worker_count=12))
    RealEngine(BUILD, 1).reset(np.array([0]))
    assert (len(games.made), said) == (1, [])


def test_a_new_process_an_episode_takes_its_seed_and_all_the_time_there_is(play, said):
    games = play(frame(0))
    engine = RealEngine(BUILD, 1, one_process=False)
    for seed in (3, 4):
        engine.reset(np.array([seed]))
    assert [game.settings["random_seed"] for game in games.made] == [3, 4]
    assert [game.settings["game_steps_per_episode"] for game in games.made] == [14_400] * 2
    assert [game.closed for game in games.made] == [True, False]


def test_a_process_is_kept_for_all_episodes(play, said):
    games = play(frame(0))
    engine = RealEngine(BUILD, 1)
    for seed in (3, 4):
        engine.reset(np.array([seed]))
    assert len(games.made) == 1


def test_what_pysc2_does_not_know_is_an_error(play, said):
    unknown = ValueError("Failed to find applicable action for ability_id: 4132")
    message = (
        r"^PySC2 does not understand this StarCraft II \(Failed to find applicable action for "
        r"ability_id: 4132\); it knows versions up to 5.0.9, and Linux has 4.10$"
    )
    play(frame(0), unknown)
    engine = RealEngine(BUILD, 1)
    engine.reset(np.array([0]))
    with pytest.raises(GameError, match=message):
        engine.step(CLICK)
    play(unknown)
    with pytest.raises(GameError, match=message):
        RealEngine(BUILD, 1).reset(np.array([0]))
