"""Tracks that people drew: nearly closed ones are closed, loops of borders are cut."""

from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.envs.racer.track.geometry import ring_holds
from repaint_cli.envs.racer.track.repair import cut_loops
from repaint_cli.envs.racer.track.track import Track

ROOT = Path(__file__).parents[1]
SHIPPED = sorted((ROOT / "tasks" / "racer" / "tracks").glob("*.npy"))
SHARED = ROOT.parent / "shared" / "data" / "deepracer"
HALF = 0.38  # of a road's width, m


def rounded(corners, radius, spacing=0.1):
    """A ring along a convex polygon (counter-clockwise) with rounded corners, and its normals."""
    sides = np.roll(corners, -1, axis=0) - corners
    ways = sides / np.hypot(*sides.T)[:, None]
    points, normals = [], []
    for k, corner in enumerate(corners):
        into, out = ways[k - 1], ways[k]
        turn = np.arccos(np.clip(into @ out, -1, 1))
        left = np.array([-into[1], into[0]])
        middle = corner + radius * (left - np.tan(turn / 2) * into)
        if points:
            straight = middle - radius * left - points[-1]
            shares = np.linspace(0, 1, max(2, int(np.hypot(*straight) / spacing)))[1:-1]
            points += [points[-1] + share * straight for share in shares]
            normals += [left] * len(shares)
        for angle in np.linspace(0, turn, max(4, int(turn * radius / 0.02))):
            normals.append(np.cos(angle) * left - np.sin(angle) * into)
            points.append(middle - radius * normals[-1])
    last = points[0] - points[-1]
    shares = np.linspace(0, 1, max(2, int(np.hypot(*last) / spacing)))[1:-1]
    points += [points[-1] + share * last for share in shares]
    normals += [normals[-1]] * len(shares)
    return np.array(points), np.array(normals)


def drawn(corners, radius, first=0, clockwise=False, half=HALF):
    """Rows as people's scripts make them: each border point at half a width from its row."""
    points, normals = (np.roll(line, -first, axis=0) for line in rounded(corners, radius))
    rows = np.hstack([points, points + half * normals, points - half * normals])
    rows = np.vstack([rows, rows[:1]])
    return rows[::-1].copy() if clockwise else rows


def crosses_itself(line):
    """Whether segments properly cross, for all pairs at once."""
    a, b = line[:-1], line[1:]

    def sides(points):
        """On which side of each segment (rows) each point (columns) lies."""
        way, there = (b - a)[:, None], points[None] - a[:, None]
        return way[..., 0] * there[..., 1] - way[..., 1] * there[..., 0]

    apart = sides(a) * sides(b) < 0
    near = np.abs(np.subtract.outer(np.arange(len(a)), np.arange(len(a)))) < 2
    return bool((apart & apart.T & ~near).any())


SQUARE = np.array([[0, 0], [4, 0], [4, 3], [0, 3.0]])


@settings(max_examples=25, deadline=None)
@given(
    radius=st.floats(0.03, 0.3), first=st.integers(0, 150), clockwise=st.booleans(),
    n=st.integers(3, 6), turn=st.floats(0, 6), aside=st.sampled_from([0, 1e-6, 1e-3, 0.05]),
)  # fmt: skip
def test_borders_with_loops_become_simple_rings_of_as_many_rows(
    radius, first, clockwise, n, turn, aside
):
    angles = turn + np.arange(n) * 2 * np.pi / n
    corners = 3.5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    rows = drawn(corners, radius, first, clockwise)
    assert crosses_itself(rows[:, 2:4])
    rows[-1, 2:] += aside * np.array([0.6, 0.8, -0.8, 0.6])
    track = Track.from_waypoints(rows, "mine")
    assert track.closed
    assert "loops of the inner border cut at rows" in track.note
    assert_array_equal(track.centre, rows[:, :2])
    for border in (track.inner, track.outer):
        assert len(border) == len(rows)
        assert_array_equal(border[0], border[-1])
        assert not crosses_itself(border)
    near, _ = reference.line_project(track.inner, track.centre)
    assert np.hypot(*(near - track.centre).T).min() > HALF - 0.03
    # the borders of a sharp polygon meet in a corner, where all rows of the loop now lie
    inwards = 1 - HALF / (3.5 * np.cos(np.pi / n))
    for corner in corners * inwards:
        assert np.hypot(*(track.inner - corner).T).min() < 0.06


def test_only_rows_of_loops_change_and_the_note_names_them():
    rows = drawn(SQUARE, 0.1)
    track = Track.from_waypoints(rows, "mine")
    changed = np.flatnonzero((track.inner != rows[:, 2:4]).any(axis=1))
    assert_array_equal(track.outer, rows[:, 4:])
    ranges = np.split(changed, np.flatnonzero(np.diff(changed) > 1) + 1)
    named = ", ".join("-".join(dict.fromkeys([f"{g[0]}", f"{g[-1]}"])) for g in ranges)
    assert track.note == f"loops of the inner border cut at rows {named} (rows count from 0)"
    for group in ranges[1:-1]:
        assert len(np.unique(track.inner[group], axis=0)) == 1


def test_a_loop_through_the_start_is_one_loop():
    whole, turned = (Track.from_waypoints(drawn(SQUARE, 0.2, k), "mine") for k in (0, 8))
    assert_allclose(
        np.unique(whole.inner.round(9), axis=0), np.unique(turned.inner.round(9), axis=0)
    )
    loop = np.array([[0, 0], [4, 0], [4, 3], [0.1, 3], [0.1, -0.2], [-0.2, 0.1], [0.0, 0.0]])
    assert_array_equal(cut_loops(loop, closed=True), [True, False, False, False, True, True, True])
    assert_allclose(loop[[0, 4, 5, 6]], [[0.1, 0.0]] * 4)


