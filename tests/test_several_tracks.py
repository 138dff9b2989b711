"""Several tracks in one racing training: who drives which, what is seen, logged and reported."""

import json
from dataclasses import replace
from shutil import copyfile

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal
from small_runs import QUICK_LAP

from repaint_cli.envs.racer.deepracer.params import params_in
from repaint_cli.envs.racer.deepracer.simtrace_reader import LoggedEpisode, read_training
from repaint_cli.envs.racer.deepracer.traces import traces_of
from repaint_cli.envs.racer.deepracer.which_track import track_driven
from repaint_cli.envs.racer.dynamics.encounters import NEXT
from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.objects import ObjectSettings
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.tracks import labels_of
from repaint_cli.errors import CardError
from repaint_cli.files.paths import shipped
from repaint_cli.learn.evaluation import evaluate, spaces_of
from repaint_cli.learn.rollout.collect import start
from repaint_cli.learn.seeding import Purpose
from repaint_cli.learn.task_check import check_task
from repaint_cli.policies.networks import ActorCritic
from repaint_cli.report import path_panels, video
from repaint_cli.tasks.card_files import read_task
from repaint_cli.zoo.played import _reverse

THREE = ("oval", "wide-loop", "reinvent-like")
SMALL = ["net.conv=[[4,8,8]]", "net.dense=8", "env.max_steps=40"]
STRAIGHT_ON, HARD_RIGHT = 7, 5
FOLDER = shipped("tasks") / "racer" / "tracks"


@pytest.fixture(scope="module")
def tracks():
    return [load_track(name) for name in THREE]


def card_of(*names, settings=()):
    return read_task("racer-inner").with_settings([f"env.track={json.dumps(names)}", *settings])


def driven(env, actions, steps, seed, options=None):
    """The images, infos and rewards of some steps with fixed actions (N,)."""
    images, infos = env.reset(seed=seed, options=options)
    shown = [(images, infos)]
    for _ in range(steps):
        images, rewards, _, _, infos = env.step(actions)
        shown.append((images, infos | {"reward": rewards}))
    return shown


def assert_same(shown, other, rows=slice(None)):
    for (images, infos), (others, theirs) in zip(shown, other, strict=True):
        assert_array_equal(images, others[rows])
        for name in infos:
            assert_array_equal(infos[name], theirs[name][rows])


# -- the setting


def test_a_list_is_tracks_in_its_order_and_a_list_of_one_is_the_one(home):
    assert card_of(*THREE).env.tracks == THREE
    assert card_of(*THREE[::-1]).task != card_of(*THREE).task
    assert card_of("oval").task == read_task("racer-inner").with_settings(["env.track=oval"]).task
    assert read_task("racer-inner").env.tracks == ("reinvent-like",)
    again = type(card_of(*THREE)).model_validate(card_of(*THREE).model_dump(mode="json"))
    assert again.env == card_of(*THREE).env


@pytest.mark.parametrize(("value", "text"), [
    ("[]", r"env\.track: expected 1 to 64 tracks in a list, found \[\]"),
    ('["oval", "oval"]', "each track once, as all are driven alike; 'oval' is there twice"),
    ('["oval", 3]', "expected the name of a track or a list of names, found"),
    ("3", "expected the name of a track or a list of names, found 3"),
])  # fmt: skip
def test_what_is_no_list_of_tracks_is_refused_in_a_line(value, text):
    with pytest.raises(CardError, match=text):
        read_task("racer-inner").with_settings([f"env.track={value}"])


def test_an_unknown_track_and_an_open_one_for_bots_are_named(home):
    rows = np.load(FOLDER / "oval.npy")
    np.save(home / "open.npy", rows[:60])
    with pytest.raises(Exception, match="unknown track 'ovl'"):
        card_of("oval", "ovl").make_env(1)
    with pytest.raises(CardError, match="expected a closed track for bots, found 'open'"):
        card_of("oval", "open.npy", settings=["env.n_bots=1"]).make_env(1)


