"""Films and timelines of the mini-games: what is drawn, and that episodes are played again."""

from itertools import pairwise

import numpy as np
import pytest
from starcraft_bots import BuildingBot

from repaint_cli.envs.episodes import Episodes
from repaint_cli.envs.starcraft import board, film, map_view, shapes
from repaint_cli.envs.starcraft.names import RECORDS
from repaint_cli.envs.starcraft.rts import constants as game
from repaint_cli.envs.starcraft.rts import state as states
from repaint_cli.envs.starcraft.rts.engine import MiniRTS
from repaint_cli.envs.starcraft.simulator import StarCraftSimulator
from repaint_cli.envs.starcraft.timeline import Timelines

MINUTES = 0.1
STEPS = 12


def simulator(name="build-marines", **settings):
    return StarCraftSimulator(simulator="starcraft", map=name, minutes=MINUTES, **settings)


def played(env, actions, seed=5):
    """An episode of given actions, (T, 3)."""
    n_steps = len(actions)
    rewards = np.linspace(-1, 1, n_steps)[:, None, None]
    records = {name: np.arange(n_steps, dtype=float)[:, None, None] for name in RECORDS}
    paths = env.paths.paths_of(None, records, None).positions
    return Episodes(
        returns=rewards.sum(0), lengths=np.array([[n_steps]]), terms=np.zeros((1, 1, 8)),
        rewards=rewards, actions=actions[:, None, None], records=records, env_seeds=[seed],
        paths=paths, targets=None,
    )  # fmt: skip


def pixel_of(view, x, y):
    """The pixel of the picture in which a point of the map is."""
    column, row = view._xy(x, y)
    return int(column / map_view.FINE), int(row / map_view.FINE)


def colour(text):
    return tuple(int(text[i : i + 2], 16) for i in (1, 3, 5))


@pytest.mark.parametrize("name", ["build-marines", "build-marines-fdz"])
def test_a_frame_a_step_shows_the_map_and_what_the_agent_sees(name):
    env = simulator(name)
    actions = np.random.default_rng(0).integers([7, 84, 84], size=(STEPS, 3))
    frames = list(film.frames_of(env, played(env, actions), 0, "a title " * 40))
    assert len(frames) == STEPS
    assert {frame.shape for frame in frames} == {(film.HEIGHT, film.WIDTH, 3)}
    edges = np.concatenate([frames[-1][:, [0, 1, -2, -1]].ravel(), frames[-1][[0, -1]].ravel()])
    assert (edges == 255).all()  # no text is cut off
    assert any((one != other).any() for one, other in pairwise(frames))


def test_a_film_plays_the_episode_again():
    env = simulator().model_copy(update={"minutes": 0.3})
    rts = MiniRTS(env.spec, 1)
    rts.reset(np.array([5]))
    player, actions = BuildingBot(rts, 0, 20, 7), []
    for _ in range(36):
        actions.append(player.action())
        rts.step(np.array([actions[-1]]))
    *_, last = film.frames_of(env, played(env, np.array(actions)), 0, "title")
    view = map_view.MapView(env.spec)
    shown = last[film.TITLE : film.TITLE + map_view.HEIGHT, : map_view.WIDTH]
    assert (shown == np.asarray(view.draw(rts.state.arrays[0]))).all()


def drawn(name="build-marines", **fields):
    """The view and the picture of a game whose record has these values."""
    env = simulator(name)
    rts = MiniRTS(env.spec, 1)
    rts.reset(np.array([5]))
    row = rts.state.arrays[0]
    row["scv_state"] = states.ABSENT
    for field, value in fields.items():
        places = rts.state.arrays[field]  # (1,) or (1, places)
        places[(0,) * places.ndim] = value
    view = map_view.MapView(env.spec)
    return view, np.asarray(view.draw(row))


@pytest.mark.parametrize(
    ("unit", "there", "fill"),
    [
        ("scv", {"scv_state": states.IDLE}, shapes.SCV),
        ("marine", {"marine_hp": 45.0}, shapes.MARINE),
        ("zergling", {"zergling_hp": 35.0}, shapes.ZERGLING),
    ],
)
def test_units_are_where_they_are(unit, there, fill):
    view, picture = drawn(**there, **{f"{unit}_x": 40.0, f"{unit}_y": 30.0})
    x, y = pixel_of(view, 40.0, 30.0)
    assert tuple(picture[y, x]) == colour(fill)
    assert tuple(picture[y, x + 40]) == colour(map_view.GROUND)


def test_structures_fill_up_as_they_are_built():
    built = {"depot_x": 40.0, "depot_y": 30.0, "depot_begun": 1, "depot_done": 481, "loop": 241}
    view, picture = drawn(**built)
    assert tuple(picture[pixel_of(view, 40.6, 29.4)[::-1]]) == colour(shapes.STRUCTURE)
    assert tuple(picture[pixel_of(view, 40.6, 30.6)[::-1]]) != colour(shapes.STRUCTURE)


def test_a_command_s_point_is_the_middle_of_its_pixel():
    view, picture = drawn(last_command=game.SELECT_POINT, last_x=60, last_y=20)
    world = MiniRTS(simulator().spec, 1).world[0]
    x, y = view.point_of(60, 20)
    assert int((x - world["left"]) / world["pixel"]) == 60
    assert int((world["top"] - y) / world["pixel"]) == 20
    column, row = pixel_of(view, x, y)
    assert tuple(picture[row, column + 5]) == colour(shapes.CLICK)
    view, refused = drawn(last_command=game.SELECT_POINT, last_x=60, last_y=20, last_refused=1)
    assert tuple(refused[row, column + 5]) != colour(shapes.CLICK)
    view, none = drawn(last_command=game.TRAIN_SCV, last_x=60, last_y=20)
    assert (none != picture).any()


def test_fog_is_darker_where_nothing_was_seen():
    view, picture = drawn("build-marines-fdz")
    corner, base = (picture[pixel_of(view, *point)[::-1]] for point in ((5, 5), (38, 28)))
    assert tuple(corner) == tuple(map_view.SHADES[game.HIDDEN])
    assert tuple(base) == tuple(map_view.SHADES[game.VISIBLE]) == colour(map_view.GROUND)


def test_layers_are_shown_by_name():
    layers = board.Layers(["one", "two"])
    images = [np.zeros((84, 84, 1), np.uint8), np.full((84, 84, 1), 255, np.uint8)]
    picture = np.asarray(layers.draw(images))
    dark, bright = picture[board.LABEL + 5, 5], picture[board.LABEL + 5, board.TILE + board.GAP + 5]
    assert dark.sum() < bright.sum()
    assert (picture[: board.LABEL, : board.TILE] < 128).any()


@pytest.mark.parametrize(
    ("name", "rows"),
    [("build-marines", 4), ("build-marines-fdz", 5), ("find-and-defeat-zerglings", 2)],
)
def test_timelines_show_what_a_map_has(name, rows):
    assert len(simulator(name).paths._rows) == rows


def test_timelines_are_drawn_side_by_side(tmp_path):
    env = simulator("find-and-defeat-zerglings")
    episodes = played(env, np.zeros((STEPS, 3), int))
    for n in (1, 4):
        path = tmp_path / f"{n}.png"
        env.paths.draw([(f"iteration {k}", episodes) for k in range(n)], path, "title", "")
        assert path.read_bytes().startswith(b"\x89PNG")


def test_every_record_that_is_drawn_is_recorded():
    assert set(Timelines.records) <= set(RECORDS)
