import csv
from pathlib import Path

import numpy as np
import pytest
import racer_reference as reference
from numpy.testing import assert_allclose

from repaint_cli.envs.racer.dynamics.car import (
    ACTIONS,
    CAR_PROFILES,
    FRONT_OFFSET,
    STEP_SECONDS,
    commands_of,
    drive,
)

LOGS = Path(__file__).parents[2] / "shared" / "data" / "deepracer" / "logs"


def driven(profile, command, seconds, speed=0.0, steering=0.0):
    state = np.array([0.0, 0.0, 0.0, speed, steering])
    command = np.array(command)
    for _ in range(round(seconds / STEP_SECONDS)):
        drive(state, command, command, CAR_PROFILES[profile].constants(), STEP_SECONDS)
    return state


def test_there_are_five_angles_at_two_speeds():
    steering, speed = commands_of(ACTIONS).T
    assert_allclose(np.rad2deg(steering), [-30, -15, 0, 15, 30] * 2)
    assert_allclose(speed, [0.5] * 5 + [1.0] * 5)


def test_commands_stay_within_what_the_car_can():
    assert_allclose(commands_of([(45, 9), (-45, 0)]), [[np.pi / 6, 4], [-np.pi / 6, 0.1]])


@pytest.mark.parametrize("profile", CAR_PROFILES)
def test_straight_ahead_stays_straight_and_reaches_its_speed(profile):
    x, y, yaw, speed, steering = driven(profile, [0.0, 1.0], 4.0)
    assert (y, yaw, steering) == (0, 0, 0)
    assert speed == pytest.approx(1.0, abs=1e-3)
    assert 3 < x <= 4.01


def test_left_is_positive():
    _, y, yaw, _, _ = driven("sim4", [np.deg2rad(15), 0.5], 2.0)
    assert y > 0
    assert yaw > 0


@pytest.mark.parametrize(("degrees", "radius"), [(10, 1.36), (15, 0.96), (20, 0.78), (30, 0.62)])
def test_steady_turns_have_the_measured_radius(degrees, radius):
    angle = np.deg2rad(degrees)
    state = np.array([0.0, 0.0, 0.0, 1.0, angle])
    command = np.array([angle, 1.0])
    before = state.copy()
    drive(state, command, command, CAR_PROFILES["sim4"].constants(), STEP_SECONDS)
    assert STEP_SECONDS / (state[2] - before[2]) == pytest.approx(radius, abs=0.006)


def test_the_ideal_car_obeys_at_once_and_turns_in_a_circle_of_its_wheelbase():
    angle = np.deg2rad(30)
    state = driven("ideal", [angle, 1.0], STEP_SECONDS)
    assert_allclose(state[3:], [1.0, angle])
    assert STEP_SECONDS / state[2] == pytest.approx(0.164 / np.tan(angle))


def test_a_command_waits_for_the_delay():
    state, still, go = np.zeros(5), np.zeros(2), np.array([0.0, 1.0])
    drive(state, still, go, CAR_PROFILES["sim4"].constants(), 0.021)
    assert_allclose(state, 0, atol=1e-12)
    drive(state, still, go, CAR_PROFILES["sim4"].constants(), 0.042)
    assert state[3] > 0.05


def test_heading_wraps():
    state = np.array([0.0, 0.0, np.pi - 0.01, 1.0, 0.3])
    command = np.array([0.3, 1.0])
    drive(state, command, command, CAR_PROFILES["sim4"].constants(), STEP_SECONDS)
    assert -np.pi < state[2] < -3.0


@pytest.mark.parametrize("profile", CAR_PROFILES)
def test_drive_agrees_with_the_reference(profile):
    rng = np.random.default_rng(0)
    n = 500
    states = rng.uniform([-5, -5, -np.pi, 0, -0.5], [5, 5, np.pi, 4, 0.5], size=(n, 5))
    before, commands = (rng.uniform([-0.52, 0.1], [0.52, 4.0], size=(n, 2)) for _ in range(2))
    seconds = 0.07
    expected = reference.drive(states, before, commands, CAR_PROFILES[profile], seconds)
    for state, old, new in zip(states, before, commands, strict=True):
        drive(state, old, new, CAR_PROFILES[profile].constants(), seconds)
    assert_allclose(states, expected, rtol=0, atol=1e-11)


def simtrace(name):
    """Episodes of a DeepRacer log: rows of x, y (m), yaw, steering (rad), speed (m/s), time (s)."""
    episodes = {}
    with (LOGS / name).open() as file:
        for row in csv.DictReader(file):
            if row["episode_status"] != "prepare":
                numbers = [
                    float(row[key]) for key in ("X", "Y", "yaw", "steer", "throttle", "tstamp")
                ]
                episodes.setdefault(row["episode"], []).append(numbers)
    return [np.array(rows) * [1, 1, *np.deg2rad([1, 1]), 1, 1] for rows in episodes.values()]


def front_of(state):
    return state[:2] + FRONT_OFFSET * np.array([np.cos(state[2]), np.sin(state[2])])


def one_second_errors(episode, profile, steps=15):
    """Drive with the logged commands; return errors of position (m) and yaw (rad) after 15 steps.

    The car's speed and steering angle are the model's since the start of the episode, its pose is
    the log's up to where a window begins.
    """
    constants, errors = CAR_PROFILES[profile].constants(), []
    follower = np.zeros(5)
    for start in range(len(episode) - steps):
        follower[2] = episode[start, 2]
        follower[:2] += episode[start, :2] - front_of(follower)
        free = follower.copy()
        for k in range(start, start + steps):
            before, command = episode[max(k - 1, 0), 3:5], episode[k, 3:5]
            drive(free, before, command, constants, episode[k + 1, 5] - episode[k, 5])
            if k == start:
                follower = free.copy()
        end = episode[start + steps]
        if start >= 5:
            turn = (free[2] - end[2] + np.pi) % (2 * np.pi) - np.pi
            errors.append([np.hypot(*(front_of(free) - end[:2])), abs(turn)])
    return errors


def median_errors(episodes, profile):
    return np.median([x for e in episodes for x in one_second_errors(e, profile)], axis=0)


@pytest.mark.skipif(not LOGS.is_dir(), reason="the DeepRacer logs are not here")
@pytest.mark.parametrize("kind", ["training-12", "evaluation-0"])
def test_sim4_follows_real_logs_four_times_closer_than_an_ideal_bicycle(kind):
    episodes = simtrace(f"drfc1-{kind}-iteration.csv")
    position, yaw = median_errors(episodes, "sim4")
    assert position < 0.12
    assert yaw < 0.15
    ideal, _ = median_errors(episodes, "ideal")
    assert ideal > 4 * position
