"""Six pictures that were looked at once and are not to change unnoticed.

`python tests/test_racer_golden.py` paints them anew, into tests/golden/; then look at them.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from repaint_cli.envs.racer.dynamics.fleet import Fleet
from repaint_cli.envs.racer.dynamics.objects import Objects, ObjectSettings
from repaint_cli.envs.racer.sight.sensors import Sensors
from repaint_cli.envs.racer.track.files import load_track

FOLDER = Path(__file__).parent / "golden"
POSES = {
    "straight": ("reinvent-like", 0.62, 0.0, 0.0, None),
    "bend": ("reinvent-like", 0.30, 0.0, 0.0, None),
    "across-the-border": ("reinvent-like", 0.10, -0.3, -0.3, None),
    "towards-a-wall": ("oval", 0.25, -0.9, -1.3, None),
    "behind-a-bot": ("wide-loop", 0.05, 0.15, 0.0, (0.9, 0.1, 0.3)),
    "beside-a-bot": ("wide-loop", 0.55, -0.2, 0.1, (0.75, -0.35, 0.9)),
}
"""Track, lap fraction, metres to the left of the centre line, turn from it to the left (rad), and
a bot: metres ahead and to the left of the car, and its turn."""


def look(pose):
    """What both eyes see, side by side, (120, 320); without a bot one eye, (120, 160)."""
    track_name, share, aside, turn, bot = pose
    track = load_track(track_name)
    fleet = Fleet(track, 1, "sim4", 100)
    point, heading = track.pose_at(np.array([share]))
    left = np.array([-np.sin(heading[0]), np.cos(heading[0])])
    yaw = heading[0] + turn
    fleet.states[0, :3] = *(point[0] + aside * left), yaw
    if bot:
        ahead, beside, bot_turn = bot
        way = np.array([np.cos(yaw), np.sin(yaw)])
        fleet.objects = Objects(1, ObjectSettings(1))
        place = fleet.states[0, :2] + ahead * way + beside * np.array([-way[1], way[0]])
        fleet.objects.poses[0, 0, :3] = *place, yaw + bot_turn
    sensors = Sensors(track, "stereo" if bot else "camera", 0.12, None, 1)
    (image,) = sensors.read(np.arange(1), fleet, [np.random.default_rng(0)])["camera"]
    return np.concatenate(np.moveaxis(image, 2, 0), axis=1)


@pytest.mark.parametrize("name", POSES)
def test_a_picture_is_as_it_was(name):
    with Image.open(FOLDER / f"{name}.png") as golden:
        wanted = np.asarray(golden).astype(int)
    found = look(POSES[name]).astype(int)
    assert found.shape == wanted.shape
    # the last digit of a sine may differ between machines, and move an edge by a hair
    assert np.count_nonzero(np.abs(found - wanted) > 1) <= 3


if __name__ == "__main__":
    for name, pose in POSES.items():
        Image.fromarray(look(pose)).save(FOLDER / f"{name}.png")
