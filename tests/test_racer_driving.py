from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.racer.dynamics.car import (
    ACTIONS,
    CAR_POINTS,
    CAR_PROFILES,
    FRONT_OFFSET,
    STEP_SECONDS,
    commands_of,
    drive_rows,
)
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import STATUS
from repaint_cli.envs.racer.track.geometry import CENTRE_GAP, INNER_GAP, NDIST, OUTER_GAP, measure
from repaint_cli.envs.racer.track.track import Track

TRACKS = Path(__file__).parents[1] / "tasks" / "racer" / "tracks"
COMMANDS = commands_of(ACTIONS)


class Planner:
    """Looks eight steps ahead with each action held, and takes the best for a lane."""

    def __init__(self, track, lane):
        self.track, self.lane = track, lane
        self.car = CAR_PROFILES["sim4"].constants()
        self.before = np.zeros(2)

    def __call__(self, infos):
        x, y, yaw, speed, steering = (
            infos[key][0] for key in ("x", "y", "heading", "speed", "steering")
        )
        base = x - FRONT_OFFSET * np.cos(yaw), y - FRONT_OFFSET * np.sin(yaw)
        states = np.tile([*base, yaw, speed, steering], (10, 1))
        before, rows = np.tile(self.before, (10, 1)), np.arange(10)
        fronts, measures, scores = np.zeros((10, 2)), np.zeros((10, 6)), np.zeros(10)
        track = self.track
        lines = (*track.lines, *track.outline)
        measure(rows, states, CAR_POINTS, *lines, fronts, measures)
        ndist = measures[:, NDIST].copy()
        for _ in range(8):
            drive_rows(rows, states, before, COMMANDS, self.car, STEP_SECONDS)
            before = COMMANDS
            measure(rows, states, CAR_POINTS, *lines, fronts, measures)
            lead = self.lane * (measures[:, OUTER_GAP] - measures[:, INNER_GAP])
            scores += (lead > 0.03) - 5.0 * (measures[:, CENTRE_GAP] > 0.28)
        scores += 100 * ((measures[:, NDIST] - ndist + 0.5) % 1 - 0.5)
        best = int(scores.argmax())
        self.before = COMMANDS[best]
        return np.array([best])


@pytest.mark.parametrize("reverse", [False, True])
def test_an_open_track_is_driven_from_end_to_end(reverse):
    x = np.linspace(0, 8, 60)
    line = np.stack([x, 0.4 * np.sin(x)], axis=1)
    up = np.array([0, 0.5])
    rows = np.hstack([line, line + up, line - up])
    track = Track.from_waypoints(rows, "lane")
    env = RacerVectorEnv(track, 1)
    places = {"lap_fraction": np.full(1, 0.3), "reverse": np.array([reverse])}
    _, infos = env.reset(options=places)  # an open track is always driven from its beginning
    assert infos["x"][0] == pytest.approx(8 - 0.34 if reverse else 0.34, abs=0.05)
    planner, terminated = Planner(track.reversed() if reverse else track, 1), [False]
    progress, on_road = [], []
    while not terminated[0]:
        _, _, terminated, truncated, infos = env.step(planner(infos))
        progress.append(infos["progress"][0])
        if progress[-1] < 90:
            on_road.append(int(infos["wheels_on"][0]))
        assert not truncated[0]
    assert STATUS[int(infos["status"][0])] == "lap_complete"
    assert progress[0] < 5
    assert on_road == [4] * len(on_road)
    assert progress[-1] == 100
    assert infos["dprog"][0] > 0


@pytest.mark.parametrize("length", np.arange(8.0, 8.5, 0.05))
def test_a_fast_car_arrives_at_the_end_of_an_open_track_and_does_not_leave_it(length):
    line = np.stack([np.linspace(0, length, 40), np.zeros(40)], axis=1)
    up = np.array([0, 0.4])
    track = Track.from_waypoints(np.hstack([line, line + up, line - up]), "lane")
    env = RacerVectorEnv(track, 1, actions=[(0, 4.0)])
    env.reset()
    terminated = [False]
    while not terminated[0]:
        _, _, terminated, _, infos = env.step(np.zeros(1, int))
    assert STATUS[int(infos["status"][0])] == "lap_complete"
    assert infos["fail"][0] == 0


@pytest.mark.parametrize("lane", [1, -1])
@pytest.mark.parametrize("name", ["reinvent-like", "wide-loop", "oval"])
def test_shipped_tracks_can_be_lapped_in_either_lane(name, lane):
    track = Track.from_waypoints(np.load(TRACKS / f"{name}.npy"), name)
    env = RacerVectorEnv(track, 1)
    _, infos = env.reset(options={"lap_fraction": np.zeros(1)})
    planner, terminated, lanes = Planner(track, lane), [False], []
    while not terminated[0]:
        _, _, terminated, truncated, infos = env.step(planner(infos))
        lanes.append(infos["lane"][0])
        assert not truncated[0]
    assert STATUS[int(infos["status"][0])] == "lap_complete"
    assert infos["progress"][0] == 100
    assert len(lanes) < 22 * track.length
    assert np.mean(np.array(lanes) == lane) > 0.95