def test_files_lie_beside_the_card_and_have_names_that_differ(home, monkeypatch):
    (home / "a").mkdir()
    for name in ("oval.npy", "a/oval.npy"):
        copyfile(FOLDER / "oval.npy", home / name)
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\nsummary = "x"\n[env]\ntrack = ["oval.npy", "a/oval.npy", "oval"]'
    )
    monkeypatch.chdir(home / "a")
    env = read_task("../mine.toml").env
    assert [load_track(name).name for name in env.tracks] == ["oval"] * 3
    labels = labels_of(env.tracks)
    assert labels[1:] == ["a/oval", "oval"]
    assert len(set(labels)) == 3
    assert [path.name for path in env.files().values()] == ["oval.npy"] * 2
    assert labels_of(("oval", "/x/my-track.npy")) == ["oval", "my-track"]


def test_the_time_limit_is_that_of_the_longest_track():
    slow = ["env.actions=[[-15, 0.1], [15, 0.1]]"]
    alone = [card_of(name, settings=slow).env.longest_episode() for name in THREE]
    assert card_of(*THREE, settings=slow).env.longest_episode() == max(alone) > min(alone)


# -- who drives which


def test_a_car_does_not_notice_that_others_drive_other_tracks(tracks):
    """A row of several tracks is what the same car does alone on its track, bit for bit."""
    settings = {
        "sensors": "stereo+lidar",
        "objects": ObjectSettings(2),
        "noise": Noise(),
        "max_steps": 30,
    }
    actions = np.array([7, 2, 6, 8, 5, 7])
    options = {"lap_fraction": np.linspace(0.1, 0.9, 6), "track": [0, 1, 2, 0, 1, 2],
               "reverse": [False, True] * 3}  # fmt: skip
    parked = {"autoreset_mode": AutoresetMode.DISABLED}
    many = driven(RacerVectorEnv(tracks, 6, **settings, **parked), actions, 35, 3, options)
    for row in range(6):
        one = RacerVectorEnv(tracks[row % 3], 1, **settings, **parked)
        own = {"lap_fraction": options["lap_fraction"][[row]], "reverse": [row % 2 == 1]}
        alone = driven(one, actions[[row]], 35, [3 + row], own)
        for (images, infos), (shown, others) in zip(alone, many, strict=True):
            assert all((images[eye] == shown[eye][[row]]).all() for eye in images)
            assert all((infos[name] == others[name][[row]]).all() for name in infos)
            assert others["track"][row] == row % 3


def test_which_bot_is_next_is_measured_on_the_cars_own_track(tracks):
    fleet = Fleet([tracks[2], tracks[0]], 1, "sim4", 100, ObjectSettings(2))  # 17.7 m and 12 m
    rngs = [np.random.default_rng(0)]
    fleet.start(np.arange(1), np.array([0.5]), np.zeros(1, bool), rngs, np.ones(1, int))
    fleet.objects.along[0] = 3.0, 7.0
    fleet.objects.drive(tracks[0], np.arange(1), 0.0)
    fleet.drive(np.arange(1), np.zeros((1, 2)))
    assert params_in(fleet, 0, np.zeros(2))["closest_objects"] == [0, 1]
    assert fleet.encounters[0, NEXT] == 1


@pytest.mark.parametrize("options", [None, {"track": [2, 0, 1, 1, 0]}])
def test_the_number_of_cars_and_threads_changes_nothing(tracks, options):
    settings, actions = {"noise": Noise(), "max_steps": 12}, np.full(5, HARD_RIGHT)
    many = driven(RacerVectorEnv(tracks, 5, **settings), actions, 40, 7, options)
    threaded = RacerVectorEnv(tracks, 5, threads=3, **settings)
    assert_same(driven(threaded, actions, 40, 7, options), many)
    threaded.close()
    first = options and {"track": options["track"][:2]}
    two = driven(RacerVectorEnv(tracks, 2, **settings), actions[:2], 40, 7, first)
    assert_same(two, many, slice(2))


