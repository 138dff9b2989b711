"""`repaint tasks track from-centre-line`: a file of waypoints around a centre line."""

import numpy as np
import pytest
import racer_reference as reference
from hypothesis import given, settings
from hypothesis import strategies as st

from repaint_cli.envs.racer.track.centre_line import read_centre_line, rows_around
from repaint_cli.envs.racer.track.track import Track

WIDTH = 0.76


def wavy(amplitude=0.3, waves=3, clockwise=False, n=120):
    t = np.linspace(0, 2 * np.pi, n)[:: -1 if clockwise else 1]
    radius = 3 + amplitude * np.cos(waves * t)
    line = np.stack([radius * np.cos(t), radius * np.sin(t)], axis=1)
    line[-1] = line[0]
    return line


@settings(max_examples=30, deadline=None)
@given(amplitude=st.floats(0, 1.5), waves=st.integers(2, 6), clockwise=st.booleans())
def test_borders_run_at_half_a_width_but_in_corners_tighter_than_that(amplitude, waves, clockwise):
    line = wavy(amplitude, waves, clockwise)
    rows, done = rows_around(line, WIDTH, "mine")
    assert done == []
    track = Track.from_waypoints(rows, "mine")
    assert track.ccw is not clockwise
    assert len(track.centre) == len(line)
    for border in (track.inner, track.outer):
        assert not reference.crosses_itself(border)
        near, _ = reference.line_project(border, line)
        gaps = np.hypot(*(near - line).T)
        assert gaps.min() > 0.9 * WIDTH / 2
        assert np.median(gaps) == pytest.approx(WIDTH / 2, abs=0.01)
    again = Track.from_waypoints(np.hstack([track.centre, track.inner, track.outer]), "mine")
    assert again.note == ""


def test_a_ring_whose_first_point_is_not_repeated_keeps_all_its_points():
    """Also where points are closer together at its ends than elsewhere."""
    t = np.linspace(0, 2 * np.pi, 81)[:-1]
    line = np.stack([3 * np.cos(t), 1.5 * np.sin(t)], axis=1)  # 0.12 m apart here, else up to 0.24
    rows, (done,) = rows_around(line, WIDTH, "mine")
    assert len(rows) == 81
    assert (rows[:-1, :2] == line).all()
    assert (rows[-1] == rows[0]).all()
    assert done.startswith("closed over a gap of 0.12 m")


def test_a_corner_of_a_border_runs_along_both_sides():
    box = np.array([[0, 0], [4, 0], [4, 3], [0, 3], [0, 0.0]])
    rows, _ = rows_around(box, 1.0, "box")
    np.testing.assert_allclose(rows[1], [4, 0, 3.5, 0.5, 4.5, -0.5])
    np.testing.assert_array_equal(rows[0], rows[-1])


def test_an_open_line_has_its_inner_border_on_the_left():
    rows, _ = rows_around(np.array([[0, 0], [1, 0], [2, 0], [3, 0], [4, 0.0]]), 1.0, "lane")
    np.testing.assert_allclose(rows[2], [2, 0, 2, 0.5, 2, -0.5])


@pytest.mark.parametrize("form", ["csv", "spaces", "bare", "npy"])
def test_a_centre_line_is_read_in_these_forms(home, form):
    line = wavy()[:-1]
    if form == "npy":
        np.save("line.npy", line.astype(np.float32))
    else:
        mark = " " if form == "spaces" else ", "
        head = {"csv": "\ufeffx, y\n", "spaces": "# a comment\n\n", "bare": ""}[form]
        text = "\n".join(f"{x:.6f}{mark}{y:.6f}" for x, y in line)
        (home / "line.csv").write_text(head + text + "\n", encoding="utf-8")
    file = "line.npy" if form == "npy" else "line.csv"
    np.testing.assert_allclose(read_centre_line(file), line, atol=1e-6)


def test_the_command_writes_a_track_that_is_sound(repaint, home):
    np.savetxt("line.csv", wavy(1.2, 3)[:-1], delimiter=",", header="x,y", comments="")
    said = repaint("tasks", "track", "from-centre-line", "line.csv", "--width", 0.76)
    assert (said.code, said.err) == (0, "")
    first, note, last = said.out.splitlines()
    assert first.startswith("wrote line-track.npy: ")
    assert note.startswith("note: closed over a gap of ")
    assert "; loops of the outer border cut at rows " in note
    assert last == "next: repaint tasks check line-track.npy"
    assert np.load("line-track.npy").shape == (120, 6)
    said = repaint("tasks", "check", "line-track.npy")
    assert said.code == 0
    assert "line-track is sound: " in said.out
    assert "note: " not in said.out
    said = repaint("tasks", "track", "from-centre-line", "line.csv")
    assert (said.code, said.err) == (7, "error: line-track.npy exists already\n")
    said = repaint("tasks", "track", "from-centre-line", "line.csv", "--output", "own.npy")
    assert (said.code, np.load("own.npy").shape) == (0, (120, 6))


LINE = "\n".join(f"{x},{y}" for x, y in wavy())


@pytest.mark.parametrize(("text", "width", "code", "message"), [
    (None, 0.76, 2, "expected a centre line at 'line.csv', found none"),
    ("", 0.76, 3, "expected lines of two numbers, x and y, found none"),
    ("x,y\nx,y\n1,2", 0.76, 3, "expected two numbers, x and y, found 'x,y' in line 2"),
    ("1,2,3\n", 0.76, 3, "expected two numbers, x and y, found '1,2,3' in line 1"),
    ("1,2\n3\n", 0.76, 3, "expected two numbers, x and y, found '3' in line 2"),
    (LINE.replace(LINE.split("\n")[5], "nan,1"), 0.76, 3, "found NaN or infinity in row 5"),
    ("0,0\n1,0\n2,0\n1,0\n1,1\n1,2\n1,3\n1,4", 0.76, 3, "it turns back at row 2; smooth it"),
    ("0,0\n1,0\n2,0", 0.76, 3, "expected at least 5 rows that differ"),
    (LINE, 0.1, 2, "expected a --width of 0.2 to 10 m, found 0.1"),
    (LINE, float("nan"), 2, "expected a --width of 0.2 to 10 m, found nan"),
    (LINE, 7, 3, "expected an infield, found none beside a road of 7 m; try a smaller width"),
])  # fmt: skip
def test_what_is_no_centre_line_is_refused_in_a_line(repaint, home, text, width, code, message):
    if text is not None:
        (home / "line.csv").write_text(text)
    said = repaint("tasks", "track", "from-centre-line", "line.csv", "--width", width)
    assert (said.code, said.out, said.err.count("\n")) == (code, "", 1)
    assert message in said.err
    assert not (home / "line-track.npy").exists()


@pytest.mark.parametrize("points", [np.zeros((9, 3)), np.zeros(9), np.array(["a"])])
def test_an_array_of_another_shape_is_no_centre_line(repaint, home, points):
    np.save("line.npy", points)
    said = repaint("tasks", "track", "from-centre-line", "line.npy")
    assert (said.code, said.err.count("\n")) == (3, 1)
    assert "line.npy: expected an array (N, 2) of x and y, found" in said.err
