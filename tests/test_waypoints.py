"""Waypoints are numbered as in the track's file, where some hold a row twice."""

import csv
from bisect import bisect_right
from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from numpy.testing import assert_array_equal

from repaint_cli.envs.racer.deepracer.params import closest_waypoints
from repaint_cli.envs.racer.track.track import Track
from repaint_cli.tasks.card_files import read_task

ROOT = Path(__file__).parents[1]
OVAL = ROOT / "tasks" / "racer" / "tracks" / "oval.npy"
REAL = ROOT.parent / "shared" / "data" / "deepracer"
TWICE = 30


def doubled(rows, row=TWICE):
    return np.insert(rows, row, rows[row], axis=0)


def numbers_by_deepracer(rows, points):
    """Numbers of the waypoints before and after points, as DeepRacer counted until March 2026.

    Every row of the file has its place along the centre line, and the place of a point is looked
    up among those.
    """
    centre = rows[:, :2]
    places = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(centre, axis=0).T))])
    kept = np.concatenate([[True], np.diff(places) > 1e-9])
    line, along = centre[kept], places[kept]
    _, where = reference.line_project(line, points)
    found = []
    for distance in np.interp(where, np.arange(len(along)), along):
        after = bisect_right(places.tolist(), distance)
        found.append((distance, [after - 1, after if after < len(places) else 0]))
    return found


def around(rows, n=300):
    rng = np.random.default_rng(0)
    return rows[rng.integers(len(rows), size=n), :2] + rng.normal(0, 0.2, (n, 2))


def assert_numbered_as_deepracer_does(rows, track):
    for point, (distance, two) in zip(
        around(rows), numbers_by_deepracer(rows, around(rows)), strict=True
    ):
        if np.abs(track.waypoints[1] - distance).min() < 1e-9:
            continue  # at a corner, where rounding decides
        assert closest_waypoints(track, distance) == two, point
        gaps = np.abs(track.waypoints[1][two] - distance)
        assert track.nearest_waypoint(np.array(distance)) == two[int(gaps.argmin())]
    assert_array_equal(track.waypoints[0], rows[:, :2])


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("row", [0, TWICE, 100])
def test_waypoints_are_numbered_as_in_a_file_that_holds_a_row_twice(row, reverse):
    rows = doubled(np.load(OVAL), row)
    track = Track.from_waypoints(rows, "oval")
    if reverse:
        rows, track = rows[::-1], track.reversed()
    assert_numbered_as_deepracer_does(rows, track)


def test_around_a_doubled_row_its_numbers_are_the_nearer_ones():
    track = Track.from_waypoints(doubled(np.load(OVAL)), "oval")
    place = track.distances[TWICE]
    assert closest_waypoints(track, place - 0.01) == [TWICE - 1, TWICE]
    assert closest_waypoints(track, place) == [TWICE + 1, TWICE + 2]
    assert list(track.nearest_waypoint(place + np.array([-0.01, 0.01]))) == [TWICE, TWICE + 1]


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer tracks are not here")
@pytest.mark.parametrize(
    ("name", "twice"),
    [("Albert", 204), ("Oval_track", 66), ("Tokyo_Training_track", 77), ("reInvent2019_track", 38)],
)
def test_league_tracks_with_a_doubled_row_are_numbered_as_deepracer_numbered_them(name, twice):
    rows = np.load(REAL / "tracks" / f"{name}.npy")
    track = Track.from_waypoints(rows, name)
    assert_array_equal(np.flatnonzero(track.repeats == 2), [twice])
    assert_numbered_as_deepracer_does(rows, track)


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer logs are not here")
@pytest.mark.parametrize("kind", ["training-12", "evaluation-0"])
def test_real_logs_agree_in_every_row_where_a_row_of_their_track_is_doubled(kind):
    """No log here is of a track with a doubled row: this one's track gets one."""
    rows = doubled(np.load(REAL / "tracks" / "reinvent_base.npy"))
    with (REAL / "logs" / f"drfc1-{kind}-iteration.csv").open() as file:
        log = list(csv.DictReader(file))
    track = Track.from_waypoints(rows, "reinvent_base")
    front = np.array([[float(row["X"]), float(row["Y"])] for row in log])
    along = np.array([distance for distance, _ in numbers_by_deepracer(rows, front)])
    logged = np.array([int(row["closest_waypoint"]) for row in log])
    after = (logged > TWICE) | ((logged == TWICE) & (along >= track.distances[TWICE]))
    assert 0 < after.sum() < len(log)
    assert_array_equal(track.nearest_waypoint(along), logged + after)


def test_the_card_decides_how_params_and_logs_number_waypoints(home):
    np.save("twice.npy", doubled(np.load(OVAL)))
    numbered = {}
    for how in ("file", "unique"):
        task = read_task("racer-inner").with_settings(
            ["env.track=twice.npy", f"env.waypoints={how}"]
        )
        env = task.env.make(1, one_episode=True, noise=None)
        env.reset(seed=0, options={"lap_fraction": [0.5]})
        *_, infos = env.step(np.array([2]))
        params = env.params(0)
        near = params["closest_waypoints"][
            int(infos["waypoint"][0] > params["closest_waypoints"][0])
        ]
        assert infos["waypoint"][0] == near
        numbered[how] = len(params["waypoints"]), params["closest_waypoints"]
        env.close()
    (n, two), (fewer, before) = numbered["file"], numbered["unique"]
    assert (n, fewer) == (len(np.load(OVAL)) + 1, len(np.load(OVAL)))
    assert two == [number + 1 for number in before]
    assert read_task("racer-inner").env.waypoints == "file"