def test_without_options_each_car_draws_its_tracks(tracks):
    env = RacerVectorEnv(tracks, 300, autoreset_mode=AutoresetMode.DISABLED)
    _, infos = env.reset(seed=0)
    assert np.bincount(infos["track"].astype(int), minlength=3).min() > 75
    _, again = env.reset()
    assert 0.5 < (infos["track"] != again["track"]).mean() < 0.8


def test_at_autoresets_a_car_goes_on_with_the_next_track(tracks):
    env = RacerVectorEnv(tracks, 2, max_steps=2)
    _, infos = env.reset(seed=0, options={"track": [1, 2], "lap_fraction": [0.0, 0.0]})
    seen = [infos["track"]]
    seen += [env.step(np.full(2, STRAIGHT_ON))[-1]["track"] for _ in range(9)]
    assert_array_equal(np.array(seen)[::3], [[1, 2], [2, 0], [0, 1], [1, 2]])


@pytest.mark.parametrize("given", [[0], [0, 3], [-1, 0], [0.0, 1.0]])
def test_tracks_that_there_are_not_are_refused(tracks, given):
    with pytest.raises(ValueError, match="expected 2 tracks from 0 to 2, found"):
        RacerVectorEnv(tracks, 2).reset(options={"track": given})


def test_training_episodes_drive_the_tracks_in_turn_and_start_all_over_each():
    """Episode e drives track e mod 3, however many environments an iteration has."""
    env = card_of(*THREE).env

    def sequence(n_envs, n_iterations):
        each = [env.start_options(1, n_envs, k + 1, False) for k in range(n_iterations)]
        return [
            (track, place)
            for options in each
            for track, place in zip(options["track"], options["lap_fraction"], strict=True)
        ]

    episodes = sequence(4, 30)
    assert episodes == sequence(10, 12) == sequence(1, 120)
    assert [track for track, _ in episodes[:5]] == [0, 1, 2, 0, 1]
    for t in range(3):
        places = [place for track, place in episodes if track == t]
        assert_allclose(places, 0.05 * np.arange(40) % 1, atol=1e-12)
    both = env.start_options(2, 4, 1, False)
    assert both["track"] == [0, 1, 2, 0] * 2


def test_offset_spacing_and_direction_are_those_of_each_track():
    settings = ["env.direction=alternate", "env.start_offset=0.25", "env.start_spacing=0.3"]
    env = card_of("oval", "wide-loop", settings=settings).env
    options = env.start_options(1, 12, 1, False)
    for t in (0, 1):
        alone = card_of("oval", settings=settings).env.start_options(1, 6, 1, False)
        rows = [e for e in range(12) if options["track"][e] == t]
        assert [options["lap_fraction"][e] for e in rows] == alone["lap_fraction"]
        assert [options["reverse"][e] for e in rows] == alone["reverse"]


def test_one_track_has_the_starts_that_it_had():
    env = read_task("racer-inner").env
    assert env.start_options(1, 4, 3, False) == {"lap_fraction": [0.4, 0.45, 0.5, 0.55]}
    assert env.start_options(1, 2, None, True) == {
        "lap_fraction": [0.0, 0.5], "reverse": [False, True]
    }  # fmt: skip


def test_a_training_rollout_sees_the_ground_of_each_track():
    task = card_of(*THREE, settings=SMALL)
    env, images = start(task, [0], 3, Purpose.TRAIN, 1)
    for row, name in enumerate(THREE):
        own, image = start(card_of(name, settings=SMALL), [0], 1, Purpose.TRAIN, 1)
        assert_array_equal(images[row], image[0])
        own.close()
    env.close()
    assert not np.array_equal(images[0], images[1])


# -- evaluation


def student(task):
    network = ActorCritic(spaces_of(task), task.net, 1)
    network.storage.normal_(0, 0.3, generator=torch.Generator().manual_seed(4))
    return network


