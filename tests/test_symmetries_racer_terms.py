"""The racer in a mirror: what a mirrored car earns on the same road."""

from dataclasses import replace

import numpy as np
import pytest

from repaint_cli.envs.racer.dynamics.bots import SIDE
from repaint_cli.envs.racer.dynamics.encounters import CAR_BODY, NEXT, meet
from repaint_cli.envs.racer.dynamics.rules import traffic_terms
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.names import OBJECT_TERMS, TERMS
from repaint_cli.envs.racer.sight.camera import lens
from repaint_cli.envs.racer.simulator import RacerSimulator
from repaint_cli.envs.racer.track.track import Track

N_CARS, N_STEPS = 8, 125
(SYMMETRY,) = RacerSimulator(simulator="racer", n_bots=3).symmetries()


def straight_road():
    """It is its own mirror image, but for its borders' names: the inner one is on the left."""
    along = np.linspace(0, 9, 91)
    lines = [np.stack([along, np.full_like(along, y)], 1) for y in (0.0, 0.5, -0.5)]
    return Track.from_waypoints(np.hstack(lines), "straight")


def terms_played():
    """The terms of each step (T, N) on a straight road, those in the mirror, and where cars are."""
    env, mirror = (RacerVectorEnv(straight_road(), N_CARS) for _ in range(2))
    env.reset(seed=0)
    mirror.reset(seed=0)
    rng, infos = np.random.default_rng(1), []
    for _ in range(N_STEPS):
        actions = rng.integers(10, size=N_CARS)
        infos.append((env.step(actions)[-1], mirror.step(SYMMETRY.act(actions))[-1]))
    each = [{name: np.array([two[i][name] for two in infos]) for name in TERMS} for i in (0, 1)]
    return *each, np.array([two[0]["y"] for two in infos])


def traffic_met(states, along, poses, bots_along, lanes):
    """The terms of cars (N, …) among bots (N, B, …) whose next bot's side is its pose's last."""
    n = len(states)
    met = np.zeros((n, 6))
    meet(np.arange(n), states, along, 40.0, poses, bots_along, CAR_BODY, CAR_BODY, lens(), met)
    next_sides = poses[np.arange(n), met[:, NEXT].astype(int), SIDE]
    return traffic_terms(met, next_sides, lanes)


def traffic_terms_met():
    """The terms of 1,000 cars among three bots on a straight road, and those in the mirror."""
    rng = np.random.default_rng(0)
    states = rng.uniform(-1, 1, (1000, 5)) * [1, 0.5, 0.5, 1, 0.5]
    poses = rng.uniform(-1, 1, (1000, 3, 4)) * [2, 0.5, 0.5, 1]
    poses[..., SIDE] = np.sign(poses[..., 1])
    along, bots_along = states[:, 0] + 20, poses[..., 0] + 20
    lanes = np.sign(states[:, 1])
    reflected = poses * [1, -1, -1, -1]
    return (
        traffic_met(states, along, poses, bots_along, lanes),
        traffic_met(states * [1, -1, -1, 1, -1], along, reflected, bots_along, -lanes),
    )


@pytest.fixture(scope="module")
def on_the_same_road():
    """Every term of many steps, and of those in the mirror; and where `lane` is a matter of side.

    In the very middle no border is the nearer.
    """
    one, other, y = terms_played()
    met, reflected = traffic_terms_met()
    sided = {name: y != 0 for name in one} | {name: ... for name in met}
    return SYMMETRY, one | met, other | reflected, sided


def unlike(symmetry, one, other, sided):
    """Name the terms that are not multiplied by their parity in the mirror."""
    return {
        name for name, where in sided.items()
        if (symmetry.parity(name) * one[name][where] != other[name][where]).any()
    }  # fmt: skip


def test_terms_on_the_same_road_stay_or_change_their_sign_as_the_symmetry_says(on_the_same_road):
    _, one, *_ = on_the_same_road
    assert one.keys() == TERMS | OBJECT_TERMS
    assert all(values.any() for values in one.values())  # else any sign would do
    assert unlike(*on_the_same_road) == set()


@pytest.mark.parametrize("name", sorted(TERMS | OBJECT_TERMS))
def test_every_wrong_parity_is_seen(on_the_same_road, name):
    symmetry, *played = on_the_same_road
    assert unlike(replace(symmetry, odd=symmetry.odd ^ {name}), *played) == {name}


def test_of_a_reward_function_no_parity_is_known():
    assert SYMMETRY.parity("function") is None
