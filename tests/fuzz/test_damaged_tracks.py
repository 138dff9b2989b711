"""Tracks from elsewhere: no pickle is opened, no shape is believed, no size is too much."""

import io

import numpy as np
import pytest
from read_damaged_files import Reading
from read_targets import OVAL

from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError, NotFound

ROWS = np.load(OVAL)


def saved(array, **options):
    file = io.BytesIO()
    np.save(file, array, **options)
    return file.getvalue()


def file_with(**changes):
    """A file whose header does not fit its numbers."""
    data = saved(ROWS)
    for old, new in changes.values():
        assert old in data
        data = data.replace(old, new, 1)
    return data


class Evil:
    def __reduce__(self):
        return (print, ("ran",))


def spoilt(place, number):
    track = ROWS.copy()
    track[place] = number
    return saved(track)


LISTED = [("a", "f8"), ("b", "f8")]
NO_ARRAY = "expected an array .* as numpy.save writes it, found none"
TRACKS = {
    "a pickle": (saved(np.array([Evil()] * 6, object).reshape(1, 6), allow_pickle=True), NO_ARRAY),
    "a bare pickle": (b"\x80\x04cos\nsystem\n(S'touch ran'\ntR.", NO_ARRAY),
    "an archive": (b"PK\x03\x04" + b"\0" * 100, NO_ARRAY),
    "a huge shape": (
        file_with(a=(b"(101, 6), } " + b" " * 10, b"(1000000000000, 6), } ")),
        NO_ARRAY,
    ),
    "an endless shape": (file_with(a=(b"(101, 6)" + b" " * 0, b"(101,-6)")), NO_ARRAY),
    "code": (file_with(a=(b"(101, 6)", b"exit(9) ")), NO_ARRAY),
    "a deep header": (b"\x93NUMPY\x01\0\xff\xff" + b"-" * 65_535, NO_ARRAY),
    "a structure": (saved(np.zeros(9, LISTED)), NO_ARRAY),
    "complex numbers": (saved(ROWS.astype(complex)), "expected finite numbers, .*complex128"),
    "texts": (saved(ROWS.astype("U9")), NO_ARRAY),
    "truth": (saved(ROWS > 0), NO_ARRAY),
    "one number": (saved(np.array(1.0)), r"expected an array of shape \(N, 6\), found \(\)"),
    "no rows": (saved(ROWS[:0]), "expected at least 5 rows .*, found 0"),
    "a row": (saved(ROWS[:1]), "expected at least 5 rows .*, found 1"),
    "two rows": (saved(ROWS[:2]), "expected at least 5 rows .*, found 2"),
    "three rows": (saved(ROWS[:3]), "expected at least 5 rows .*, found 3"),
    "one point": (saved(np.ones((50, 6))), "expected at least 5 rows .*, found 1"),
    "NaN": (spoilt((5, 2), np.nan), "expected finite numbers"),
    "infinity": (spoilt((5, 2), np.inf), "expected finite numbers"),
    "far away": (spoilt((5, 2), 1e300), "within 10,000 m of the origin"),
    "too wide": (saved(ROWS * 100), "on at most 2,500 m², .* its unit is the metre"),
    "a million points": (saved(np.tile(ROWS, (10**4, 1))), "at most 8,388,608 bytes"),
    "many points": (saved(np.tile(ROWS, (100, 1))), "expected at most 5,000 rows, found 10,100"),
    "too long": (saved(np.tile(ROWS, (49, 1)) * 3), "of lines of at most 1,000 m"),
    "cut short": (saved(ROWS)[:-1], NO_ARRAY),
    "left over": (saved(ROWS) + b"x", NO_ARRAY),
}


@pytest.mark.parametrize("case", TRACKS)
def test_what_is_no_track_is_refused(tmp_path, case):
    data, message = TRACKS[case]
    (tmp_path / "mine.npy").write_bytes(data)
    load_track("oval")  # whose kernels are compiled now, unwatched
    reading = Reading()
    with reading.watched(case, data), pytest.raises(CardError, match=message):
        load_track(str(tmp_path / "mine.npy"))
    assert reading.failures == []


@pytest.mark.parametrize(
    "rows", [ROWS, np.asfortranarray(ROWS), ROWS.astype(">f8"), ROWS.astype("g")], ids=lambda _: ""
)
def test_a_track_is_the_same_in_any_order_of_bytes(tmp_path, rows):
    (tmp_path / "oval.npy").write_bytes(saved(rows))
    assert load_track(str(tmp_path / "oval.npy")) == load_track("oval")


@pytest.mark.parametrize("name", ["x" * 5000 + ".npy", "\0.npy"])
def test_a_track_of_an_impossible_name_is_not_there(name):
    with pytest.raises(NotFound, match="expected a file of waypoints at"):
        load_track(name)