@pytest.mark.parametrize("names", [THREE[:2], ("wide-loop", "oval")])
def test_an_evaluation_is_that_of_each_track_alone(names):
    """Without noise, where an episode's seed changes nothing."""
    settings = [*SMALL, "eval.noise=none", "eval.both_directions=true"]
    task = card_of(*names, settings=settings)
    network = student(task)
    whole = evaluate(network, task, [0], 7)
    assert whole.returns.shape == (1, 8)
    parts = task.env.parts(whole, 0)
    assert (parts.name, list(parts.episodes)) == ("track", list(names))
    by_track = task.env.outcomes(whole)["tracks"]
    for t, (name, own) in enumerate(parts.episodes.items()):
        alone = card_of(name, settings=settings)
        played = evaluate(network, alone, [0], 4)
        assert_array_equal(np.flatnonzero(own), np.arange(t, 8, 2))
        assert_array_equal(whole.returns[0, own], played.returns[0])
        assert_array_equal(whole.progress[0, own], played.progress[0])
        assert_array_equal(whole.actions[: len(played.actions), 0, own], played.actions[:, 0])
        assert by_track[name]["mean_progress"] == [pytest.approx(played.progress.mean())]
        assert by_track[name]["mean_return"] == [pytest.approx(played.returns.mean())]
        assert by_track[name]["episodes"] == [list(range(t, 8, 2))]
        assert by_track[name]["laps"] == [0]
        assert alone.env.parts(played, 0) is None
        assert "tracks" not in alone.env.outcomes(played)


def test_a_race_counts_laps_by_track():
    settings = [*SMALL, "env.max_steps=6", "eval.laps=2", "eval.noise=none"]
    task = card_of("oval", "wide-loop", settings=settings)
    race = task.model_copy(update={"env": task.env.racing(task.eval)})
    episodes = evaluate(student(task), race, [0], 3)
    assert episodes.last("track").tolist() == [[0, 1, 0, 1]]
    assert {name: own["laps"] for name, own in race.env.outcomes(episodes)["tracks"].items()} == {
        "oval": [0], "wide-loop": [0]
    }  # fmt: skip
    done = episodes.records["laps"].copy()
    done[5:, 0, 1] = 1  # a lap on the second track
    other = replace(episodes, records=episodes.records | {"laps": done})
    by_track = race.env.outcomes(other)["tracks"]
    assert (by_track["oval"]["laps"], by_track["wide-loop"]["laps"]) == ([0], [1])
    assert by_track["wide-loop"]["mean_lap_time"] == [pytest.approx(6 / 15)]


def test_what_is_measured_of_teachers_knows_which_episodes_went_the_other_way():
    task = card_of(*THREE, settings=["eval.both_directions=true"])
    assert _reverse(task, 5).tolist() == [False] * 3 + [True] * 3


# -- checks, reward functions, logs and pictures


REWARD = """
def reward_function(params):
    return params["track_length"] + 1e-3 * len(params["waypoints"])
"""


def test_a_reward_function_is_told_of_the_track_that_is_driven(home):
    (home / "reward.py").write_text(REWARD)
    (home / "mine.toml").write_text(
        f'extends = "racer-inner"\nsummary = "x"\n[env]\ntrack = {json.dumps(THREE)}\n'
        'max_steps = 5\n[reward]\nfunction = "reward.py"\n'
    )
    task = read_task("mine.toml")
    env, _ = start(task, [0], 6, Purpose.TRAIN, 1)
    rewards = env.step(np.full(6, STRAIGHT_ON))[1]
    env.close()
    roads = [load_track(name) for name in THREE]
    wanted = [road.length + 1e-3 * len(road.waypoints[0]) for road in roads]
    assert_allclose(rewards, wanted * 2)
    check = check_task(task)
    assert check.errors == []
    assert len(check.returns) == 6  # four, and as many on each


def test_doubts_and_notes_name_the_track(home):
    rows = np.load(FOLDER / "oval.npy")
    rows[-1] += 1e-4
    np.save(home / "mine.npy", rows)
    env = card_of("mine.npy", "reinvent-like", settings=["env.max_steps=400"]).env
    assert [line[:40] for line in env.doubts()] == [
        "on track 'reinvent-like' a lap at the slo"[:40]
    ]
    assert env.notes()[0].startswith("track 'mine': closed by moving row")


