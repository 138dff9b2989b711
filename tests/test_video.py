"""Films: encoded whole or not at all, true to the data, and explained where nothing can render."""

import json
import re
import subprocess
import sys
from dataclasses import replace

import gymnasium
import imageio_ffmpeg
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from racer_reference import scan

from repaint_cli.envs.gymnasium import film
from repaint_cli.envs.gymnasium.film import Replay, find_renderer, frames, render_gym
from repaint_cli.envs.racer import film as film_of_the_racer
from repaint_cli.envs.racer.dynamics.car import FRONT_OFFSET
from repaint_cli.envs.racer.film import (
    CAR_COLOUR,
    HEIGHT,
    MAP_WIDTH,
    FilmedEpisode,
    beam_ends,
    racer_frames,
)
from repaint_cli.envs.racer.sight.boxes import BEAM_X, BOT_LENGTH, BOT_WIDTH
from repaint_cli.errors import RenderError, StoreError
from repaint_cli.report.video import CAPTION_HEIGHT, caption, write_video

CHILD = film._child
ANGLES = np.linspace(0, 2 * np.pi, 60)
RING = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
RING[-1] = RING[0]
OVAL = {"inner": RING * [3.0, 1.5], "outer": RING * [3.8, 2.3], "centre": RING * [3.4, 1.9]}


def decode(path):
    """What the file says of itself, and its frames, (T, H, W, 3)."""
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-i",
        str(path),
        *["-f", "rawvideo", "-pix_fmt", "rgb24", "-"],
    ]
    done = subprocess.run(command, capture_output=True, check=True)
    about = done.stderr.decode()
    width, height = map(int, re.search(r", (\d+)x(\d+)", about).groups())
    return about, np.frombuffer(done.stdout, np.uint8).reshape(-1, height, width, 3)


def greys(levels, height=32, width=48):
    return [np.full((height, width, 3), level, np.uint8) for level in levels]


def test_a_film_holds_its_frames_in_order(tmp_path):
    write_video(iter(greys([20, 120, 220])), tmp_path / "film.mp4", fps=15)
    about, pictures = decode(tmp_path / "film.mp4")
    assert all(words in about for words in ("h264", "yuv420p", "15 fps", "48x32"))
    assert_allclose(pictures.mean(axis=(1, 2, 3)), [20, 120, 220], atol=4)
    assert [entry.name for entry in tmp_path.iterdir()] == ["film.mp4"]


def test_odd_sides_are_padded_by_a_pixel(tmp_path):
    write_video(greys([80, 80], height=31, width=47), tmp_path / "film.mp4", fps=10)
    _, pictures = decode(tmp_path / "film.mp4")
    assert pictures.shape == (2, 32, 48, 3)
    assert_allclose(pictures, 80, atol=4)