def test_loops_within_loops_are_cut():
    line = np.array(
        [[0, 0], [2, 0], [2, 1], [1.5, -0.5], [1.4, 0.5], [1.7, 0.4], [1, -1], [0.5, 0.8], [9, 9]],
        float,
    )
    assert crosses_itself(line)
    cut_loops(line, closed=False)
    assert not crosses_itself(line)
    assert_array_equal(line[[0, -1]], [[0, 0], [9, 9]])


@pytest.mark.parametrize("metres", [1e-6, 2e-5, 1e-3, 0.08])
def test_borders_that_end_beside_their_start_are_closed(metres):
    rows = drawn(SQUARE, 1.0)
    exact = Track.from_waypoints(rows, "mine")
    rows[-1, 2:4] += metres * np.array([0.6, 0.8])
    mended = Track.from_waypoints(rows, "mine")
    assert mended == exact
    assert exact.note == ""
    shown = f"{1000 * metres:.2g} mm"
    row = f"row {len(rows) - 1} onto row 0"
    assert mended.note == f"closed by moving {row}, {shown} away (rows count from 0)"


@pytest.mark.parametrize(("rows", "note"), [
    (lambda rows: rows[:-1], "closed over a gap of 0.11 m"),
    (lambda rows: rows[3:], "closed over a gap of 61 mm"),
    (lambda rows: np.vstack([rows[:-1], rows[:1] + 1e-3]), "closed by moving row"),
    (lambda rows: np.vstack([rows, rows[:1] + 1e-3]), "closed by moving row"),
])  # fmt: skip
def test_a_centre_line_whose_ends_nearly_meet_is_closed(rows, note):
    whole = drawn(SQUARE, 1.0)
    track = Track.from_waypoints(rows(whole), "mine")
    assert track.closed
    assert note in track.note
    assert track.length == pytest.approx(Track.from_waypoints(whole, "mine").length, abs=0.01)
    assert (np.diff(track.distances) > 0).all()
    assert np.isfinite(track.pose_at(np.array([0.0, 0.9999, 1.0]))[0]).all()


def eight():
    t = np.linspace(0, 2 * np.pi, 60)
    line = np.stack([3 * np.sin(t) + np.sin(t) ** 2, 3 * np.sin(t) * np.cos(t)], axis=1)
    return np.hstack([line, line * 0.8, line * 1.2])


def pinched():
    """A bump of the road whose outer border crosses itself where the bump begins."""
    rows = drawn(SQUARE, 1.0)
    top = np.flatnonzero((rows[:, 1] > 2.99) & (rows[:, 0] > 1.2) & (rows[:, 0] < 2.8))
    first = top[len(top) // 2 - 1]
    x = rows[first, 0]
    rows[[first, first + 1], 1] += 1
    bump = np.array([[x - 0.15, 3.5], [x + 0.5, 4.9], [x - 0.6, 4.9], [x + 0.05, 3.5]])
    rows[first - 1 : first + 3, 4:] = bump
    return rows


@pytest.mark.parametrize(("rows", "message"), [
    (eight(), r"the centre line must not cross itself, found a crossing of rows \d+-\d+ with rows"),
    (pinched(), r"without their loops the centre line leaves the road at rows \d+-\d+; repair"),
])  # fmt: skip
def test_what_cannot_be_driven_is_refused_by_rows(rows, message):
    with pytest.raises(ValueError, match="track 'mine'.*" + message):
        Track.from_waypoints(rows, "mine")


def test_rows_without_numbers_are_named():
    rows = drawn(SQUARE, 1.0)
    rows[[3, 4, 9], 2] = np.nan
    with pytest.raises(ValueError, match="found NaN or infinity in rows 3-4, 9; remove"):
        Track.from_waypoints(rows, "mine")


def test_loops_of_an_open_track_are_cut():
    rows = drawn(SQUARE, 0.1)[20:90]
    track = Track.from_waypoints(rows, "mine")
    assert not track.closed
    assert "loops of the inner border cut" in track.note
    assert not crosses_itself(track.inner)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_tracks_stay_as_they_are_to_the_bit(path):
    rows, track = np.load(path), load_track(path.stem)
    assert_array_equal(np.hstack([track.centre, track.inner, track.outer]), rows)
    assert_array_equal(track.repeats, 1)
    assert track.note == ""


@pytest.mark.skipif(not SHARED.is_dir(), reason="the DeepRacer tracks are not here")
@pytest.mark.parametrize("name", ["Albert", "Oval_track", "Straight_track", "reinvent_base"])
def test_league_tracks_need_no_mending(name):
    rows = np.load(SHARED / "tracks" / f"{name}.npy")
    track = Track.from_waypoints(rows, name)
    kept = np.concatenate([[True], np.abs(np.diff(rows, axis=0)).max(axis=1) > 1e-9])
    assert_array_equal(np.hstack([track.centre, track.inner, track.outer]), rows[kept])
    assert track.note == ""


@pytest.mark.skipif(not SHARED.is_dir(), reason="the cases are not here")
def test_the_almost_closed_case_is_a_lap_with_a_note():
    track = load_track(str(SHARED / "cases" / "almost_closed.npy"))
    assert track.closed
    assert "closed by moving row 90 onto row 0, 0.022 mm away" in track.note


def test_a_mended_track_holds_its_centre_line():
    track = Track.from_waypoints(drawn(SQUARE, 0.05), "mine")
    for x, y in track.centre:
        assert ring_holds(track.outer, x, y)
        assert not ring_holds(track.inner, x, y)
