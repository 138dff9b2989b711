from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from repaint_cli.envs.racer import Track, geometry, reference

SHIPPED = sorted((Path(__file__).parents[1] / "tasks" / "racer" / "tracks").glob("*.npy"))
REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "tracks"
BOX = np.array([[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]], dtype=float)


def box_rows(centre=1.0, inner=0.5, outer=1.5):
    """A rectangular road; its rings are one rectangle scaled about its middle."""
    middle = np.array([2.0, 1.5])
    return np.hstack([middle + scale * (BOX - middle) for scale in (centre, inner, outer)])


def load(path):
    return Track.from_waypoints(np.load(path), path.stem)


@pytest.fixture(scope="module", params=SHIPPED, ids=lambda path: path.stem)
def track(request):
    return load(request.param)


def test_box_has_the_length_and_direction_one_reads_off_paper():
    box = Track.from_waypoints(box_rows(), "box")
    assert box.length == 14
    assert_allclose(box.distances, [0, 4, 7, 11, 14])
    assert box.ccw
    assert not Track.from_waypoints(box_rows()[::-1], "box").ccw


def test_pose_at_walks_the_centre_line_and_wraps():
    box = Track.from_waypoints(box_rows(), "box")
    points, headings = box.pose_at(np.array([0.0, 2 / 14, 5 / 14, 1.0, -1 / 14]))
    assert_allclose(points, [[0, 0], [2, 0], [4, 1], [0, 0], [0, 1]], atol=1e-12)
    assert_allclose(headings, [0, 0, np.pi / 2, 0, -np.pi / 2], atol=1e-12)


def test_repeated_rows_are_dropped():
    rows = box_rows()
    repeated = np.insert(rows, 2, rows[2], axis=0)
    assert Track.from_waypoints(repeated, "box") == Track.from_waypoints(rows, "box")


def test_equal_tracks_hash_alike_and_others_differ():
    first, second = (Track.from_waypoints(box_rows(), "box") for _ in range(2))
    assert first == second
    assert hash(first) == hash(second)
    assert first != Track.from_waypoints(box_rows(centre=1.01), "box")


def test_arrays_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        Track.from_waypoints(box_rows(), "box").centre[0] = 1


def with_value(value):
    rows = box_rows()
    rows[1, 3] = value
    return rows


def crossing():
    rows = box_rows()
    rows[3, 4:] = 2, -5
    return rows


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (np.zeros((5, 4)), r"expected an array of shape \(N, 6\), found \(5, 4\)"),
        (with_value(np.nan), "expected finite numbers"),
        (with_value(np.inf), "expected finite numbers"),
        (np.full((5, 6), "a"), "expected finite numbers"),
        (np.zeros((0, 6)), "expected at least 4 different rows .* found 0 rows"),
        (box_rows()[[0, 1, 2, 0]], "expected at least 4 different rows .* found 4 rows"),
        (np.vstack([box_rows()[:-1], box_rows()[:1] + 0.1]), r"found them 0\.1 m apart"),
        (crossing(), "the outer border must not cross itself"),
        (box_rows(centre=0.0), "the centre line must enclose an area"),
        (box_rows(inner=1.5, outer=0.5), "inner border must lie inside the outer"),
    ],
)
def test_what_is_no_closed_road_is_refused_in_a_sentence(rows, message):
    with pytest.raises(ValueError, match="track 'mine'.*" + message):
        Track.from_waypoints(rows, "mine")


@pytest.mark.parametrize(
    ("name", "length", "width"),
    [("reinvent-like", 17.7, 0.762), ("wide-loop", 23.0, 1.067), ("oval", 12.0, 0.762)],
)
def test_shipped_tracks_measure_what_they_should(name, length, width):
    track = load(next(path for path in SHIPPED if path.stem == name))
    assert track.length == pytest.approx(length)
    assert track.width == pytest.approx(width, abs=2e-3)
    assert track.ccw


def test_the_default_track_bends_both_ways_but_no_sharper_than_the_car():
    ring = load(next(path for path in SHIPPED if path.stem == "reinvent-like")).centre[:-1]
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    curvature = (
        2
        * cross
        / np.prod(
            [np.linalg.norm(side, axis=1) for side in (before, after, before + after)], axis=0
        )
    )
    assert 1 / np.abs(curvature).max() >= 0.66
    bends = np.sign(curvature[np.abs(curvature) > 0.5])
    assert np.count_nonzero(np.diff(bends)) >= 4  # left and right alternate


@pytest.mark.skipif(not REAL.is_dir(), reason="the DeepRacer tracks are not here")
def test_real_tracks_load_whichever_way_they_run():
    lengths = {"reinvent_base": 17.709, "Albert": 51.389, "reInvent2019_track": 23.118}
    ccw = {}
    for path in sorted(REAL.glob("*.npy")):
        if path.stem == "Straight_track":
            with pytest.raises(ValueError, match="open tracks cannot be lapped"):
                load(path)
            continue
        track = load(path)
        ccw[path.stem] = track.ccw
        assert track.length == pytest.approx(lengths.get(path.stem, track.length), abs=1e-3)
    assert ccw["reinvent_base"]
    assert not ccw["Albert"]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_projection_and_inside_agree_with_the_reference(track, seed):
    rng = np.random.default_rng(seed)
    low, high = track.outer.min(axis=0) - 1, track.outer.max(axis=0) + 1
    points = rng.uniform(low, high, size=(20, 2))
    for ring in (track.centre, track.inner, track.outer):
        near, where = reference.ring_project(ring, points)
        ours = np.array([geometry.ring_project(ring, x, y) for x, y in points])
        assert_allclose(ours[:, :2], near, atol=1e-9)
        assert_allclose(ours[:, 2], where, atol=1e-7)
        inside = [geometry.ring_holds(ring, x, y) for x, y in points]
        np.testing.assert_array_equal(inside, reference.ring_winds(ring, points))


def test_projection_survives_a_border_that_holds_a_point_twice():
    ring = np.insert(BOX, 2, BOX[2], axis=0)
    assert geometry.ring_project(ring, 5.0, 1.0)[:2] == (4.0, 1.0)


def test_projection_tie_goes_to_the_earlier_segment():
    assert geometry.ring_project(BOX, 2.0, 1.5) == (2.0, 0.0, 0.5)


def test_a_reversed_track_is_the_same_road_the_other_way(track):
    turned = track.reversed()
    for share in (0.1, 0.4, 0.9):
        here, heading = track.pose_at(np.array(share))
        there, opposite = turned.pose_at(np.array(1 - share))
        assert_allclose(here, there, atol=1e-9)
        assert np.cos(heading - opposite) == pytest.approx(-1, abs=1e-2)
    assert turned.ccw != track.ccw
    assert turned.length == track.length
    assert turned.reversed() == track