@pytest.mark.parametrize(
    ("pictures", "message"),
    [([], "at least one frame"), (greys([1]) + greys([1], height=30), "the first one is")],
    ids=["none", "two sizes"],
)
def test_a_bad_film_leaves_the_old_one(pictures, message, tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("old")
    with pytest.raises(ValueError, match=message):
        write_video(pictures, path, fps=10)
    assert path.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["film.mp4"]


def test_a_film_that_cannot_be_written_is_explained(tmp_path):
    (tmp_path / "run").write_text("a file where the folder should be")
    with pytest.raises(StoreError, match="cannot write"):
        write_video(greys([1]), tmp_path / "run" / "film.mp4", fps=10)


def test_a_caption_leaves_the_picture_alone_and_its_words_inside():
    picture = greys([90], height=100, width=300)[0]
    framed = caption(picture, "a title that is too long for so small a picture", "step 3")
    assert framed.shape == (100 + CAPTION_HEIGHT, 300, 3)
    assert_array_equal(framed[:100], picture)
    assert (framed[100:] < 128).any()
    assert (framed[100:, [0, -1]] == 255).all()


def drive(n_steps=40):
    turns = np.linspace(0, 3, n_steps)
    xy = np.stack([3.4 * np.cos(turns), 1.9 * np.sin(turns)], axis=1)
    heading = np.arctan2(1.9 * np.cos(turns), -3.4 * np.sin(turns))
    images = np.broadcast_to(
        np.arange(n_steps, dtype=np.uint8)[:, None, None] * 5, (n_steps, 120, 160)
    )
    one = np.ones(n_steps)
    bots = np.tile([[-3.4, 0.0, 1.0]], (n_steps, 1, 1))
    ranges = np.tile(np.where(np.arange(64) < 32, 0.5, 1.0), (n_steps, 1))
    return FilmedEpisode(xy, heading, one * 0.7, one * -0.2, turns * 15, one, images, ranges, bots)


def test_the_films_car_has_its_nose_where_the_simulators_has():
    assert film_of_the_racer.FRONT_OFFSET == FRONT_OFFSET


def car_pixels(frame):
    colour = [int(CAR_COLOUR[i : i + 2], 16) for i in (1, 3, 5)]
    return np.argwhere((np.abs(frame[:, :MAP_WIDTH].astype(int) - colour) < 12).all(axis=2))


def test_the_car_is_where_the_drive_says_and_the_camera_beside_it():
    film = list(racer_frames(**OVAL, episode=drive(), title="racer"))
    assert {frame.shape for frame in film} == {(HEIGHT, 1120, 3)}
    start, end = (car_pixels(frame).mean(axis=0) for frame in (film[0], film[-1]))
    assert start[1] > 0.8 * MAP_WIDTH  # at x = 3.4 m of −3.8 … 3.8
    assert end[1] < 0.2 * MAP_WIDTH
    tops = [car_pixels(frame)[:, 0].min() for frame in film]
    assert tops[20] < tops[0]  # y points up
    assert_array_equal(film[30][:232, MAP_WIDTH:], 150)


def test_frames_are_independent_and_the_trail_grows():
    film = list(racer_frames(**OVAL, episode=drive(), title="racer"))
    again = list(racer_frames(**OVAL, episode=drive(), title="racer"))
    assert all((one == two).all() for one, two in zip(film, again, strict=True))
    assert len({frame[:, :MAP_WIDTH].tobytes() for frame in film}) == len(film)


def test_a_drive_of_unequal_lengths_is_refused():
    whole = drive(5)
    with pytest.raises(ValueError, match="speed has 4 steps, xy has 5"):
        replace(whole, speed=whole.speed[:4])


def test_bots_are_on_the_map_beside_the_car():
    alone = replace(drive(3), objects=np.empty((3, 0, 3)))
    with_bot, without = (
        list(racer_frames(**OVAL, episode=one, title="racer")) for one in (drive(3), alone)
    )
    changed = np.argwhere((with_bot[0] != without[0]).any(axis=2))
    assert 50 < len(changed) < 2000
    assert changed[:, 1].mean() < 0.2 * MAP_WIDTH  # at x = −3.4 m of −3.8 … 3.8


class Painter(gymnasium.Env):
    """Paints its last action; ends after six steps."""

    action_space = gymnasium.spaces.Box(0, 255, (1,), np.float64)
    observation_space = gymnasium.spaces.Box(0, 255, (1,), np.float64)

    def reset(self, *, seed=None, options=None):
        self.level, self.t = float(seed), 0
        return np.zeros(1), {}

    def step(self, action):
        self.level, self.t = float(action[0]), self.t + 1
        return np.zeros(1), 0.0, self.t == 6, False, {}

    def render(self):
        return np.full((16, 200, 3), round(self.level), np.uint8)


def test_episodes_are_replayed_from_their_seeds_until_they_end():
    episodes = [
        {"seed": 7, "actions": [[10.0], [20.0]], "rewards": [1.0, -2.0]},
        {"seed": 9, "actions": [[float(10 * i)] for i in range(1, 9)], "rewards": None},
    ]
    shown = [int(frame[0, 0, 0]) for frame in frames(Painter(), episodes, "title")]
    assert shown == [7, 10, 20, 9, 10, 20, 30, 40, 50, 60]


def test_actions_reach_the_child_bit_for_bit():
    actions = np.random.default_rng(0).normal(size=(50, 3))
    sent = json.loads(json.dumps(film._as_json(Replay(3, actions))))
    assert_array_equal(np.asarray(sent["actions"]), actions)


@pytest.fixture
def no_renderer(monkeypatch):
    """A machine where every probe fails, as without libEGL."""
    find_renderer.cache_clear()
    failed = subprocess.CompletedProcess([], 1, "", "")
    monkeypatch.setattr(film, "_child", lambda *_: failed)
    yield
    find_renderer.cache_clear()


@pytest.mark.usefixtures("no_renderer")
def test_without_a_renderer_the_packages_to_install_are_named(tmp_path):
    with pytest.raises(RenderError, match="apt install libegl1 libgl1-mesa-dri"):
        render_gym("Reacher-v5", {}, [Replay(0, np.zeros((2, 2)))], tmp_path / "film.mp4")
    assert list(tmp_path.iterdir()) == []


def test_a_probe_that_hangs_or_fails_moves_on_to_the_next(monkeypatch):
    asked = []

    def child(task, renderer, job, seconds):
        asked.append(renderer)
        if renderer == "egl":
            raise subprocess.TimeoutExpired("probe", seconds)
        return subprocess.CompletedProcess([], 0, "", "")

    find_renderer.cache_clear()
    monkeypatch.setattr(film, "_child", child)
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    assert [find_renderer(), find_renderer()] == ["osmesa", "osmesa"]
    assert asked == ["egl", "osmesa"]
    find_renderer.cache_clear()


@pytest.fixture(scope="module")
def renderer():
    found = find_renderer()
    if found is None:
        pytest.skip("neither EGL nor OSMesa renders on this machine")
    return found


@pytest.mark.usefixtures("renderer")
def test_reacher_is_filmed_as_it_was_played(tmp_path):
    still, moving = np.zeros((3, 2)), np.full((60, 2), 0.5)
    path = tmp_path / "films" / "video.mp4"
    render_gym("Reacher-v5", {}, [Replay(1, still), Replay(2, moving)], path, title="reacher")
    about, pictures = decode(path)
    assert "50 fps" in about
    # Reacher ends after 50 steps
    assert pictures.shape == (4 + 51, 480 + CAPTION_HEIGHT, 480, 3)
    changes = [np.abs(pictures[i + 1, :480].astype(int) - pictures[i, :480]).max() for i in (1, 10)]
    assert changes[0] < 40 < 80 < changes[1]
    assert [entry.name for entry in path.parent.iterdir()] == ["video.mp4"]


@pytest.mark.usefixtures("no_renderer")
@pytest.mark.parametrize("env_id", ["CartPole-v1", "Pendulum-v1"])
def test_what_pygame_draws_needs_no_renderer(env_id, tmp_path, monkeypatch):
    monkeypatch.setattr(film, "_child", CHILD)
    actions = np.zeros((4, 1), np.float32) if env_id == "Pendulum-v1" else np.array([0, 1, 1, 0])
    render_gym(env_id, {}, [Replay(1, actions)], tmp_path / "film.mp4")
    _, pictures = decode(tmp_path / "film.mp4")
    assert len(pictures) == 5
    assert np.ptp(pictures[0].astype(int)) > 100


@pytest.mark.usefixtures("renderer")
def test_an_environment_that_cannot_be_drawn_is_one_line(tmp_path):
    with pytest.raises(RenderError, match=r"cannot film 'Nope-v5': .*Nope") as caught:
        render_gym("Nope-v5", {}, [Replay(0, np.zeros((2, 2)))], tmp_path / "film.mp4")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_figures_and_films_leave_pyplot_and_renderers_alone():
    drawing = ("report.curves", "report.video", "envs.racer.film", "envs.gymnasium.film")
    drawing += ("envs.racer.path_figure", "envs.gymnasium.reacher", "report.statistics")
    imports = "; ".join(f"import repaint_cli.{module}" for module in drawing)
    code = f"import sys; {imports}; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert not {"matplotlib.pyplot", "mujoco", "torch", "gymnasium"} & set(loaded.stdout.split())


def test_a_beam_ends_where_the_simulators_meets_a_bot():
    state = np.array([[1.0, 2.0, 0.7, 0.0, 0.0]])
    behind = np.array([[[0.6, 1.5, 0.2, 0.0]]])
    ranges = scan(state[0], behind[0])
    met = [(ahead, left) for ahead, left, free in beam_ends(ranges) if not free]
    assert len(met) > 3
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    lidar = np.array([BEAM_X, 0.0])
    points = state[0, :2] + (np.array(met) + lidar) @ turn.T
    turn = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    own = np.abs((points - behind[0, 0, :2]) @ turn)
    on_the_hull = np.abs(own - [BOT_LENGTH / 2, BOT_WIDTH / 2]).min(axis=1)
    assert on_the_hull.max() < 1e-3


def test_the_lidar_is_in_the_corner_of_the_picture_where_there_is_one():
    with_lidar, without = (
        next(racer_frames(**OVAL, episode=one, title="racer"))
        for one in (drive(3), replace(drive(3), ranges=np.empty((3, 0))))
    )
    rows, columns = np.argwhere((with_lidar != without).any(axis=2)).T
    assert (rows.min(), rows.max()) == (360 - 128, 360 - 9)
    assert (columns.min(), columns.max()) == (MAP_WIDTH + 8, MAP_WIDTH + 127)