def test_a_run_logs_draws_films_and_reports_each_track(repaint, home, monkeypatch):
    """Each row's track_len is that of its episode's track, and a figure has a panel a track."""
    names = ("oval", "wide-loop")
    panels, films = [], []
    grid, write = path_panels.grid, video.write_video
    monkeypatch.setattr(
        "repaint_cli.envs.racer.path_figure.grid",
        lambda n, *rest, **more: panels.append(n) or grid(n, *rest, **more),
    )
    monkeypatch.setattr(
        "repaint_cli.envs.racer.figures.write_video",
        lambda frames, path, fps: films.append(write(frames, path, fps)),
    )
    tracks = ["--set", f"env.track={json.dumps(names)}"]
    said = repaint("transfer", "--task", "racer-inner", "--method", "scratch", "--run", "run",
                   *QUICK_LAP, *tracks)  # fmt: skip
    assert said.code == 0, said.err
    assert panels == [4]  # two evaluations, two tracks
    assert {path.name for path in (home / "run").glob("heatmap*.png")} == {
        "heatmap-oval.png", "heatmap-wide-loop.png"
    }  # fmt: skip
    roads = [load_track(name) for name in names]
    logged = [one for _, some in read_training(home / "run/deepracer/seed-0") for one in some]
    assert [track_driven(one, roads) for one in logged] == [0, 1, 0, 1, 0, 1]
    rows = "".join(
        path.read_text() for path in sorted((home / "run/deepracer").rglob("*-iteration.csv"))
    ).splitlines()
    lengths = {row.split(",")[0]: float(row.split(",")[13]) for row in rows if row[0] != "e"}
    wanted = [roads[e % 2].length for e in range(6)]
    assert_allclose([lengths[str(e)] for e in range(6)], wanted, atol=1e-4)

    said = repaint("eval", "run", "--render-offscreen")
    assert said.code == 0, said.err
    words = said.out.split()
    assert words.index("track") < words.index("all") < words.index("oval")
    assert "wide-loop" in words
    assert len(films) == 1
    result = json.loads(next((home / "run").rglob("eval.json")).read_text())
    assert list(result["tracks"]) == list(names)
    assert repaint("transfer", "--resume", "run", "--iterations", 3).code == 0

    (home / "mine.toml").write_text(
        f'extends = "racer-inner"\nsummary = "x"\n[env]\ntrack = {json.dumps(names)}\n'
    )
    said = repaint("tasks", "replay", "run", "--task", "mine.toml")
    assert said.code == 0, said.err
    (home / "mine.toml").write_text(
        'extends = "racer-inner"\nsummary = "x"\n[env]\ntrack = ["oval", "reinvent-like"]\n'
    )
    said = repaint("tasks", "replay", "run", "--task", "mine.toml")
    assert said.code == CardError.exit_code
    assert "and the card's, 'oval', 12.00 m and 'reinvent-like', 17.7" in said.err


def test_a_log_of_one_road_both_ways_round_is_told_apart(home):
    rows = np.load(FOLDER / "oval.npy")
    roads = [load_track("oval"), load_track("wide-loop")]
    np.save(home / "back.npy", rows[::-1])
    roads.append(load_track(str(home / "back.npy")))
    names = ("oval", "wide-loop", str(home / "back.npy"))
    task = card_of(*names, settings=SMALL)
    episodes = evaluate(student(task), task, [0], 6)
    traces = traces_of(episodes.steps, task.env.actions, 0)
    assert [trace.track for trace in traces] == [0, 1, 2] * 2
    nothing = np.empty(0)
    logged = [
        LoggedEpisode(0, trace, nothing, nothing, nothing, roads[trace.track].length)
        for trace in traces
    ]
    assert [track_driven(one, roads) for one in logged] == [0, 1, 2] * 2
    assert track_driven(replace(logged[0], track_length=30.0), roads) is None
