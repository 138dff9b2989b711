from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.track import geometry
from repaint_cli.envs.racer.track.track import Track

SHIPPED = sorted((Path(__file__).parents[1] / "tasks" / "racer" / "tracks").glob("*.npy"))
REAL = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "tracks"
BOX = np.array([[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]], dtype=float)


def box_rows(centre=1.0, inner=0.5, outer=1.5):
    """A rectangular road; its rings are one rectangle scaled about its middle."""
    middle = np.array([2.0, 1.5])
    return np.hstack([middle + scale * (BOX - middle) for scale in (centre, inner, outer)])


def open_rows(width=1.0, bend=0.5, n=6):
    """A road eastwards, its inner border in the north."""
    x = np.linspace(0, 6, n)
    line = np.stack([x, bend * np.sin(x)], axis=1)
    up = np.array([0, width / 2])
    return np.hstack([line, line + up, line - up])


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


def test_repeated_rows_are_waypoints_but_no_corners():
    rows = box_rows()
    repeated, plain = np.insert(rows, 2, rows[2], axis=0), Track.from_waypoints(rows, "box")
    assert Track.from_waypoints(repeated, "box", unique=True) == plain
    twice = Track.from_waypoints(repeated, "box")
    assert twice != plain
    assert_array_equal(twice.centre, plain.centre)
    assert_array_equal(twice.distances, plain.distances)
    assert_array_equal(twice.waypoints[0], repeated[:, :2])
    assert_array_equal(twice.reversed().waypoints[0], repeated[::-1, :2])


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


def apart(metres):
    """A box whose borders end beside their start."""
    rows = box_rows()
    rows[-1, 3::2] -= metres
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
        (np.zeros((0, 6)), "expected at least 5 rows that differ .* found 0;"),
        (box_rows()[[0, 1, 2, 0]], "expected at least 5 rows that differ .* found 4;"),
        (
            apart(2.5),
            r"borders to end where they start, .* found row 4 2\.5 m beside row 0; repair",
        ),
        (crossing(), "the outer border must not cross itself, found a crossing of rows 0-1 with"),
        (box_rows(centre=0.0), "the centre line must enclose an area"),
        (box_rows(inner=1.5, outer=0.5), "inner border must lie inside the outer"),
        (open_rows()[:, [2, 3, 0, 1, 4, 5]], "the centre line must lie between the borders"),
        (open_rows()[[0, 2, 1, 3, 4, 5]], "the line around the road must not cross itself"),
        (
            open_rows(n=40)[[*range(10), 11, 10, *range(12, 40)]],
            "the line around the road must not cross itself, found a crossing of rows",
        ),
    ],
)
def test_what_is_no_road_is_refused_in_a_sentence(rows, message):
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
        track = load(path)
        assert track.closed == (path.stem != "Straight_track")
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
        near, where = reference.line_project(ring, points)
        ours = np.array([geometry.line_project(ring, x, y) for x, y in points])
        assert_allclose(ours[:, :2], near, atol=1e-9)
        assert_allclose(ours[:, 2], where, atol=1e-7)
        inside = [geometry.ring_holds(ring, x, y) for x, y in points]
        np.testing.assert_array_equal(inside, reference.ring_winds(ring, points))


@pytest.mark.parametrize("seed", range(60))
def test_crossings_are_those_of_their_slow_twin(seed):
    rng = np.random.default_rng(seed)
    line = rng.normal(size=(rng.integers(4, 8), 2))
    found = geometry.crossings(line, np.zeros((9, 2), np.int64))
    assert (found > 0) == reference.crosses_itself(line)


def test_projection_survives_a_border_that_holds_a_point_twice():
    ring = np.insert(BOX, 2, BOX[2], axis=0)
    assert geometry.line_project(ring, 5.0, 1.0)[:2] == (4.0, 1.0)


def test_projection_tie_goes_to_the_earlier_segment():
    assert geometry.line_project(BOX, 2.0, 1.5) == (2.0, 0.0, 0.5)


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


def test_an_open_track_begins_and_ends_and_lies_between_its_borders():
    road = Track.from_waypoints(open_rows(bend=0), "lane")
    assert not road.closed
    assert (road.length, road.width) == (6, 1)
    assert road.ccw  # the inner border is on the left
    points, headings = road.pose_at(np.array([0.0, 0.5, 1.0, 1.5]))
    assert_allclose(points, [[0, 0], [3, 0], [6, 0], [6, 0]])
    assert_allclose(headings, 0)
    edge, hole = road.outline
    inside = [(3, 0), (0.1, 0.4), (5.9, -0.4)]
    outside = [(3, 0.6), (-0.1, 0), (6.1, 0), (3, -0.6)]
    assert all(geometry.ring_holds(edge, *point) for point in inside)
    assert not any(geometry.ring_holds(edge, *point) for point in outside)
    assert not any(geometry.ring_holds(hole, *point) for point in inside + outside)


def test_an_open_track_the_other_way_is_the_same_road():
    road = Track.from_waypoints(open_rows(), "lane")
    back = road.reversed()
    assert not back.closed
    assert not back.ccw
    assert_allclose(back.pose_at(np.array(0.25))[0], road.pose_at(np.array(0.75))[0])
    assert back.reversed() == road


def test_the_tightest_radius_of_an_open_arc_is_its_own():
    angles = np.linspace(0, np.pi / 2, 400)
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    arc = Track.from_waypoints(np.hstack([2 * ring, 1.6 * ring, 2.4 * ring]), "arc")
    assert arc.tightest_radius == pytest.approx(2, rel=0.01)
    assert arc.ccw
