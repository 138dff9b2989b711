from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from numpy.testing import assert_allclose, assert_array_equal

from repaint_cli.envs.racer.sight import camera, ground
from repaint_cli.envs.racer.track.track import Track

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
STRAIGHT = 3.0  # y of the road's middle in `wide_box`


@pytest.fixture(scope="module", params=["reinvent-like", "wide-loop", "open"])
def track(request):
    if request.param == "open":
        x = np.linspace(0, 5, 40)
        line, up = np.stack([x, 0.4 * np.sin(x)], axis=1), np.array([0, 0.4])
        return Track.from_waypoints(np.hstack([line, line + up, line - up]), "open")
    return Track.from_waypoints(np.load(TRACKS / f"{request.param}.npy"), request.param)


@pytest.fixture(scope="module")
def wide_box():
    """A rectangular road, 1 m wide, whose lower side runs east along y = 3 from x = 3 to x = 15."""
    corners = np.array([[3, 3], [15, 3], [15, 9], [3, 9], [3, 3]], dtype=float)
    inward = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) / 2
    return Track.from_waypoints(np.hstack([corners, corners + inward, corners - inward]), "box")


def seen(track, x, y, heading):
    state = np.array([x, y, heading, 0.0, 0.0])
    picture = ground.ground_of(track)
    image = np.zeros((camera.HEIGHT, camera.WIDTH), np.uint8)
    parts = (picture.levels, picture.origin, picture.field, camera.WALLS)
    camera.render(state, 0.0, camera.row_table(), *parts, image)
    return image


def test_the_lens_is_deepracers():
    assert pytest.approx(126.2, abs=0.05) == camera.FOCAL
    table = camera.row_table()
    assert_array_equal(np.flatnonzero(table[:, camera.SKYWARD]), range(26))  # horizon at 26.2
    assert table[-1, camera.AHEAD] == pytest.approx(0.299, abs=0.003)


def test_pictures_agree_with_rays_cast_pixel_by_pixel(track):
    rng = np.random.default_rng(0)
    picture = ground.ground_of(track)
    for _ in range(25):
        x, y = rng.uniform(picture.field[:2] + 0.2, picture.field[2:] - 0.2)
        state = np.array([x, y, rng.uniform(-np.pi, np.pi), 0, 0])
        difference = np.abs(seen(track, *state[:3]) - reference.render(state, picture))
        # a pixel on the very edge of a wall may go either way
        assert np.count_nonzero(difference > 1.0) <= 5


def test_the_ground_is_painted_as_the_rule_for_one_point_says(track):
    rng = np.random.default_rng(1)
    picture = ground.ground_of(track)
    rows, columns = (rng.integers(size, size=2000) for size in picture.levels[0].shape)
    points = picture.origin + (np.stack([columns, rows], axis=1) + 0.5) * ground.TEXEL
    painted = picture.levels[0][rows, columns].astype(float)
    # the raster works in single precision
    assert np.abs(painted - reference.luma(track, points)).max() <= 1.5
    assert len(np.unique(painted)) > 10


def test_the_ground_holds_the_four_materials_in_their_places(wide_box):
    y = STRAIGHT + np.array([-0.9, -0.47, 0.25, 0.47, 0.9])
    points = np.stack([np.full(5, 7.0), y], axis=1)
    road, line, field = ground.ROAD, ground.LINE, ground.FIELD
    assert_allclose(reference.luma(wide_box, points), [field, line, road, line, field])
    x = 3 + ground.DASH * (np.arange(6) + 0.5)
    dashes = reference.luma(wide_box, np.stack([x, np.full(6, STRAIGHT)], axis=1))
    assert_allclose(dashes, [ground.CENTRE_LINE, ground.ROAD] * 3)


def test_coarser_levels_cover_the_same_field(track):
    levels = ground.ground_of(track).levels
    assert len(levels) == ground.LEVELS
    for fine, coarse in pairwise(levels):
        assert fine.shape == (2 * coarse.shape[0], 2 * coarse.shape[1])
        assert coarse.mean() == pytest.approx(fine.mean(), abs=0.5)


def test_on_a_straight_road_the_picture_is_symmetric_and_all_there(wide_box):
    image = seen(wide_box, 5.0, STRAIGHT, 0.0)
    below = image[60:].astype(int)
    assert np.abs(below - below[:, ::-1]).max() <= 12  # texels are not centred on the road
    assert image[0, 80] == camera.SKY
    assert image[26, 80] == camera.WALLS[1]  # the wall in the east, 11 m ahead
    assert (image[45] == ground.LINE).any()
    assert image[100, 60] == ground.ROAD


def test_left_is_left(wide_box):
    # 0.25 m right of the middle, the right line (y = 2.5) is nearer and so lower in the picture
    image = seen(wide_box, 5.0, STRAIGHT - 0.25, 0.0)
    lowest_left = np.flatnonzero((image[:, :40] == ground.LINE).any(axis=1)).max()
    lowest_right = np.flatnonzero((image[:, 120:] == ground.LINE).any(axis=1)).max()
    assert lowest_right > lowest_left
    # heading north-east, the east wall is on the right, the north wall on the left
    image = seen(wide_box, 9.0, 6.0, np.pi / 4)
    assert image[26, 0] == camera.WALLS[3]
    assert image[26, 159] == camera.WALLS[1]


def test_a_line_on_the_ground_appears_where_the_lens_formula_puts_it(wide_box):
    # the near edge of the border line across the road's end, seen along the road
    image = seen(wide_box, 14.6, STRAIGHT, 0.0)
    distance = 15.5 - ground.LINE_WIDTH - 14.6 - camera.CAMERA_X
    dip = np.arctan2(camera.CAMERA_Z, distance) - camera.PITCH
    row = 60 + camera.FOCAL * np.tan(dip)
    column = image[:, 90].astype(int)
    first_road = np.flatnonzero(column > 137).max() + 1  # the line ends above this row
    assert first_road == pytest.approx(row, abs=1.0)


def test_walls_hide_the_sky_when_near(wide_box):
    field = ground.ground_of(wide_box).field
    assert not (seen(wide_box, field[2] - 1.0, 6.0, 0.0) == camera.SKY).any()
    assert (seen(wide_box, field[2] - 8.0, 6.0, 0.0) == camera.SKY).any()


def test_one_track_is_painted_once(track):
    rows = np.hstack([track.centre, track.inner, track.outer])
    again = Track.from_waypoints(rows, track.name)
    assert ground.ground_of(again) is ground.ground_of(track)
